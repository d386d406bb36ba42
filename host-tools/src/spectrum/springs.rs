//! Springs of a bench, from nothing, and of a model's joints, with bends or without.

use realfft::num_complex::Complex64;

use super::bends::{self, Judged};
use super::error::FrfError;
use super::fit::{Fit, Problem};
use super::flexible::Plant;
use super::friction::Drive;
use super::layout::{Layout, Unknown};
use super::response::{Point, Response};
use super::rigid::{Bend, Links, Motors};
use super::start::{self, Drives, Known};
use crate::catalogue;
use crate::model::Model;

/// One spring is fitted up to so many times its resonance: beyond it are further modes that a bench's model does not have. On the two-mass bench
/// anything between 1.8 and 2.9 moves the antiresonance by less than 0.02 Hz and the load's gain by less than 1 %.
const ONE_SPRING: f64 = 2.5;
/// Friction of fast motion is that of slow motion to this share: what differs (sticking between samples, presliding) is in no model here.
pub(super) const FRICTION_DOUBT: f64 = 0.05;

/// Fits, each with the links where the springs of the fit before let them sag, and with the mean along the path at its values: each leaves a third of
/// what the one before was off. The first one's dampers are off by 10 %, where a joint's inertia changes by a quarter along the path.
const FITS: usize = 3;
/// Share of what the mean along the path moves that its being taken at standstill may be off. Of a simulated arm of six axes the responses at
/// antiresonances differed from those of the mean plant by 0.1 to 0.15, and from that mean by 0.01 to 0.02.
pub(super) const STANDSTILL_DOUBT: f64 = 0.2;

/// The joints' drives by a model; without a model nothing is known.
pub(super) fn drives(model: Option<&Model>, joints: &[String]) -> Vec<Drive> {
    let value =
        |effect, joint: &String| known(model, effect, joint).map_or(0.0, |(value, _)| value);
    let drive = |joint| Drive {
        coulomb: value("coulomb", joint),
        armature: value("armature", joint),
    };
    joints.iter().map(drive).collect()
}

/// The value of a plain effect in the model, if it has one, with its standard deviation; without one a tenth of it.
fn known(model: Option<&Model>, effect: &str, joint: &str) -> Known {
    let model = model?;
    let joint = model.robot().joint(joint).ok()?;
    let estimate = model
        .effect(catalogue::effect_named(effect)?, joint)?
        .estimate()?;
    Some((
        estimate.value,
        estimate.std.unwrap_or(0.1 * estimate.value.abs()),
    ))
}

/// What was fitted.
pub(super) struct Fitted<'a> {
    pub(super) problem: Problem<'a>,
    pub(super) fit: Fit,
    /// Held-out error of the rigid model.
    pub(super) rigid: f64,
    /// With springs at the joints alone; the same as the fit's where it has no bends.
    pub(super) springs: f64,
    /// Bends of the fit, in the order of its unknowns.
    pub(super) bends: Vec<Bend>,
    /// Bends that were judged.
    pub(super) candidates: Vec<Judged>,
    /// Joints whose body the responses contradict.
    pub(super) doubtful: Vec<String>,
}

/// Delays that are looked for, s: logs of buses and of two clocks are late by some cycles of 1 to 20 ms. Tried by half samples; a fit finds the rest.
const MOST_LATE: f64 = 0.1;

/// A body is doubtful if the fit moves it so many of its standard deviations, squared and summed over its ten parameters. One in a thousand right ones would
/// exceed 30; those of simulated arms reach 20, and 60 to 280 where a rigid fit of a slow log took springs for masses.
const DOUBTFUL: f64 = 50.0;

/// Joints whose body a fit moves beyond what the model says of it.
fn doubtful(fit: &Fit, links: &Links) -> Vec<String> {
    let mut sums: Vec<(&String, f64)> = Vec::new();
    for (m, (owner, doubt)) in links.owners().iter().zip(links.doubts()).enumerate() {
        let moved = fit.layout.value(&fit.x, Unknown::Rigid(m)) / doubt;
        match sums.iter_mut().find(|(own, _)| *own == owner) {
            Some((_, sum)) => *sum += moved * moved,
            None => sums.push((owner, moved * moved)),
        }
    }
    let beyond = sums.into_iter().filter(|(_, sum)| *sum > DOUBTFUL);
    beyond.map(|(owner, _)| owner.clone()).collect()
}

