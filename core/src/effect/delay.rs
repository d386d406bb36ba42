//! A torque that is reported late by d: τ_true(t) = τ_reported(t + d), so ∫τ_true dt ≈ ∫τ dt + d Δτ and the column is −Δτ.

use super::{
    Description, Effect, Enters, Form, Input, JointState, MAX_COLUMNS, Parameter, Prior, Reach,
    Term,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Delay;

impl Effect for Delay {
    const DESCRIPTION: Description = Description {
        name: "delay",
        torque: "reported torque is late by d",
        form: Form::Clock,
        enters: Enters::Derivative,
        input: Input::MotorTorque,
        reach: Reach::JointOrRobot,
        parameters: &[Parameter::new("d", "s", -0.05, 0.05)],
        words: "torque and motion are not measured at the same instant",
        look_alikes: &["viscous", "elasticity", "armature", "quadratic_drag"],
        separated_by: "fast motion with sharp reversals: a lag grows with frequency, friction does not",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.004,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::boundary(-state.tau), Term::zero()]
    }
}
