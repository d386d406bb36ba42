//! From a limb's motion to integrated rows: the momentum equation over windows, with every column of [`Columns`].
//!
//! A window's row for joint j is ([`proprio_core::window`])
//!
//! ```text
//! [W_m] − ∫ W_c dt + ∫ W_g dt  |  own effects: [boundary] + ∫ rate dt  |  d/dε of the rigid body's part   =   ∫ τ dt
//! ```
//!
//! all divided by the window's length. What changes the motion (velocity_gain, encoder_offset, elasticity, backlash) or
//! gravity (base_tilt) is no torque of its own; its column is the derivative of the rigid body's part at the inertias that
//! the limb has been given.

use nalgebra::{Rotation3, Vector3};
use proprio_core::effect::{EffectKind, JointState, MAX_COLUMNS, Term};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::column::{Column, Columns};
use super::dot::dot;
use super::folds::Blocks;
use super::motion::Motion;
use super::recording::LimbRecording;
use super::rigid_body::{RigidBody, Slopes};
use super::windows::Window;

/// Length of a window, µs.
pub(crate) const WINDOW_US: u64 = 20_000;
/// Slower than this a joint may be held by friction, whose torque is then anything up to its limit, rad/s.
pub(crate) const REST: f64 = 0.02;
/// Share of a window in which a joint may be so slow and the window still say something of its friction: one sample of a
/// Go2, which a reversal takes that friction does not hold up. A joint that is held, at each reversal for some
/// milliseconds, has a friction that runs from one limit to the other meanwhile, and no column that says so.
pub(crate) const MOST_REST: f64 = 0.125;
/// Columns of a load: its mass, its first moment, and the same inertia about all axes.
const LOAD_COLUMNS: usize = 5;

/// A limb as rows are made of it.
pub(crate) struct Limb<'a> {
    pub(crate) recording: &'a LimbRecording,
    pub(crate) motion: &'a Motion,
    pub(crate) body: &'a dyn RigidBody,
    /// Placement of the base in the world.
    pub(crate) base: Transform<f64>,
    pub(crate) columns: &'a Columns,
    pub(crate) blocks: &'a Blocks,
    /// Where loads are, m in the joint frames.
    pub(crate) loads: &'a [Vector3<f64>],
    /// Of each joint, what its columns are times in the model so far: its torque.
    pub(crate) model: Vec<Vec<f64>>,
    /// Reported over true torque of each joint.
    pub(crate) torque_scale: &'a [f64],
    /// Ranges of samples \[first, last\] whose windows belong to no block.
    pub(crate) left_out: &'a [[usize; 2]],
}

/// Numbers of one instant for all joints' columns, joint after joint: what enters by its difference, and what is integrated.
#[derive(Clone)]
struct Instant {
    boundary: Vec<f64>,
    rate: Vec<f64>,
}

/// What is the same at all instants, and room for what is not.
struct Workspace {
    /// Inertial parameters per unit of each of a load's columns, body by body.
    loads: Vec<[[f64; INERTIAL]; LOAD_COLUMNS]>,
    /// W_m and W_g − W_c, row-major.
    momentum: Vec<f64>,
    rate: Vec<f64>,
    /// Whether a column needs them.
    with_slopes: bool,
    slopes: Slopes,
}

