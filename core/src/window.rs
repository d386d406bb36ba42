//! Samples in, integrated rows out: the momentum equation over short windows of time.
//!
//! Between the first and the last sample of a window (20 ms by default), with W_m, W_c and W_g of [`crate::regressor`],
//!
//! ```text
//! [W_m] − ∫ W_c dt + ∫ W_g dt | effect columns     =     ∫ τ dt
//! ```
//!
//! Everything is divided by the window's length, so that rows and residuals are mean torques in N m. Integrals are sums
//! of trapezia, which take samples at any spacing. What real buses and hosts do to samples is handled here, in one place:
//!
//! - a *repeated* sample (the host read the latest message twice) is skipped: its time stamp is not when it was measured
//!   (not on a bus, [`Settings::skip_repeated`]);
//! - a *late* one (time does not increase) is skipped;
//! - an *implausible* one (not finite, beyond any value the robot can have) is skipped;
//! - a *gap* longer than [`Settings::max_gap_us`] ends the window without a row; the next one starts after the gap.
//!
//! [`FreeBaseWindow`] does the same for a robot that walks, from gyro and accelerometer.
//!
//! # Example
//!
//! A rod that swings, sampled at 500 Hz; its motor also turns against viscous friction of 0.3 N m s/rad:
//!
//! ```
//! use nalgebra::{Matrix3, Vector1, Vector3};
//! use proprio_core::effect::EffectKind;
//! use proprio_core::inertia::InertialParameters;
//! use proprio_core::spatial::Transform;
//! use proprio_core::tree::{Body, Joint, Tree, TreeError};
//! use proprio_core::window::{Plausible, Push, Sample, Settings, Window};
//!
//! let about_com = Matrix3::from_diagonal(&Vector3::new(0.0133, 0.0133, 1e-4));
//! let rod: Tree<f64, 1, 1> = Tree::new([Body {
//!     parent: None,
//!     placement: Transform::identity(),
//!     joint: Joint::Revolute(Vector3::y()),
//!     inertia: InertialParameters::from_com(1.0, Vector3::new(0.0, 0.0, -0.2), about_com),
//! }])?;
//! let most = Plausible { position: [-3.0, 3.0], speed: 20.0, torque: 20.0 };
//! // One joint, ten inertial columns, one effect.
//! let mut window: Window<f64, 1, 10, 1> = Window::new(
//!     rod, Transform::identity(), [EffectKind::Viscous], [most], Settings::DEFAULT,
//! );
//! for time_us in (0..=20_000).step_by(2_000) {
//!     let t = time_us as f64 * 1e-6;
//!     let (q, dq, ddq) = (0.5 + (3.0 * t).sin(), 3.0 * (3.0 * t).cos(), -9.0 * (3.0 * t).sin());
//!     let at = rod.kinematics(&Transform::identity(), &Vector1::new(q), &Vector1::new(dq));
//!     let body = rod.inverse_dynamics(&at, &Vector1::new(dq), &Vector1::new(ddq))[0];
//!     let sample = Sample { time_us, q: [q], dq: [dq], tau: [body + 0.3 * dq] };
//!     let closed = window.push(&sample) == Push::Closed;
//!     assert_eq!(closed, time_us == 20_000);
//! }
//! // What the window says without any acceleration: its columns times what is true are the mean torque.
//! let rows = window.rows();
//! let theta = rod.parameters::<10>();
//! let model = (rows.inertial * theta)[0] + rows.effects[0][0] * 0.3;
//! assert!((model - rows.torque[0]).abs() < 1e-4);
//! # Ok::<(), TreeError>(())
//! ```

use crate::effect::{EffectKind, JointState, Term};
use crate::inertia::INERTIAL;
use crate::regressor::RegressorRows;
use crate::spatial::Transform;
use crate::tree::{Kinematics, Tree};
use crate::{Real, scalar::real};
use nalgebra::{SMatrix, SVector};
use sequence::{Link, Sequence};

