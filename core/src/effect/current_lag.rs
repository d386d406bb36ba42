//! A drive whose torque follows what it reports with a lag of first order: τ_reported = τ + T τ̇, so that the column is Δτ.
//!
//! A current loop of bandwidth f has T = 1/(2π f). What is reported here is what the controller asked for; a torque that is itself measured and late is [`delay`](super::delay)'s. To first order in T the two are one, with the
//! sign turned; in second order a delay has T²/2 τ̈ more.

use super::{Description, Effect, Input, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct CurrentLag;

impl Effect for CurrentLag {
    const DESCRIPTION: Description = Description {
        name: "current_lag",
        torque: "reported torque = true + T d(true)/dt",
        input: Input::MotorTorque,
        parameters: &[Parameter::new("T", "s", 0.0, 0.05)],
        words: "the motor's torque follows the reported one with a lag of first order: the drive's current loop",
        look_alikes: &["delay", "viscous", "elasticity", "armature"],
        separated_by: "torque that changes fast and slowly: sharp reversals beside slow sweeps",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.004,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::boundary(state.tau), Term::zero()]
    }
}