impl Limb<'_> {
    /// Where each joint's row starts among all joints' numbers, and where the last one ends.
    pub(super) fn starts(&self) -> Vec<usize> {
        let mut starts = vec![0];
        for columns in &self.columns.of_joint {
            starts.push(starts[starts.len() - 1] + columns.len() + 1);
        }
        starts
    }

    fn workspace(&self) -> Workspace {
        let n = self.columns.joints();
        let needs = |c: &Column| matches!(c, Column::Motion { .. } | Column::Gravity(_));
        Workspace {
            loads: (self.loads.iter())
                .map(|com| std::array::from_fn(|n| load(com, n)))
                .collect(),
            momentum: vec![0.0; INERTIAL * n * n],
            rate: vec![0.0; INERTIAL * n * n],
            with_slopes: self.columns.of_joint.iter().flatten().any(needs),
            slopes: Slopes::of(n),
        }
    }

    /// Calls `visit` for each window that lies in a block.
    pub(crate) fn for_each_window(&self, mut visit: impl FnMut(&Window)) {
        let n = self.columns.joints();
        let (starts, mut workspace) = (self.starts(), self.workspace());
        let zero = vec![0.0; starts[n]];
        let mut now = Instant {
            boundary: zero.clone(),
            rate: zero.clone(),
        };
        let mut before = now.clone();
        let (mut start, mut sum, mut rows) = (zero.clone(), zero.clone(), zero);
        let (mut rest, mut moves) = (vec![0.0; n], vec![false; n]);
        let begin = self.recording.time_us.first().copied().unwrap_or(0);
        let since = |k: usize| self.recording.time_us[k] - begin;
        for stretch in self.recording.stretches() {
            let mut first = stretch.start;
            for k in stretch.clone() {
                let edge = k == first || since(k) - since(first) >= WINDOW_US;
                self.measure(k, edge, &starts, &mut workspace, &mut now);
                if k > first {
                    let half = 0.5e-6 * (since(k) - since(k - 1)) as f64;
                    let rates = before.rate.iter().zip(&now.rate);
                    for (sum, (a, b)) in sum.iter_mut().zip(rates) {
                        *sum += half * (a + b);
                    }
                    for (j, rest) in rest.iter_mut().enumerate() {
                        if self.motion.states[k * n + j].speed.abs() < REST {
                            *rest += 2.0 * half;
                        }
                    }
                }
                if edge {
                    let block = self.blocks.of_window(since(first), since(k));
                    let block = block.filter(|_| k > first && !self.is_left_out(first, k));
                    if let Some(block) = block {
                        let length = 1e-6 * (since(k) - since(first)) as f64;
                        let ends = now.boundary.iter().zip(&start);
                        for (row, ((end, start), sum)) in rows.iter_mut().zip(ends.zip(&sum)) {
                            *row = (end - start + sum) / length;
                        }
                        for j in 0..n {
                            moves[j] = rest[j] < MOST_REST * length;
                            self.scale(j, &mut rows[starts[j]..starts[j + 1]]);
                        }
                        visit(&Window {
                            t: 0.5e-6 * (since(first) + since(k)) as f64,
                            block,
                            rows: &rows,
                            starts: &starts,
                            moves: &moves,
                            samples: [first, k],
                        });
                    }
                    first = k;
                    std::mem::swap(&mut start, &mut now.boundary);
                    sum.fill(0.0);
                    rest.fill(0.0);
                }
                std::mem::swap(&mut before, &mut now);
            }
        }
    }

    /// Whether a window from sample `first` to `last` overlaps a stretch that is left out.
    fn is_left_out(&self, first: usize, last: usize) -> bool {
        let next = self.left_out.partition_point(|range| range[1] <= first);
        self.left_out.get(next).is_some_and(|range| range[0] < last)
    }

    /// Puts a joint's row, made of true torques, to the scale of the reported one.
    fn scale(&self, joint: usize, row: &mut [f64]) {
        let columns = self.columns.of_joint[joint].len();
        let scale = self.torque_scale[joint];
        row[..columns].iter_mut().for_each(|x| *x *= scale);
        self.write_scale(joint, row);
    }

    /// Writes the column of a joint's torque scale: all that the model so far makes of the other columns.
    pub(super) fn write_scale(&self, joint: usize, row: &mut [f64]) {
        let columns = &self.columns.of_joint[joint];
        let row = &mut row[..columns.len()];
        if let Some(c) = columns.iter().position(|c| *c == Column::Scale(joint)) {
            row[c] = 0.0;
            row[c] = dot(&self.model[joint], row) / self.torque_scale[joint];
        }
    }

    /// All columns of sample k but those of the scale; those that enter by their difference only at a window's edge.
    fn measure(
        &self,
        k: usize,
        edge: bool,
        starts: &[usize],
        workspace: &mut Workspace,
        out: &mut Instant,
    ) {
        let n = self.columns.joints();
        let at = k * n..(k + 1) * n;
        let Workspace {
            momentum,
            rate,
            slopes,
            ..
        } = workspace;
        self.body.regressors(
            &self.base,
            &self.motion.q[at.clone()],
            &self.motion.dq[at.clone()],
            edge.then_some(&mut momentum[..]),
            rate,
            workspace.with_slopes.then_some(slopes),
        );
        let states = &self.motion.states[at];
        for j in 0..n {
            let row = starts[j]..starts[j + 1];
            let (boundaries, rates) = (&mut out.boundary[row.clone()], &mut out.rate[row]);
            self.measure_joint(j, states, workspace, boundaries, rates);
            let last = rates.len() - 1;
            (boundaries[last], rates[last]) = (0.0, states[j].tau);
        }
    }

    /// The columns of joint j.
    fn measure_joint(
        &self,
        j: usize,
        states: &[JointState<f64>],
        workspace: &Workspace,
        boundaries: &mut [f64],
        rates: &mut [f64],
    ) {
        let width = INERTIAL * self.columns.joints();
        let (momentum, rate) = (
            &workspace.momentum[j * width..],
            &workspace.rate[j * width..],
        );
        let slopes = &workspace.slopes;
        // An effect's columns stand side by side and come from one evaluation.
        let mut known: Option<(EffectKind, f64, [Term<f64>; MAX_COLUMNS])> = None;
        for (c, column) in self.columns.of_joint[j].iter().enumerate() {
            (boundaries[c], rates[c]) = match *column {
                Column::Inertial(b, parameter) => {
                    let at = b * INERTIAL + parameter;
                    (momentum[at], rate[at])
                }
                Column::Load { body, n } => {
                    let (load, at) = (&workspace.loads[body][n], body * INERTIAL);
                    (dot(load, &momentum[at..]), dot(load, &rate[at..]))
                }
                Column::Own {
                    joint,
                    effect,
                    shape,
                    n,
                } => {
                    let terms = match known {
                        Some((same, with, terms)) if (same, with) == (effect, shape) => terms,
                        _ => effect.terms(&states[joint], shape),
                    };
                    known = Some((effect, shape, terms));
                    (terms[n].boundary, terms[n].rate)
                }
                Column::Motion { joint, effect } => {
                    slopes.along(joint, effect.motion(&states[joint]), j)
                }
                Column::Gravity(axis) => (0.0, slopes.by_base(axis, j)),
                // Made of the others when the window closes.
                Column::Scale(_) => (0.0, 0.0),
            };
        }
    }
}

