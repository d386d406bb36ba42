//! Where a fit begins: springs by the antiresonances of the measured responses, and what the model says.

use nalgebra::DMatrix;
use realfft::num_complex::Complex64;

use super::flexible::Plant;
use super::layout::{Layout, Unknown};
use super::response::Point;
use super::rigid::doubt;
use crate::robust::median;

/// A logarithm that nothing is known of but its order: three decades either way at 1σ, so that no fit runs off to nothing.
const DECADES: f64 = 7.0;
/// A delay of a drive before the data, ms.
const DELAY: f64 = 2.0;
/// Damping ratio of a gear, to begin with.
const DAMPING_RATIO: f64 = 0.03;
/// How many antiresonances of a bench are tried.
const TRIED: usize = 3;
/// Springs that are no springs: their resonance is so many times the highest line.
const STIFF: f64 = 100.0;

/// What is known of a joint's drive before: value and standard deviation.
pub(super) type Known = Option<(f64, f64)>;

/// |ω² G_ii|, mean over points: inverse inertia at each line.
fn inverse_inertia(points: &[&Point], omega: &[f64], joint: usize) -> Vec<f64> {
    let at = |(line, omega): (usize, &f64)| {
        let sum: f64 = points
            .iter()
            .map(|p| p.mean[line][(joint, joint)].norm().ln())
            .sum();
        omega * omega * (sum / points.len().max(1) as f64).exp()
    };
    omega.iter().enumerate().map(at).collect()
}

/// The deepest minima, the deepest first: angular frequencies.
fn minima(inverse_inertia: &[f64], omega: &[f64]) -> Vec<f64> {
    const BESIDE: usize = 3;
    let n = inverse_inertia.len();
    let mut found: Vec<(f64, f64)> = (1..n.saturating_sub(1))
        .filter_map(|k| {
            let around = k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(n);
            let least = around
                .clone()
                .all(|l| inverse_inertia[l] >= inverse_inertia[k]);
            let highest = around.map(|l| inverse_inertia[l]).fold(0.0, f64::max);
            least.then(|| (inverse_inertia[k] / highest, omega[k]))
        })
        .collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, omega)| omega).collect()
}

fn tenth(x: &[f64], from_end: bool) -> f64 {
    let count = (x.len() / 10).max(1).min(x.len());
    let part = if from_end {
        &x[x.len() - count..]
    } else {
        &x[..count]
    };
    median(part.iter().copied()).unwrap_or_default()
}

/// A bench of one joint, of which no model says anything: unknowns and starts.
pub(super) fn bench(points: &[&Point], omega: &[f64]) -> (Layout, Vec<Vec<f64>>) {
    let seen = inverse_inertia(points, omega, 0);
    let whole = 1.0 / tenth(&seen, false).max(1e-300);
    let mut places = minima(&seen, omega);
    places.truncate(TRIED);
    if places.is_empty() {
        places.push(omega[omega.len() / 2]);
    }
    let unknowns = [
        Unknown::Stiffness(0),
        Unknown::Damping(0),
        Unknown::Viscous(0),
        Unknown::Armature(0),
        Unknown::LinkViscous(0),
        Unknown::LinkInertia,
        Unknown::Delay,
    ];
    let mut starts = Vec::new();
    for place in &places {
        for share in [0.25, 0.5, 0.75] {
            let (motor, link) = (whole * (1.0 - share), whole * share);
            let stiffness = link * place * place;
            let slow = 1e-3 * whole * omega[0];
            let values = [
                stiffness,
                2.0 * DAMPING_RATIO * stiffness / place,
                slow,
                motor,
                slow,
                link,
                0.0,
            ];
            let entries = unknowns
                .iter()
                .zip(values)
                .map(|(u, v)| Layout::entry(*u, v));
            starts.push(entries.collect::<Vec<f64>>());
        }
    }
    let mut layout = Layout::default();
    for (unknown, start) in unknowns.iter().zip(&starts[0]) {
        let std = if unknown.is_log() { DECADES } else { DELAY };
        layout.push(*unknown, Some((*start, std)));
    }
    (layout, starts)
}

