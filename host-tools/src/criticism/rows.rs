//! From a limb's motion to integrated rows: the momentum equation over windows, with every column of [`Columns`].
//!
//! A window's row for joint j is ([`proprio_core::window`])
//!
//! ```text
//! [W_m] − ∫ W_c dt + ∫ W_g dt  |  own effects: [boundary] + ∫ rate dt  |  d/dε of the rigid body's part   =   ∫ τ dt
//! ```
//!
//! all divided by the window's length. What changes the motion (velocity_gain, encoder_offset, elasticity, backlash) or
//! gravity (base_tilt) is no torque of its own; its column is the derivative of the rigid body's part, here by central
//! differences at the inertias that the limb has been given.

use nalgebra::{Rotation3, Vector3};
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::Transform;

use super::column::{Column, Columns};
use super::motion::Motion;
use super::recording::LimbRecording;
use super::rigid_body::RigidBody;

/// Length of a window, µs.
pub(crate) const WINDOW_US: u64 = 20_000;
/// Windows this soon after a block's start belong to none, µs: residuals remember that long.
const GUARD_US: u64 = 40_000;
/// Slower than this a joint may be held by friction, whose torque is then anything up to its limit, rad/s.
const REST: f64 = 0.02;
/// Share of a window in which a joint may be so slow and the window still say something of its friction: one sample of a
/// Go2, which a reversal takes that friction does not hold up. A joint that is held, at each reversal for some
/// milliseconds, has a friction that runs from one limit to the other meanwhile, and no column that says so.
const MOST_REST: f64 = 0.125;
/// Step of central differences, rad and rad/s.
const STEP: f64 = 1e-4;

/// How time is cut into blocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Blocks {
    /// How many.
    pub(crate) count: usize,
    /// Length of one, µs.
    pub(crate) length_us: u64,
}

impl Blocks {
    /// Most blocks.
    const MOST: usize = 32;
    /// Shortest block, µs.
    const SHORTEST_US: u64 = 500_000;

    /// Cuts `duration_us` into blocks.
    pub(crate) fn of(duration_us: u64) -> Self {
        let count = (duration_us / Self::SHORTEST_US).clamp(1, Self::MOST as u64);
        Self {
            count: count as usize,
            length_us: duration_us / count + 1,
        }
    }

    /// The block of a window, if it has one; `start_us` and `end_us` since the recording's start.
    fn of_window(&self, start_us: u64, end_us: u64) -> Option<usize> {
        let block = start_us / self.length_us;
        let inside = start_us % self.length_us >= GUARD_US || block == 0;
        (inside && end_us / self.length_us == block && (block as usize) < self.count)
            .then_some(block as usize)
    }
}

/// One closed window of a limb.
pub(crate) struct Window<'a> {
    /// Its middle, s since the recording's start.
    pub(crate) t: f64,
    /// Its block, if it belongs to one.
    pub(crate) block: Option<usize>,
    /// Each joint's row: its columns, then the mean torque, N m.
    pub(crate) rows: &'a [Vec<f64>],
    /// Whether each joint moves all the while: rows of one at rest, be it for a part, say nothing of friction.
    pub(crate) moves: &'a [bool],
    /// First and last sample.
    pub(crate) samples: [usize; 2],
}

/// A limb as rows are made of it.
pub(crate) struct Limb<'a> {
    pub(crate) recording: &'a LimbRecording,
    pub(crate) motion: &'a Motion,
    pub(crate) body: &'a dyn RigidBody,
    /// Placement of the base in the world.
    pub(crate) base: Transform<f64>,
    pub(crate) columns: &'a Columns,
    pub(crate) blocks: Blocks,
    /// Where loads are, m in the joint frames.
    pub(crate) loads: &'a [Vector3<f64>],
    /// Of each joint, what its columns are times in the model so far: its torque.
    pub(crate) model: Vec<Vec<f64>>,
    /// Reported over true torque of each joint.
    pub(crate) torque_scale: &'a [f64],
    /// Ranges of samples \[first, last\] whose windows belong to no block.
    pub(crate) left_out: &'a [[usize; 2]],
}

/// Numbers of one instant for all columns: of each joint what enters by its difference, and what is integrated.
#[derive(Clone)]
struct Instant {
    boundary: Vec<Vec<f64>>,
    rate: Vec<Vec<f64>>,
}