/// One measurement of `B` joints; SI, joint side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample<T, const B: usize> {
    /// When it was measured, µs since any fixed moment.
    pub time_us: u64,
    /// Joint positions, rad.
    pub q: [T; B],
    /// Joint velocities, rad/s.
    pub dq: [T; B],
    /// Motor torques, N m.
    pub tau: [T; B],
}

/// How samples become windows; lengths of time in µs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// A window closes at the first sample this long after its start.
    pub window_us: u64,
    /// Two samples further apart than this are not bridged.
    pub max_gap_us: u64,
    /// A sample that equals the last one is skipped: the host has read the latest message twice. On a bus, where each sample
    /// is measured when it is asked for, it is a sample like any other.
    pub skip_repeated: bool,
}

impl Settings {
    /// 20 ms windows, gaps of up to 10 ms, samples of a host.
    pub const DEFAULT: Self = Self {
        window_us: 20_000,
        max_gap_us: 10_000,
        skip_repeated: true,
    };
}

impl Default for Settings {
    /// [`Self::DEFAULT`].
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// What a joint can do at most; beyond it a reading is a fault of the bus, not of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plausible<T> {
    /// Least and greatest position, rad.
    pub position: [T; 2],
    /// Greatest speed, rad/s.
    pub speed: T,
    /// Greatest torque, N m.
    pub torque: T,
}

/// Why a sample is implausible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Implausible {
    /// A number is NaN or infinite.
    NotFinite,
    /// A joint's position is far outside its limits.
    Position,
    /// A joint's speed is beyond what its motor can do.
    Speed,
    /// A joint's torque is beyond what its motor can do.
    Torque,
}

/// What became of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Push {
    /// It was used.
    Used,
    /// It was used and closed a window: [`Window::rows`] has new rows.
    Closed,
    /// It was used, but the time since the last one is not bridged, or the clock was set back; the open window is lost.
    Gap,
    /// All readings equal the last sample's: skipped.
    Repeated,
    /// Its time is not after the last sample's: skipped.
    Late,
    /// It cannot be true: skipped.
    Rejected(Implausible),
}

/// The rows of one closed window: mean torques over the window, N m per unit of the parameter.
///
/// `P` = 10 `B` inertial columns and `E` effects per joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rows<T: Real, const B: usize, const P: usize, const E: usize> {
    /// Start and end of the window, µs.
    pub span_us: [u64; 2],
    /// The inertial columns, one row per joint.
    pub inertial: SMatrix<T, B, P>,
    /// Each joint's own effect columns.
    pub effects: [[T; E]; B],
    /// The right-hand side: mean torque, N m.
    pub torque: [T; B],
}

/// What is integrated over a window, or its integrand at one instant.
#[derive(Clone, Copy, Debug)]
struct Integrand<T: Real, const B: usize, const E: usize> {
    inertial: RegressorRows<T, B, B>,
    effects: [[T; E]; B],
    torque: [T; B],
}

impl<T: Real, const B: usize, const E: usize> Integrand<T, B, E> {
    fn zero() -> Self {
        Self {
            inertial: [[[T::zero(); INERTIAL]; B]; B],
            effects: [[T::zero(); E]; B],
            torque: [T::zero(); B],
        }
    }

    fn clear(&mut self) {
        *self = Self::zero();
    }

    /// Adds `other` times `duration`; the inertial columns of the bodies that each joint of `tree` moves.
    fn add(&mut self, tree: &Tree<T, B, B>, other: &Self, duration: T) {
        for (c, (sums, rates)) in self.inertial.iter_mut().zip(&other.inertial).enumerate() {
            let moved = tree.subtree(c);
            let sums = sums.get_mut(moved.clone()).unwrap_or(&mut []);
            let rates = rates.get(moved).unwrap_or(&[]);
            for (sum, rate) in sums.as_flattened_mut().iter_mut().zip(rates.as_flattened()) {
                *sum += *rate * duration;
            }
        }
        for b in 0..B {
            self.torque[b] += other.torque[b] * duration;
            for e in 0..E {
                self.effects[b][e] += other.effects[b][e] * duration;
            }
        }
    }
}

