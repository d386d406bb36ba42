//! A limb's parameters from its windows: one factor per joint, a prior, and a solution in bounded steps.
//!
//! A joint's torque depends on the bodies it moves and on its own effects, so each joint has a factor of just those
//! columns ([`JointFactors`]): 34 for a hip, 24 for the thigh, 14 for the calf, instead of three rows of 42. Each
//! joint's noise then follows from its own ρ, and weighted least squares needs no second pass over the data: the
//! triangles are stacked, each divided by its joint's noise, onto the prior's ([`Solver`]). [`Layout`] says which column is
//! what. All of it is generic over the limb's size and where its numbers are stored; the names that start with `Leg` are
//! a leg of hip, thigh and calf in arrays, whichever [`Robot`] it belongs to.
//!
//! # Example
//!
//! A rod of 1 kg that swings about y for ten seconds. Its motor rubs with 0.2 N m s/rad and has a rotor's inertia of 0.003 kg m²; the CAD knows
//! neither:
//!
//! ```
//! use nalgebra::{Matrix3, Vector1, Vector3};
//! use proprio_core::effect::EffectKind::{Armature, Viscous};
//! use proprio_core::estimator::{EffectPrior, JointFactors, Layout, LimbPrior, Solver, solver_len};
//! use proprio_core::inertia::InertialParameters;
//! use proprio_core::robot::Actuator;
//! use proprio_core::spatial::Transform;
//! use proprio_core::tree::{Body, Joint, Tree};
//! use proprio_core::window::{Plausible, Push, Sample, Settings, Window};
//!
//! let about_com = Matrix3::from_diagonal(&Vector3::new(0.0133, 0.0133, 1e-4));
//! let rod = Body {
//!     parent: None,
//!     placement: Transform::identity(),
//!     joint: Joint::Revolute(Vector3::y()),
//!     inertia: InertialParameters::from_com(1.0, Vector3::new(0.0, 0.0, -0.2), about_com),
//! };
//! let tree: Tree<f64, 1, 1> = Tree::new([rod])?;
//! let motor = Actuator { gear: 6.0, rotor_inertia: 1e-4, effort: 20.0, velocity: 30.0 };
//!
//! // One body, two effect columns at its joint.
//! const LIMB: Layout<1> = Layout::chain(2);
//! let most = Plausible { position: [-3.0, 3.0], speed: 20.0, torque: 20.0 };
//! let effects = [Viscous, Armature];
//! let mut window = Window::<f64, 1, 10, 2>::new(
//!     tree, Transform::identity(), effects, [most], Settings::DEFAULT,
//! );
//! let mut data = JointFactors::new(LIMB, [0.0; LIMB.packed_len()]);
//! for n in 0..5_000 {
//!     let t = f64::from(n) * 2e-3;
//!     let q = 0.3 * (2.0 * t).sin() + 0.4 * (7.0 * t).sin();
//!     let dq = 0.6 * (2.0 * t).cos() + 2.8 * (7.0 * t).cos();
//!     let ddq = -1.2 * (2.0 * t).sin() - 19.6 * (7.0 * t).sin();
//!     let at = tree.kinematics(&Transform::identity(), &Vector1::new(q), &Vector1::new(dq));
//!     let body = tree.inverse_dynamics(&at, &Vector1::new(dq), &Vector1::new(ddq))[0];
//!     let tau = body + 0.2 * dq + 0.003 * ddq;
//!     let sample = Sample { time_us: 2_000 * n as u64, q: [q], dq: [dq], tau: [tau] };
//!     if window.push(&sample) == Push::Closed {
//!         let mut row = [0.0; LIMB.columns(0) + 1];
//!         window.rows().write_row(0, LIMB.subtree(0), &mut row);
//!         data.fold(0, &mut row)?;
//!     }
//! }
//!
//! // The CAD's body to a tenth, the effects as the catalogue has them.
//! let prior = LimbPrior::new([rod.inertia], [0.1], effects.map(|e| EffectPrior::of(e, &motor)));
//! let mut solver = Solver::new(data, [0.0; solver_len(LIMB.parameters())]);
//! solver.restart(&prior);
//! // In steps of bounded cost; a microcontroller takes one at a time.
//! while !solver.advance()? {}
//! let (values, std) = (solver.values(), solver.std());
//! for (n, truth) in [0.2, 0.003].into_iter().enumerate() {
//!     let place = LIMB.effect_index(0, n);
//!     assert!((values[place] - truth).abs() < 2.0 * std[place]);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod device;
mod joints;
mod layout;
mod prior;
mod solver;

pub use device::{
    Active, Beliefs, BlockTest, COLUMNS, Change, ChangeKind, DEFAULT_ACTIVE, DeviceColumns,
    DeviceDescent, DeviceFolds, DevicePrior, DeviceRows, DeviceSolver, DeviceWindow, FOLDS, Gather,
    LONGEST_TRIANGLE, LegBase, Verdict,
};
#[cfg(feature = "app")]
pub(crate) use device::{BASE_RANK, DEVICE_COLUMNS, FRONT, MAX_EFFECTS};
pub(crate) use joints::floor;
pub use joints::{JointFactors, NOISE_GUESS};
pub use layout::Layout;
pub use prior::{EffectPrior, LimbPrior};
pub use solver::{Solver, solver_len};