/// Derivatives of the rigid body's momentum and rate by each joint's position and velocity.
struct Slopes {
    /// \[position, velocity\] \[joint that moves\] → (momentum, rate) of all joints.
    by: [Vec<(Vec<f64>, Vec<f64>)>; 2],
}

impl Limb<'_> {
    /// Calls `visit` for each window.
    pub(crate) fn for_each_window(&self, mut visit: impl FnMut(&Window)) {
        let n = self.columns.joints();
        let zero: Vec<Vec<f64>> = self
            .columns
            .of_joint
            .iter()
            .map(|c| vec![0.0; c.len() + 1])
            .collect();
        let mut now = Instant {
            boundary: zero.clone(),
            rate: zero.clone(),
        };
        let mut before = now.clone();
        let (mut start, mut sum, mut rows) = (zero.clone(), zero.clone(), zero);
        let (mut rest, mut moves) = (vec![0.0; n], vec![false; n]);
        let begin = self.recording.time_us.first().copied().unwrap_or(0);
        for stretch in self.recording.stretches() {
            let mut first = stretch.start;
            for k in stretch.clone() {
                let since = |k: usize| self.recording.time_us[k] - begin;
                let edge = k == first || since(k) - since(first) >= WINDOW_US;
                self.measure(k, edge, &mut now);
                if k > first {
                    let half = 0.5e-6 * (since(k) - since(k - 1)) as f64;
                    for (sum, (a, b)) in sum.iter_mut().zip(before.rate.iter().zip(&now.rate)) {
                        for (sum, (a, b)) in sum.iter_mut().zip(a.iter().zip(b)) {
                            *sum += half * (a + b);
                        }
                    }
                    for (j, rest) in rest.iter_mut().enumerate() {
                        if self.motion.states[k * n + j].speed.abs() < REST {
                            *rest += 2.0 * half;
                        }
                    }
                }
                if edge {
                    if k > first {
                        let length = 1e-6 * (since(k) - since(first)) as f64;
                        for j in 0..n {
                            let ends = now.boundary[j].iter().zip(&start[j]);
                            for (row, ((end, start), sum)) in
                                rows[j].iter_mut().zip(ends.zip(&sum[j]))
                            {
                                *row = (end - start + sum) / length;
                            }
                            moves[j] = rest[j] < MOST_REST * length;
                        }
                        visit(&Window {
                            t: 0.5e-6 * (since(first) + since(k)) as f64,
                            block: self
                                .blocks
                                .of_window(since(first), since(k))
                                .filter(|_| !self.is_left_out(first, k)),
                            rows: &rows,
                            moves: &moves,
                            samples: [first, k],
                        });
                    }
                    first = k;
                    std::mem::swap(&mut start, &mut now.boundary);
                    sum.iter_mut().for_each(|sum| sum.fill(0.0));
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

    /// All columns at sample k; those that enter by their difference only at a window's edge.
    fn measure(&self, k: usize, edge: bool, out: &mut Instant) {
        let n = self.columns.joints();
        let at = k * n..(k + 1) * n;
        let (states, q, dq) = (
            &self.motion.states[at.clone()],
            &self.motion.q[at.clone()],
            &self.motion.dq[at],
        );
        let width = INERTIAL * n;
        let (mut momentum, mut rate) = (vec![0.0; n * width], vec![0.0; n * width]);
        self.body.regressors(
            &self.base,
            q,
            dq,
            edge.then_some(&mut momentum[..]),
            &mut rate,
        );
        let slopes = self
            .has(|c| matches!(c, Column::Motion { .. }))
            .then(|| self.slopes(q, dq));
        let tilts = self
            .has(|c| matches!(c, Column::Gravity(_)))
            .then(|| self.tilts(q, dq));
        for j in 0..n {
            let (boundaries, rates) = (&mut out.boundary[j], &mut out.rate[j]);
            for (c, column) in self.columns.of_joint[j].iter().enumerate() {
                let (boundary, rate) = match *column {
                    Column::Inertial(b, parameter) => {
                        let at = j * width + b * INERTIAL + parameter;
                        (momentum[at], rate[at])
                    }
                    Column::Load { body, n } => {
                        let at = j * width + body * INERTIAL;
                        let load = load(&self.loads[body], n);
                        (dot(&load, &momentum[at..]), dot(&load, &rate[at..]))
                    }
                    Column::Own {
                        joint,
                        effect,
                        shape,
                        n,
                    } => {
                        let term = effect.terms(&states[joint], shape)[n];
                        (term.boundary, term.rate)
                    }
                    Column::Motion { joint, effect } => match &slopes {
                        Some(slopes) => slopes.along(joint, effect.motion(&states[joint]), j),
                        None => (0.0, 0.0),
                    },
                    Column::Gravity(axis) => {
                        (0.0, tilts.as_ref().map_or(0.0, |tilts| tilts[axis][j]))
                    }
                    // Made of the others below.
                    Column::Scale(_) => (0.0, 0.0),
                };
                (boundaries[c], rates[c]) = (boundary, rate);
            }
            let torque = [dot(&self.model[j], boundaries), dot(&self.model[j], rates)];
            for numbers in [&mut *boundaries, &mut *rates] {
                numbers.iter_mut().for_each(|x| *x *= self.torque_scale[j]);
            }
            let own = |c: &Column| *c == Column::Scale(j);
            if let Some(c) = self.columns.of_joint[j].iter().position(own) {
                [boundaries[c], rates[c]] = torque;
            }
            let last = rates.len() - 1;
            (boundaries[last], rates[last]) = (0.0, states[j].tau);
        }
    }

    fn has(&self, kind: impl Fn(&Column) -> bool) -> bool {
        self.columns.of_joint.iter().flatten().any(kind)
    }

    fn slopes(&self, q: &[f64], dq: &[f64]) -> Slopes {
        let n = q.len();
        let difference = |ahead: &[f64], behind: &[f64]| -> Vec<f64> {
            ahead
                .iter()
                .zip(behind)
                .map(|(a, b)| (a - b) / (2.0 * STEP))
                .collect()
        };
        let at = |q: &[f64], dq: &[f64]| {
            let (mut p, mut r) = (vec![0.0; n], vec![0.0; n]);
            self.body
                .momentum_and_rate(&self.base, q, dq, &mut p, &mut r);
            (p, r)
        };
        let moved = |x: &[f64], joint: usize, by: f64| -> Vec<f64> {
            x.iter()
                .enumerate()
                .map(|(j, x)| if j == joint { x + by } else { *x })
                .collect()
        };
        let by_q = (0..n).map(|joint| {
            let (ahead, behind) = (
                at(&moved(q, joint, STEP), dq),
                at(&moved(q, joint, -STEP), dq),
            );
            (
                difference(&ahead.0, &behind.0),
                difference(&ahead.1, &behind.1),
            )
        });
        let by_dq = (0..n).map(|joint| {
            let (ahead, behind) = (
                at(q, &moved(dq, joint, STEP)),
                at(q, &moved(dq, joint, -STEP)),
            );
            (
                difference(&ahead.0, &behind.0),
                difference(&ahead.1, &behind.1),
            )
        });
        Slopes {
            by: [by_q.collect(), by_dq.collect()],
        }
    }

    /// Derivative of the rate of all joints by turning the base about its x and its y axis.
    fn tilts(&self, q: &[f64], dq: &[f64]) -> [Vec<f64>; 2] {
        [Vector3::x(), Vector3::y()].map(|axis| {
            let at = |by: f64| {
                let (mut p, mut r) = (vec![0.0; q.len()], vec![0.0; q.len()]);
                self.body.momentum_and_rate(
                    &turned(&self.base, &(axis * by)),
                    q,
                    dq,
                    &mut p,
                    &mut r,
                );
                r
            };
            at(STEP)
                .iter()
                .zip(at(-STEP))
                .map(|(a, b)| (a - b) / (2.0 * STEP))
                .collect()
        })
    }
}

impl Slopes {
    /// Derivative of joint j's momentum and rate as joint `joint`'s link moves by \[position, velocity\].
    fn along(&self, joint: usize, motion: [f64; 2], j: usize) -> (f64, f64) {
        let parts = self.by.iter().zip(motion);
        parts.fold((0.0, 0.0), |(p, r), (by, x)| {
            (p + x * by[joint].0[j], r + x * by[joint].1[j])
        })
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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A base turned about its own axes by a small rotation vector, rad.
pub(crate) fn turned(base: &Transform<f64>, by: &Vector3<f64>) -> Transform<f64> {
    Transform {
        rotation: base.rotation * Rotation3::new(*by).matrix(),
        translation: base.translation,
    }
}
