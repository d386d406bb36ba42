//! Where the measuring system and the targets are, from nothing: mount and targets in turn, then both together.
//!
//! For known targets the mount is a rotation between two clouds of points (Kabsch 1976; Arun, Huang & Blostein 1987), for a known mount each
//! target is a mean. The two steps in turn come near; Gauss-Newton over both ends it.

use nalgebra::{DVector, Matrix3, Vector3};
use proprio_core::spatial::Transform;

use super::chain::{Chain, State, inverse, point};
use super::columns::{Column, Noise, Unknown, rows};
use super::held_out::solve;
use super::poses::Pose;

/// Rounds of the two steps in turn.
const ROUNDS: usize = 12;
/// Steps of both together.
const STEPS: usize = 8;
/// How far mount and targets may be from where a step begins, m and rad: no statement, but no singular step either.
pub(super) const FREE: f64 = 1.0;
/// What the noise is taken to be while nothing is known of it: 1 mm and 1 mrad.
pub(super) const UNKNOWN_NOISE: Noise = Noise {
    place: 1e-3,
    turn: 1e-3,
};
/// A step that moves mount and targets by less, m and rad, is the last.
const SETTLED: f64 = 1e-6;

/// The mount and the targets that fit the poses best, all else as it is in `state`; and the error that is left: root mean square distance, m.
pub(super) fn fit(chain: &Chain, state: &State, poses: &[(usize, &Pose)]) -> (State, f64) {
    let mut state = state.clone();
    let links: Vec<Vec<Transform<f64>>> = poses
        .iter()
        .map(|(_, pose)| {
            let frames = chain.frames(&state, pose);
            let of = |body: Option<usize>| body.map_or(Transform::identity(), |b| frames.link[b]);
            state.targets.iter().map(|target| of(target.body)).collect()
        })
        .collect();
    for _ in 0..ROUNDS {
        state.mount = mount(&state, &links, poses);
        place_targets(&mut state, &links, poses);
    }
    state.mount = mount(&state, &links, poses);
    turn_targets(&mut state, &links, poses);
    let columns = columns(&state, poses);
    let mut error = f64::INFINITY;
    for _ in 0..STEPS {
        let rows = rows(chain, &state, poses, &columns, UNKNOWN_NOISE);
        let solved = solve(&rows, &DVector::zeros(columns.len()));
        let steps = columns.iter().zip(solved.step.iter());
        let steps: Vec<(Unknown, f64)> = steps.map(|(c, s)| (c.unknown, c.prior * s)).collect();
        let places = (0..rows.b.len()).filter(|&k| rows.is_place[k]);
        let squares: f64 = places
            .clone()
            .map(|k| (solved.left[k] * rows.unit[k]).powi(2))
            .sum();
        error = (3.0 * squares / places.count().max(1) as f64).sqrt();
        state = state.stepped(chain, &steps);
        if steps.iter().all(|(_, step)| step.abs() < SETTLED) {
            break;
        }
    }
    (state, error)
}

/// The unknowns of mount and targets.
pub(super) fn columns(state: &State, poses: &[(usize, &Pose)]) -> Vec<Column> {
    let free = |unknown| Column::about_zero(unknown, FREE);
    let mut columns: Vec<Column> = (0..6).map(|k| free(Unknown::Mount(k))).collect();
    for t in 0..state.targets.len() {
        let turned = poses.iter().any(|(_, pose)| {
            pose.measured[t]
                .as_ref()
                .is_some_and(|m| m.orientation.is_some())
        });
        let numbers = if turned { 6 } else { 3 };
        columns.extend((0..numbers).map(|k| free(Unknown::Target(t, k))));
    }
    columns
}

/// The rotation and place that carry the targets onto their measured places.
fn mount(state: &State, links: &[Vec<Transform<f64>>], poses: &[(usize, &Pose)]) -> Transform<f64> {
    let mut pairs = Vec::new();
    for ((_, pose), links) in poses.iter().zip(links) {
        for (t, measured) in pose.measured.iter().enumerate() {
            if let Some(measured) = measured {
                let place = state.targets[t].placement.translation;
                pairs.push((point(&links[t], &place), measured.place));
            }
        }
    }
    let count = pairs.len().max(1) as f64;
    let from = pairs.iter().map(|p| p.0).sum::<Vector3<f64>>() / count;
    let to = pairs.iter().map(|p| p.1).sum::<Vector3<f64>>() / count;
    let products = pairs.iter().map(|(a, b)| (b - to) * (a - from).transpose());
    let rotation = nearest_rotation(&products.sum());
    Transform {
        rotation,
        translation: to - rotation * from,
    }
}

/// The rotation nearest to a matrix.
fn nearest_rotation(m: &Matrix3<f64>) -> Matrix3<f64> {
    let svd = m.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        return Matrix3::identity();
    };
    let sign = (u * v_t).determinant().signum();
    u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t
}

/// Each target where the poses see it on average.
fn place_targets(state: &mut State, links: &[Vec<Transform<f64>>], poses: &[(usize, &Pose)]) {
    let back = inverse(&state.mount);
    for (t, target) in state.targets.iter_mut().enumerate() {
        let seen: Vec<Vector3<f64>> = (poses.iter().zip(links))
            .filter_map(|((_, pose), links)| {
                let measured = pose.measured[t].as_ref()?;
                Some(point(&inverse(&links[t]), &point(&back, &measured.place)))
            })
            .collect();
        if !seen.is_empty() {
            target.placement.translation = seen.iter().sum::<Vector3<f64>>() / seen.len() as f64;
        }
    }
}

/// Each target turned as the poses see it on average.
fn turn_targets(state: &mut State, links: &[Vec<Transform<f64>>], poses: &[(usize, &Pose)]) {
    for (t, target) in state.targets.iter_mut().enumerate() {
        let seen: Matrix3<f64> = (poses.iter().zip(links))
            .filter_map(|((_, pose), links)| {
                let measured = pose.measured[t].as_ref()?.orientation?;
                let link = state.mount.rotation * links[t].rotation;
                Some(link.tr_mul(&measured))
            })
            .sum();
        if seen != Matrix3::zeros() {
            target.placement.rotation = nearest_rotation(&seen);
        }
    }
}