/// The plant of a bench.
pub(super) fn bench_plant() -> Plant {
    Plant {
        motors: 1,
        inertia: DMatrix::from_element(1, 1, 1.0),
        gravity: DMatrix::zeros(1, 1),
        rigid: Vec::new(),
    }
}

/// What the model knows of the joints' drives, and how far the links' masses may be off.
pub(super) struct Drives<'a> {
    pub(super) armature: &'a [Known],
    pub(super) viscous: &'a [Known],
    /// Of each rigid direction of the plants.
    pub(super) doubts: &'a [f64],
}

/// Joints in front of a model's links: unknowns and starts, springs by the antiresonances of the measured responses.
pub(super) fn joints(
    points: &[&Point],
    plants: &[Plant],
    omega: &[f64],
    drives: &Drives<'_>,
) -> (Layout, Vec<Vec<f64>>) {
    let of_few = || by_motion(points, plants, omega, drives);
    let by_antiresonance = || {
        (0..drives.armature.len()).map(|i| {
            let place = minima(&inverse_inertia(points, omega, i), omega)
                .first()
                .copied();
            let place = place.unwrap_or(omega[omega.len() / 2]);
            spring_at(mean_inertia(plants, i), place)
        })
    };
    let springs: Vec<[f64; 2]> = match points.iter().any(|p| !p.torque.is_empty()) {
        true => of_few(),
        false => by_antiresonance().collect(),
    };
    let (layout, start) = around(&springs, plants, omega, drives);
    // Springs half and twice as stiff: a minimum may be a neighbour's.
    let starts = [1.0, 0.5, 2.0].map(|factor: f64| {
        let scaled = layout.unknowns.iter().zip(&start);
        let entry = |(unknown, entry): (&Unknown, &f64)| match unknown {
            Unknown::Stiffness(_) => entry + factor.ln(),
            _ => *entry,
        };
        scaled.map(entry).collect::<Vec<f64>>()
    });
    (layout, starts.into())
}

/// Springs where there are no responses: a spring's torque is what the motor's does not accelerate, it moves the links, and is in proportion to how far
/// motor and link are apart. Viscous friction, gravity and damping are left out: this is where a fit begins.
fn by_motion(
    points: &[&Point],
    plants: &[Plant],
    omega: &[f64],
    drives: &Drives<'_>,
) -> Vec<[f64; 2]> {
    let n = drives.armature.len();
    let (mut product, mut square) = (vec![0.0; n], vec![0.0; n]);
    for (point, plant) in points.iter().zip(plants) {
        let links = plant.inertia.view((0, 0), (n, n)).into_owned();
        let Some(mobility) = links.try_inverse() else {
            continue;
        };
        for ((q, torque), w) in point.mean.iter().zip(&point.torque).zip(omega) {
            let mut spring = torque.clone();
            for i in 0..n {
                let motor = drives.armature[i].map_or(0.3 * plant.inertia[(i, i)], |(j, _)| j);
                let accelerated = q.row(i) * Complex64::from(motor * w * w);
                let mut own = spring.row_mut(i);
                own += accelerated;
            }
            // −ω² H x = τ.
            let link = mobility.map(Complex64::from) * &spring * Complex64::from(-1.0 / (w * w));
            for i in 0..n {
                for (torque, (q, x)) in spring.row(i).iter().zip(q.row(i).iter().zip(&link.row(i)))
                {
                    let apart = q - x;
                    product[i] += (apart.conj() * torque).re;
                    square[i] += apart.norm_sqr();
                }
            }
        }
    }
    let spring = |i: usize| {
        let inertia = mean_inertia(plants, i);
        let lowest = inertia * omega[0] * omega[0];
        let stiffness = (product[i] / square[i].max(1e-300)).max(lowest);
        spring_at(inertia, (stiffness / inertia).sqrt())
    };
    (0..n).map(spring).collect()
}

/// H of a link or bend, mean over points.
pub(super) fn mean_inertia(plants: &[Plant], i: usize) -> f64 {
    plants.iter().map(|p| p.inertia[(i, i)]).sum::<f64>() / plants.len().max(1) as f64
}