/// The quantities that enter as differences between a window's ends.
#[derive(Clone, Copy, Debug)]
struct Edge<T: Real, const B: usize, const E: usize> {
    time_us: u64,
    momentum: RegressorRows<T, B, B>,
    effects: [[T; E]; B],
}

impl<T: Real, const B: usize, const E: usize> Edge<T, B, E> {
    fn zero() -> Self {
        Self {
            time_us: 0,
            momentum: [[[T::zero(); INERTIAL]; B]; B],
            effects: [[T::zero(); E]; B],
        }
    }
}

/// The effects whose columns a window makes, one column each: an array of kinds, or a type that stands for a fixed list.
pub trait EffectList<const E: usize> {
    /// Each effect's first column's term at one instant.
    fn terms<T: Real>(&self, state: &JointState<T>) -> [Term<T>; E];
}

impl<const E: usize> EffectList<E> for [EffectKind; E] {
    fn terms<T: Real>(&self, state: &JointState<T>) -> [Term<T>; E] {
        self.map(|effect| effect.term(state))
    }
}

/// The window being filled, for `B` joints on a fixed base, `P` = 10 `B` inertial columns and `E` effects per joint.
///
/// Everything is computed in place: on a microcontroller, moving these matrices costs as much as filling them.
#[derive(Clone, Debug)]
pub struct Window<T: Real, const B: usize, const P: usize, const E: usize, L = [EffectKind; E]> {
    tree: Tree<T, B, B>,
    base: Transform<T>,
    effects: L,
    sequence: Sequence<T, B>,
    kinematics: Kinematics<T, B, B>,
    /// The integrand at the last sample, and half the time between it and the one before in this window (s): what of its
    /// trapezia lies before it.
    integrand: Integrand<T, B, E>,
    half_step: T,
    integral: Integrand<T, B, E>,
    /// The edges of the window, and whether its end is the first of them: the end of one window is the next one's start.
    edges: [Edge<T, B, E>; 2],
    ends_first: bool,
    rows: Rows<T, B, P, E>,
}