use crate::effect::EffectKind;
use crate::factor::FactorError;
use crate::inertia::INERTIAL;
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::robot::Robot;
use crate::window::{Plausible, Rows, Window};
use crate::{Real, scalar::real};

/// The effects that are estimated at every joint, in column order.
pub const EFFECTS: [EffectKind; 4] = EffectKind::PLAIN;

/// Inertial parameters of a leg.
pub const LEG_INERTIAL: usize = INERTIAL * JOINTS_PER_LEG;

/// All parameters of a leg.
pub const LEG_PARAMETERS: usize = LEG_INERTIAL + EFFECTS.len() * JOINTS_PER_LEG;

/// Relative standard deviation of the CAD's inertias; see [`crate::inertia::InertialParameters::prior`].
pub const CAD_UNCERTAINTY: f64 = 0.1;

/// The window of a leg.
pub type LegWindow<T> = Window<T, JOINTS_PER_LEG, LEG_INERTIAL, { EFFECTS.len() }>;
/// The rows of a leg's window.
pub type LegRows<T> = Rows<T, JOINTS_PER_LEG, LEG_INERTIAL, { EFFECTS.len() }>;
/// One number per parameter of a leg, in the order of θ.
pub type LegVector<T> = [T; LEG_PARAMETERS];

/// Which column of a leg is what.
pub const LEG: Layout<JOINTS_PER_LEG> = Layout::chain(EFFECTS.len());

/// The factors of a leg's joints.
pub type LegFactors<T> = JointFactors<T, [T; LEG.packed_len()], JOINTS_PER_LEG>;
/// The prior of a leg.
pub type LegPrior<T> = LimbPrior<T, [EffectPrior; EFFECTS.len() * JOINTS_PER_LEG], JOINTS_PER_LEG>;
/// The solver of a leg.
pub type LegSolver<T> =
    Solver<T, [T; LEG.packed_len()], [T; solver_len(LEG_PARAMETERS)], JOINTS_PER_LEG>;

impl<T: Real> Default for LegFactors<T> {
    /// No data.
    fn default() -> Self {
        Self::new(LEG, [T::ZERO; LEG.packed_len()])
    }
}

impl<T: Real> LegFactors<T> {
    /// A constant for statics, to be [`clear`](Self::clear)ed before it is used.
    pub const fn empty() -> Self {
        Self::unset(LEG, [T::ZERO; LEG.packed_len()])
    }

    /// Folds in the rows of one window.
    ///
    /// # Errors
    /// [`FactorError::NotFinite`], and then nothing of the joint that holds such a number is folded in.
    pub fn fold_window(&mut self, rows: &LegRows<T>) -> Result<(), FactorError> {
        let mut buffer = [T::zero(); LEG.columns(0) + 1];
        for joint in 0..JOINTS_PER_LEG {
            let row = buffer.get_mut(..=LEG.columns(joint)).unwrap_or(&mut []);
            rows.write_row(joint, LEG.subtree(joint), row);
            self.fold(joint, row)?;
        }
        Ok(())
    }
}

impl<T: Real, const N: usize, const J: usize> LimbPrior<T, [EffectPrior; N], J> {
    /// The CAD's inertias of a robot's leg within [`CAD_UNCERTAINTY`], each of [`EFFECTS`] as its catalogue entry says; `N` is their number times
    /// that of the joints, checked when compiled.
    pub fn of<R: Robot<J>>(which: R) -> Self {
        const { assert!(N == EFFECTS.len() * J) }
        let cad = which.tree::<T>().bodies().map(|body| body.inertia);
        let effects = core::array::from_fn(|n| {
            EffectPrior::of(EFFECTS[n % EFFECTS.len()], &R::ACTUATORS[n / EFFECTS.len()])
        });
        Self::new(cad, [real(CAD_UNCERTAINTY); J], effects)
    }
}

impl<T: Real> LegSolver<T> {
    /// A solver that has solved nothing yet.
    pub const fn empty() -> Self {
        Self::new(LegFactors::empty(), [T::ZERO; solver_len(LEG_PARAMETERS)])
    }
}

impl<T: Real> Default for LegSolver<T> {
    /// A solver that has solved nothing yet.
    fn default() -> Self {
        Self::empty()
    }
}

/// Limits of a leg's readings with room for offsets: 1 rad beyond the joint's stops, twice the rated speed and torque.
pub fn plausible<T: Real, R: Robot<J>, const J: usize>(which: R) -> [Plausible<T>; J] {
    let limits = which.position_limits();
    core::array::from_fn(|joint| Plausible {
        position: [real(limits[joint][0] - 1.0), real(limits[joint][1] + 1.0)],
        speed: real(2.0 * R::ACTUATORS[joint].velocity),
        torque: real(2.0 * R::ACTUATORS[joint].effort),
    })
}

#[cfg(test)]
pub(crate) mod tests;
