//! Residuals of poses, and how they change with each parameter: ΔZ = ∂Γ/∂θ Δθ (Hollerbach, Khalil & Gautier 2016).
//!
//! A row is measured less predicted, in the measuring system's frame: three places (m) of a target and, where it is measured, three numbers of
//! the rotation that is left (rad). Parameters are scaled by their priors, rows by their noise.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use proprio_core::spatial::Transform;

use super::chain::{Chain, Frames, State, small};
use super::poses::Pose;
use crate::model::JointQuantity as Q;

/// What is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unknown {
    /// The base in the measuring system's frame: shifts, then turns, in the base's frame.
    Mount(usize),
    /// A target in its link: shifts, then turns, in its own frame.
    Target(usize, usize),
    /// A joint frame's shift along the joint's axis (0) or across it (1, 2), m.
    Shift(usize, usize),
    /// Its turn about the axis (0: the joint's zero) or across it, rad.
    Turn(usize, usize),
    /// Another number of a joint.
    Joint(usize, Q),
}

/// An unknown, and what is taken to be true of it before the data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Column {
    pub(super) unknown: Unknown,
    /// Standard deviation about the mean, SI; of mount and targets about where they stand.
    pub(super) prior: f64,
    /// What it is taken to be before the data.
    pub(super) mean: f64,
}

impl Column {
    /// An unknown that is taken to be zero, or where it stands, within `prior`.
    pub(super) fn about_zero(unknown: Unknown, prior: f64) -> Self {
        Self {
            unknown,
            prior,
            mean: 0.0,
        }
    }
}

/// Noise of places (m) and of orientations (rad), one standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    pub(super) place: f64,
    pub(super) turn: f64,
}

/// Rows of a linear problem.
#[derive(Debug, Clone)]
pub(super) struct Rows {
    /// By parameter, scaled by prior and noise.
    pub(super) w: DMatrix<f64>,
    /// Measured less predicted, in units of the noise.
    pub(super) b: DVector<f64>,
    /// What each row's unit of noise is: m, or rad of an orientation.
    pub(super) unit: Vec<f64>,
    /// Whether a row is a place.
    pub(super) is_place: Vec<bool>,
    /// Which target a row is of.
    pub(super) target: Vec<usize>,
    /// Rows of each pose, by its place among the poses.
    pub(super) poses: Vec<(usize, std::ops::Range<usize>)>,
}

impl State {
    /// The value of an unknown: zero for mount and targets, which are corrected about where they stand.
    pub(super) fn value(&self, chain: &Chain, unknown: Unknown) -> f64 {
        let along = |joint: usize, n: usize, of: fn(usize) -> Q| -> f64 {
            let direction = chain.directions(joint)[n];
            (0..3)
                .map(|k| self.joints[joint][of(k).index()] * direction[k])
                .sum()
        };
        match unknown {
            Unknown::Mount(_) | Unknown::Target(..) => 0.0,
            Unknown::Shift(joint, n) => along(joint, n, Q::Shift),
            Unknown::Turn(joint, n) => along(joint, n, Q::Turn),
            Unknown::Joint(joint, quantity) => self.joints[joint][quantity.index()],
        }
    }

    /// The state after steps, each in its unknown's unit.
    pub(super) fn stepped(&self, chain: &Chain, steps: &[(Unknown, f64)]) -> Self {
        let mut next = self.clone();
        let mut mount = [Vector3::zeros(); 2];
        let mut targets = vec![[Vector3::zeros(); 2]; self.targets.len()];
        let mut add = |joint: usize, n: usize, of: fn(usize) -> Q, step: f64| {
            let direction = chain.directions(joint)[n];
            for k in 0..3 {
                next.joints[joint][of(k).index()] += step * direction[k];
            }
        };
        for &(unknown, step) in steps {
            match unknown {
                Unknown::Mount(k) => mount[k / 3][k % 3] += step,
                Unknown::Target(target, k) => targets[target][k / 3][k % 3] += step,
                Unknown::Shift(joint, n) => add(joint, n, Q::Shift, step),
                Unknown::Turn(joint, n) => add(joint, n, Q::Turn, step),
                Unknown::Joint(..) => {}
            }
        }
        for &(unknown, step) in steps {
            if let Unknown::Joint(joint, quantity) = unknown {
                next.joints[joint][quantity.index()] += step;
            }
        }
        next.mount = next.mount.compose(&small(mount[0], mount[1]));
        for (target, [shift, turn]) in next.targets.iter_mut().zip(targets) {
            target.placement = target.placement.compose(&small(shift, turn));
        }
        next
    }
}