/// What the model knows of an effect at each joint.
pub(super) fn known_at(model: &Model, effect: &str, joints: &[String]) -> Vec<Known> {
    let of = |joint: &String| known(Some(model), effect, joint);
    joints.iter().map(of).collect()
}

/// A model's robot and its measurement: what all fits of it have in common.
pub(super) struct Arm<'a, 'p> {
    pub(super) model: &'a Model,
    pub(super) joints: &'a [String],
    pub(super) points: &'p [Point],
    pub(super) omega: &'a [f64],
    pub(super) dt: f64,
}

/// A fit of an arm with some bends, and what it was made with.
pub(super) struct Found<'p> {
    pub(super) bends: Vec<Bend>,
    pub(super) links: Links,
    pub(super) problem: Problem<'p>,
    pub(super) fit: Fit,
}

impl<'p> Arm<'_, 'p> {
    pub(super) fn motors(&self) -> Vec<Motors<'p>> {
        let of = |point: &'p Point| Motors {
            middle: &point.q,
            path: &point.path,
        };
        self.points.iter().map(of).collect()
    }

    /// The links with these bends.
    pub(super) fn links(&self, bends: &[Bend]) -> Result<Links, FrfError> {
        Links::new(self.model, self.joints, bends, &self.motors())
    }

    pub(super) fn problem(&self, plants: Vec<Plant>) -> Problem<'p> {
        Problem {
            points: self.points.iter().collect(),
            plants,
            along: Vec::new(),
            omega: self.omega.to_vec(),
            used: self.omega.len(),
            dt: self.dt,
        }
    }

    /// Unknowns, and where their fit begins, for links with these plants: by the responses' antiresonances.
    fn layout(&self, links: &Links, plants: &[Plant]) -> (Layout, Vec<Vec<f64>>) {
        let [armature, viscous] =
            ["armature", "viscous"].map(|of| known_at(self.model, of, self.joints));
        let drives = Drives {
            armature: &armature,
            viscous: &viscous,
            doubts: links.doubts(),
        };
        let own: Vec<&Point> = self.points.iter().collect();
        start::joints(&own, plants, self.omega, &drives)
    }

    /// Fits with springs that make the links sag, beginning with plants and means along paths that do not know them.
    fn fit(
        &self,
        bends: Vec<Bend>,
        links: Links,
        (layout, mut starts): (Layout, Vec<Vec<f64>>),
        (mut plants, mut along): (Vec<Plant>, Vec<Response>),
    ) -> Option<Found<'p>> {
        let mut found = None;
        let motors = self.motors();
        let mut lacking = None;
        for _ in 0..FITS {
            let mut problem = self.problem(plants);
            problem.along = along;
            let (state, now) = problem.settle(&layout, &starts, lacking)?;
            lacking = Some(now);
            let of = |unknown: Unknown| 1.0 / layout.value(&state.x, unknown);
            let joints = (0..self.joints.len()).map(Unknown::Stiffness);
            let compliance: Vec<f64> = joints
                .chain((0..bends.len()).map(Unknown::BendStiffness))
                .map(of)
                .collect();
            let next = links.plants(&motors, &compliance).ok()?;
            let sagged = self.problem(next.means);
            along = sagged.mean_along(&layout, &state.x, &next.along)?;
            plants = sagged.plants;
            starts = vec![state.x.clone()];
            found = Some((problem, state, now));
        }
        let (mut problem, state, lacking) = found?;
        // With the plants that it was fitted with: about another minimum all that is left out in turn would move it alike.
        let fit = problem.judged(&layout, state, lacking);
        let fit = fit.filter(|fit| fit.error().is_finite())?;
        (problem.plants, problem.along) = (plants, along);
        Some(Found {
            bends,
            links,
            problem,
            fit,
        })
    }

    /// Springs at the joints alone, and the held-out error without them.
    fn springs(&self) -> Result<(f64, Found<'p>), FrfError> {
        let links = self.links(&[])?;
        // Springs yield under gravity, so that the links are not where the motors are. How far is not known before there are springs.
        let stiff = vec![0.0; self.joints.len()];
        let plants = links.plants(&self.motors(), &stiff)?.means;
        let (layout, starts) = self.layout(&links, &plants);
        let (own, x) = start::rigid(&layout, &starts[0], &plants, self.omega);
        let problem = self.problem(plants);
        let rigid = problem.error(&own, &[x]);
        let plants = (problem.plants, Vec::new());
        let found = self.fit(Vec::new(), links, (layout, starts), plants);
        let found = found.ok_or(FrfError::NoFit {
            before: rigid,
            after: f64::INFINITY,
        })?;
        Ok((rigid, found))
    }

    /// A fit with one bend more than another one's, beginning at that and these values of the bend: stiffness and damping. None where no fit is found.
    pub(super) fn with_bend(
        &self,
        before: &Found,
        bend: Bend,
        spring: [f64; 2],
    ) -> Result<Option<Found<'p>>, FrfError> {
        let bends = [&before.bends[..], &[bend]].concat();
        let links = self.links(&bends)?;
        let sagged = links.plants(&self.motors(), &before.compliance(bends.len()))?;
        let (layout, x) = self.extended(before, &links, &[spring], &sagged.means);
        let plants = (sagged.means, before.problem.along.clone());
        Ok(self.fit(bends, links, (layout, vec![x]), plants))
    }

    /// The layout of links with further bends, and an entry at another fit's values and these of the bends.
    pub(super) fn extended(
        &self,
        before: &Found,
        links: &Links,
        more: &[[f64; 2]],
        plants: &[Plant],
    ) -> (Layout, Vec<f64>) {
        let (mut layout, starts) = self.layout(links, plants);
        let mut x = starts.into_iter().next().unwrap_or_default();
        for (entry, unknown) in x.iter_mut().zip(&layout.unknowns) {
            let own = match *unknown {
                Unknown::Rigid(m) => before.links.same_direction(links, m).map(Unknown::Rigid),
                other => Some(other),
            };
            let own = own.and_then(|own| before.fit.layout.index(own));
            *entry = own.map_or(*entry, |index| before.fit.x[index]);
        }
        let known = before.bends.len();
        let value = |of: Unknown| before.fit.layout.value(&before.fit.x, of);
        for e in 0..known + more.len() {
            let unknowns = [Unknown::BendStiffness(e), Unknown::BendDamping(e)];
            let values = match e.checked_sub(known) {
                Some(n) => more[n],
                None => unknowns.map(value),
            };
            for (unknown, value) in unknowns.into_iter().zip(values) {
                x.push(start::push(&mut layout, unknown, value, None, 1.0));
            }
        }
        (layout, x)
    }
}