impl<T: Real, const B: usize, const P: usize, const E: usize, L: EffectList<E>>
    Window<T, B, P, E, L>
{
    /// An empty window for `tree`, whose base is mounted at `base` in the world (only its rotation matters).
    pub fn new(
        tree: Tree<T, B, B>,
        base: Transform<T>,
        effects: L,
        plausible: [Plausible<T>; B],
        settings: Settings,
    ) -> Self {
        Self {
            tree,
            base,
            effects,
            sequence: Sequence::new(plausible, settings),
            kinematics: Kinematics::new(),
            integrand: Integrand::zero(),
            half_step: T::zero(),
            integral: Integrand::zero(),
            edges: [Edge::zero(); 2],
            ends_first: true,
            rows: Rows {
                span_us: [0; 2],
                inertial: SMatrix::zeros(),
                effects: [[T::zero(); E]; B],
                torque: [T::zero(); B],
            },
        }
    }

    /// Forgets the open window and the last sample.
    pub fn clear(&mut self) {
        self.sequence.clear();
    }

    /// The rows of the window closed last; of use after [`Push::Closed`].
    pub fn rows(&self) -> &Rows<T, B, P, E> {
        &self.rows
    }

    /// Takes the next sample.
    ///
    /// One whose time is not after the last one's was overtaken on its way, and is skipped. Where the next one's is neither,
    /// but after that of the one skipped, time goes on from there: the clock was set back, by as much as nobody knows, and
    /// what was measured before is not bridged.
    pub fn push(&mut self, sample: &Sample<T, B>) -> Push {
        let link = match self.sequence.admit(sample) {
            Ok(link) => link,
            Err(skipped) => return skipped,
        };
        if let Link::Bridged { half_step, .. } = link {
            self.integral
                .add(&self.tree, &self.integrand, self.half_step + half_step);
            self.half_step = half_step;
        }
        self.measure(sample);
        let push = match link {
            Link::Bridged { closes: false, .. } => return Push::Used,
            Link::Bridged { closes: true, .. } => {
                self.set_end(sample);
                self.close();
                Push::Closed
            }
            Link::Broken(push) => {
                self.set_end(sample);
                push
            }
        };
        self.ends_first = !self.ends_first;
        self.integral.clear();
        self.half_step = T::zero();
        push
    }

    /// The kinematics and the integrand at a sample.
    fn measure(&mut self, sample: &Sample<T, B>) {
        let (q, dq) = (SVector::from(sample.q), SVector::from(sample.dq));
        self.tree
            .update_kinematics(&mut self.kinematics, &self.base, &q, &dq);
        let inertial = &mut self.integrand.inertial;
        self.tree
            .write_momentum_rate_regressor(&self.kinematics, inertial);
        self.integrand.torque = sample.tau;
        for b in 0..B {
            let terms = self.effects.terms(&joint_state(sample, b));
            self.integrand.effects[b] = terms.map(|term| term.rate);
        }
    }

    /// Makes the sample that was just measured the window's end.
    fn set_end(&mut self, sample: &Sample<T, B>) {
        let [first, second] = &mut self.edges;
        let end = if self.ends_first { first } else { second };
        end.time_us = sample.time_us;
        self.tree
            .write_momentum_regressor(&self.kinematics, &mut end.momentum);
        for b in 0..B {
            let terms = self.effects.terms(&joint_state(sample, b));
            end.effects[b] = terms.map(|term| term.boundary);
        }
    }

    fn close(&mut self) {
        self.integral
            .add(&self.tree, &self.integrand, self.half_step);
        let (start, end) = match (self.ends_first, &self.edges) {
            (true, [end, start]) | (false, [start, end]) => (start, end),
        };
        let (sum, rows) = (&self.integral, &mut self.rows);
        let per_second = T::one() / microseconds(end.time_us - start.time_us);
        rows.span_us = [start.time_us, end.time_us];
        for c in 0..B {
            for b in self.tree.subtree(c) {
                let runs = end.momentum[c][b].iter().zip(&start.momentum[c][b]);
                for (n, ((end, start), sum)) in runs.zip(&sum.inertial[c][b]).enumerate() {
                    if let Some(to) = rows.inertial.get_mut((c, INERTIAL * b + n)) {
                        *to = (*end - *start + *sum) * per_second;
                    }
                }
            }
        }
        for b in 0..B {
            rows.torque[b] = sum.torque[b] * per_second;
            for e in 0..E {
                let difference = end.effects[b][e] - start.effects[b][e];
                rows.effects[b][e] = (difference + sum.effects[b][e]) * per_second;
            }
        }
    }
}

impl<T: Real, const B: usize, const P: usize, const E: usize> Rows<T, B, P, E> {
    /// Joint b's row over `bodies`, as a factor takes it: effects, inertial columns, torque. `row` holds
    /// E + 10 × bodies + 1 numbers.
    pub fn write_row(&self, b: usize, bodies: core::ops::Range<usize>, row: &mut [T]) {
        let inertial =
            (INERTIAL * bodies.start..INERTIAL * bodies.end).map(|c| self.inertial[(b, c)]);
        let entries = self.effects[b]
            .iter()
            .copied()
            .chain(inertial)
            .chain([self.torque[b]]);
        row.iter_mut()
            .zip(entries)
            .for_each(|(to, from)| *to = from);
    }
}

/// What an effect sees of joint b.
pub(crate) fn joint_state<T: Real, const B: usize>(
    sample: &Sample<T, B>,
    b: usize,
) -> JointState<T> {
    JointState::reported(sample.q[b], sample.dq[b], sample.tau[b])
}

/// Whole microseconds as seconds; an hour and more as 72 minutes. From 32 bits, which a microcontroller's FPU converts itself.
pub(crate) fn microseconds<T: Real>(time: u64) -> T {
    real(f64::from(time.min(u32::MAX.into()) as u32) * 1e-6)
}

pub(crate) mod free_base;
pub(crate) mod sequence;

pub use free_base::{FreeBasePush, FreeBaseRows, FreeBaseSample, FreeBaseSetup, FreeBaseWindow};

#[cfg(test)]
pub(crate) mod tests;