/// The rows of these poses at a state.
pub(super) fn rows(
    chain: &Chain,
    state: &State,
    poses: &[(usize, &Pose)],
    columns: &[Column],
    noise: Noise,
) -> Rows {
    let count = poses.iter().map(|(_, pose)| numbers(pose)).sum();
    let mut rows = Rows {
        w: DMatrix::zeros(count, columns.len()),
        b: DVector::zeros(count),
        unit: Vec::with_capacity(count),
        is_place: Vec::with_capacity(count),
        target: Vec::with_capacity(count),
        poses: Vec::with_capacity(poses.len()),
    };
    let paths: Vec<Vec<bool>> = state
        .targets
        .iter()
        .map(|target| {
            let path = chain.path(target.body);
            (0..chain.joints())
                .map(|joint| path.contains(&joint))
                .collect()
        })
        .collect();
    let mut row = 0;
    for &(number, pose) in poses {
        let first = row;
        let frames = chain.frames(state, pose);
        for (t, measured) in pose.measured.iter().enumerate() {
            let Some(measured) = measured else { continue };
            let target = &state.targets[t];
            let link = target.body.map(|body| &frames.link[body]);
            let placed = link.map_or(target.placement, |link| link.compose(&target.placement));
            let seen = state.mount.compose(&placed);
            let unit = measured.std.unwrap_or(1.0) * noise.place;
            let left = measured.place - seen.translation;
            for axis in 0..3 {
                rows.b[row + axis] = left[axis] / unit;
            }
            let turned = measured
                .orientation
                .map(|r| rotation_left(&r, &seen.rotation));
            if let Some(turned) = turned {
                for axis in 0..3 {
                    rows.b[row + 3 + axis] = turned[axis] / noise.turn;
                }
            }
            for (n, column) in columns.iter().enumerate() {
                let moved = moved(
                    chain,
                    &frames,
                    pose,
                    (t, &paths[t], &placed),
                    column.unknown,
                );
                let Some([turn, shift]) = moved else { continue };
                let shift = state.mount.rotation * shift * (column.prior / unit);
                for axis in 0..3 {
                    rows.w[(row + axis, n)] = shift[axis];
                }
                if turned.is_some() {
                    let turn = state.mount.rotation * turn * (column.prior / noise.turn);
                    for axis in 0..3 {
                        rows.w[(row + 3 + axis, n)] = turn[axis];
                    }
                }
            }
            let more = if turned.is_some() { 6 } else { 3 };
            for k in 0..more {
                rows.unit.push(if k < 3 { unit } else { noise.turn });
                rows.is_place.push(k < 3);
                rows.target.push(t);
            }
            row += more;
        }
        rows.poses.push((number, first..row));
    }
    rows
}

/// How many numbers a pose measures.
pub(super) fn numbers(pose: &Pose) -> usize {
    let of = |measured: &super::poses::Measured| if measured.orientation.is_some() { 6 } else { 3 };
    pose.measured.iter().flatten().map(of).sum()
}

/// The rotation vector that turns the predicted frame into the measured one, in the measuring system's axes.
fn rotation_left(measured: &Matrix3<f64>, predicted: &Matrix3<f64>) -> Vector3<f64> {
    let left = Rotation3::from_matrix_unchecked(measured * predicted.transpose());
    left.scaled_axis()
}

/// Turn and displacement of a target per unit of an unknown, in the base's frame; none where it does not move the target.
fn moved(
    chain: &Chain,
    frames: &Frames,
    pose: &Pose,
    (number, on_path, placed): (usize, &[bool], &Transform<f64>),
    unknown: Unknown,
) -> Option<[Vector3<f64>; 2]> {
    let place = placed.translation;
    let unit = |k: usize| Vector3::from_fn(|row, _| f64::from(u8::from(row == k)));
    let about = |axis: Vector3<f64>, origin: Vector3<f64>| [axis, axis.cross(&(place - origin))];
    match unknown {
        Unknown::Mount(k) if k < 3 => Some([Vector3::zeros(), unit(k)]),
        Unknown::Mount(k) => Some(about(unit(k - 3), Vector3::zeros())),
        Unknown::Target(t, _) if t != number => None,
        Unknown::Target(_, k) if k < 3 => Some([Vector3::zeros(), placed.rotation * unit(k)]),
        Unknown::Target(_, k) => Some([placed.rotation * unit(k - 3), Vector3::zeros()]),
        Unknown::Joint(joint, _) | Unknown::Shift(joint, _) | Unknown::Turn(joint, _)
            if !on_path[joint] =>
        {
            None
        }
        // A correction comes before the bend: the joint's frame differs by that mrad from the one that is corrected.
        Unknown::Shift(joint, n) => {
            let frame = &frames.joint[joint];
            Some([
                Vector3::zeros(),
                frame.rotation * chain.directions(joint)[n],
            ])
        }
        Unknown::Turn(joint, n) => {
            let frame = &frames.joint[joint];
            Some(about(
                frame.rotation * chain.directions(joint)[n],
                frame.translation,
            ))
        }
        Unknown::Joint(joint, quantity) => {
            let frame = &frames.joint[joint];
            let [axis, ..] = chain.directions(joint);
            let q = pose.q[joint];
            let load = frames.load[joint];
            let along = |rate: f64| {
                let axis = frame.rotation * axis * rate;
                if chain.slides(joint) {
                    [Vector3::zeros(), axis]
                } else {
                    about(axis, frame.translation)
                }
            };
            let bent = |n: usize| {
                let axis = chain.directions(joint)[n + 1];
                about(frame.rotation * axis * load.dot(&axis), frame.translation)
            };
            Some(match quantity {
                // Along the frame's own axes: asked for by directions above.
                Q::Shift(_) | Q::Turn(_) => return None,
                Q::Ratio => along(q),
                Q::Coupling => along(chain.parent(joint).map_or(0.0, |parent| pose.q[parent])),
                Q::Sine => along(q.sin()),
                Q::Cosine => along(q.cos()),
                Q::Backlash => along(pose.side[joint] / 2.0),
                Q::Elasticity => along(load.dot(&axis)),
                Q::BendFirst => bent(0),
                Q::BendSecond => bent(1),
            })
        }
    }
}