impl Found<'_> {
    /// How the joints' springs and the first bends yield, rad/(N m); further bends, up to so many in all, do not.
    pub(super) fn compliance(&self, bends: usize) -> Vec<f64> {
        let joints = (0..self.links.motors()).map(Unknown::Stiffness);
        let all = joints.chain((0..bends).map(Unknown::BendStiffness));
        let of = |unknown: Unknown| self.fit.layout.value(&self.fit.x, unknown);
        all.map(|unknown| match of(unknown) {
            k if k > 0.0 => 1.0 / k,
            _ => 0.0,
        })
        .collect()
    }
}

/// Springs of a model's joints, and bends that the model file has or that are missing; `doubted` are the points with less dry friction, which moves the
/// estimates by what it may be wrong.
pub(super) fn with_model<'a>(
    model: &Model,
    joints: &[String],
    [points, doubted]: [&'a [Point]; 2],
    omega: &[f64],
    dt: f64,
) -> Result<Fitted<'a>, FrfError> {
    let arm = Arm {
        model,
        joints,
        points,
        omega,
        dt,
    };
    let (rigid, found) = arm.springs()?;
    let springs = found.fit.error();
    let (found, candidates) = bends::search(&arm, found)?;
    // Without blocks of responses no scatter shows the distortion, so that lines weigh too much and move right masses too.
    let has_responses = points.iter().all(|point| point.torque.is_empty());
    let doubtful = match has_responses {
        true => doubtful(&found.fit, &found.links),
        false => Vec::new(),
    };
    let Found {
        bends,
        mut fit,
        problem,
        ..
    } = found;
    // Two things that no scatter shows: friction that differs from slow motion's, and matrices that change along the slow motion.
    let problem = Problem {
        points: doubted.iter().collect(),
        ..problem
    };
    if doubted.len() == points.len() {
        problem.doubted(&mut fit, 1.0);
    }
    let mut problem = Problem {
        points: points.iter().collect(),
        ..problem
    };
    let along = std::mem::take(&mut problem.along);
    problem.doubted(&mut fit, STANDSTILL_DOUBT);
    problem.along = along;
    Ok(Fitted {
        problem,
        fit,
        rigid,
        springs,
        bends,
        candidates,
        doubtful,
    })
}