/// Stiffness and damping with which a link of this inertia swings against a motor that is held at `place`, rad/s.
pub(super) fn spring_at(inertia: f64, place: f64) -> [f64; 2] {
    let stiffness = inertia * place * place;
    [stiffness, 2.0 * DAMPING_RATIO * stiffness / place]
}

/// Unknowns, and a start at these springs (stiffness, damping).
pub(super) fn around(
    springs: &[[f64; 2]],
    plants: &[Plant],
    omega: &[f64],
    drives: &Drives<'_>,
) -> (Layout, Vec<f64>) {
    let mut layout = Layout::default();
    let mut start = Vec::new();
    let mut add = |unknown: Unknown, value: f64, prior: Option<f64>, doubt: f64| {
        start.push(push(&mut layout, unknown, value, prior, doubt));
    };
    for (i, &[stiffness, damping]) in springs.iter().enumerate() {
        let inertia = mean_inertia(plants, i);
        add(Unknown::Stiffness(i), stiffness, None, 1.0);
        add(Unknown::Damping(i), damping, None, 1.0);
        // Viscous friction of slow motion need not hold here: it only says where to begin.
        let slow = 1e-2 * inertia * omega[0];
        let viscous = drives.viscous[i].map_or(slow, |(value, _)| value.max(1e-6 * slow));
        add(Unknown::Viscous(i), viscous, None, 1.0);
        match drives.armature[i] {
            Some((value, std)) if value > 0.0 => {
                let std = (std / value).clamp(1e-3, DECADES);
                add(Unknown::Armature(i), value, Some(std), doubt(1.0, std));
            }
            _ => add(Unknown::Armature(i), 0.3 * inertia, None, 1.0),
        }
    }
    add(Unknown::Delay, 0.0, None, 1.0);
    for (m, doubt) in drives.doubts.iter().enumerate() {
        add(Unknown::Rigid(m), 0.0, Some(1.0), *doubt);
    }
    (layout, start)
}

/// Adds an unknown about a value, within this standard deviation or, where none is known, within its kind's; its entry.
pub(super) fn push(
    layout: &mut Layout,
    unknown: Unknown,
    value: f64,
    prior: Option<f64>,
    doubt: f64,
) -> f64 {
    let entry = Layout::entry(unknown, value);
    let std = prior.unwrap_or(if unknown.is_log() { DECADES } else { DELAY });
    layout.push_doubted(unknown, Some((entry, std)), doubt);
    entry
}

/// The same without springs: stiff ones, fixed.
pub(super) fn rigid(
    layout: &Layout,
    start: &[f64],
    plants: &[Plant],
    omega: &[f64],
) -> (Layout, Vec<f64>) {
    let top = STIFF * omega.last().copied().unwrap_or(1.0);
    let mut own = Layout::default();
    let mut x = Vec::new();
    let armature = |i: usize| {
        layout
            .index(Unknown::Armature(i))
            .map_or(0.0, |n| start[n].exp())
    };
    for (n, unknown) in layout.unknowns.iter().enumerate() {
        match *unknown {
            Unknown::Stiffness(i) => {
                let inertia = plants
                    .iter()
                    .map(|p| p.inertia[(i, i)])
                    .fold(armature(i), f64::max);
                own.fixed.push((*unknown, inertia * top * top));
            }
            // Of one mass there is one inertia and one friction.
            Unknown::LinkInertia => own.fixed.push((*unknown, 0.0)),
            Unknown::Damping(_) | Unknown::LinkViscous(_) => {}
            Unknown::Armature(0) if layout.has(Unknown::LinkInertia) => {
                let link = layout.value(start, Unknown::LinkInertia);
                own.push_doubted(*unknown, layout.priors[n], layout.doubts[n]);
                x.push((start[n].exp() + link).ln());
            }
            _ => {
                own.push_doubted(*unknown, layout.priors[n], layout.doubts[n]);
                x.push(start[n]);
            }
        }
    }
    (own, x)
}