/// The inertial parameters of a point mass of 1 kg at `com` (n = 0), or how they change with its first moment (1 kg m) along
/// x, y or z (n = 1 to 3), or the same
/// inertia about all axes (n = 4).
fn load(com: &Vector3<f64>, n: usize) -> [f64; INERTIAL] {
    if n == 4 {
        return [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    }
    let (mass, away) = match n {
        0 => (1.0, *com),
        n => (0.0, Vector3::ith(n - 1, 1.0)),
    };
    // The inertia |c|² 1 − c cᵀ, or its derivative along `away`.
    let share = if n == 0 { 0.5 } else { 1.0 };
    let spread = com * away.transpose() + away * com.transpose();
    let inertia = (nalgebra::Matrix3::identity() * spread.trace() - spread) * share;
    let i = |r: usize, c: usize| inertia[(r, c)];
    [
        mass,
        away.x,
        away.y,
        away.z,
        i(0, 0),
        i(0, 1),
        i(0, 2),
        i(1, 1),
        i(1, 2),
        i(2, 2),
    ]
}

/// A base turned about its own axes by a small rotation vector, rad.
pub(crate) fn turned(base: &Transform<f64>, by: &Vector3<f64>) -> Transform<f64> {
    Transform {
        rotation: base.rotation * Rotation3::new(*by).matrix(),
        translation: base.translation,
    }
}