/// Motor, spring and load of a bench, from nothing.
pub(super) fn bench<'a>(points: &'a [Point], omega: &[f64], dt: f64) -> Option<Fitted<'a>> {
    let own: Vec<&Point> = points.iter().collect();
    let (layout, starts) = start::bench(&own, omega);
    let mut problem = Problem {
        plants: own.iter().map(|_| start::bench_plant()).collect(),
        along: Vec::new(),
        points: own,
        omega: omega.to_vec(),
        used: omega.len(),
        dt,
    };
    let first = problem.fit(&layout, &starts)?;
    let (_, resonance, _) = mode_of_bench(&first, &first.x);
    let used = omega
        .iter()
        .filter(|w| **w <= ONE_SPRING * resonance)
        .count();
    // Fewer lines than both sides of a resonance need would be another problem.
    problem.used = if used >= 12 { used } else { omega.len() };
    let fit = problem.fit(&layout, &[first.x])?;
    let (stiff, x) = start::rigid(&layout, &fit.x, &problem.plants, omega);
    let rigid = problem.error(&stiff, &[x]);
    Some(Fitted {
        springs: fit.error(),
        problem,
        rigid,
        fit,
        bends: Vec::new(),
        candidates: Vec::new(),
        doubtful: Vec::new(),
    })
}

/// Held-out error of springs at the joints alone if all positions were so many times as large, and the responses at each angular frequency; none where no
/// fit is found.
pub(super) fn if_times(
    model: Option<&Model>,
    joints: &[String],
    points: &[Point],
    (omega, dt): (&[f64], f64),
    (position, factor): (f64, impl Fn(f64) -> Complex64),
) -> Option<f64> {
    let mut changed = points.to_vec();
    for point in &mut changed {
        let positions = point.q.iter_mut().chain(point.path.iter_mut().flatten());
        positions.for_each(|q| *q *= position);
        for response in std::iter::once(&mut point.mean).chain(&mut point.blocks) {
            for (line, omega) in response.iter_mut().zip(omega) {
                *line *= factor(*omega);
            }
        }
    }
    let points = &changed[..];
    let Some(model) = model else {
        return Some(bench(points, omega, dt)?.springs);
    };
    let arm = Arm {
        model,
        joints,
        points,
        omega,
        dt,
    };
    Some(arm.springs().ok()?.1.fit.error())
}

/// By how much positions are later than their torques, s: a motor's own response has a phase from −π to 0, for it takes energy from its
/// torque at every frequency, and what is later has one beyond (Desoer & Vidyasagar 1975, *Feedback Systems*, ch. VI). None where all are within, or where
/// experiments are too few for responses.
pub(super) fn lateness(points: &[Point], omega: &[f64], dt: f64) -> Option<f64> {
    let responses = points.iter().filter(|point| point.torque.is_empty());
    let own: Vec<(f64, Complex64)> = responses
        .flat_map(|point| point.mean.iter().zip(omega))
        .flat_map(|(g, &omega)| g.diagonal().iter().map(|g| (omega, *g)).collect::<Vec<_>>())
        .collect();
    let beyond = |late: f64| -> f64 {
        let of = |(omega, g): &(f64, Complex64)| {
            let turned = g * Complex64::new(0.0, omega * late).exp();
            (turned.im / turned.norm()).max(0.0).powi(2)
        };
        own.iter().map(of).sum()
    };
    let steps = (2.0 * MOST_LATE / dt) as i32;
    // The nearest to none first: of equals it stays.
    let all = (1..=steps).flat_map(|n| [n, -n]);
    let all = all.map(|n| 0.5 * dt * f64::from(n));
    let mut best = (beyond(0.0), 0.0);
    for late in all {
        let own = beyond(late);
        if own < best.0 {
            best = (own, late);
        }
    }
    (best.1 != 0.0).then_some(best.1)
}

/// Antiresonance and resonance, rad/s, and the inertia ratio of a bench.
fn mode_of_bench(fit: &Fit, x: &[f64]) -> (f64, f64, f64) {
    let value = |of: Unknown| fit.layout.value(x, of);
    mode(
        value(Unknown::Stiffness(0)),
        value(Unknown::LinkInertia),
        value(Unknown::Armature(0)),
    )
}

/// Antiresonance and resonance, rad/s, and the ratio of link and motor.
pub(super) fn mode(stiffness: f64, link: f64, motor: f64) -> (f64, f64, f64) {
    let antiresonance = (stiffness / link).sqrt();
    let resonance = (stiffness * (1.0 / link + 1.0 / motor)).sqrt();
    (antiresonance, resonance, link / motor)
}
