//! A wrong velocity: reported = g × true. Positions tell it best: ∫ q̇ dt against Δq.

use super::{Description, Effect, Enters, Form, JointState, Moved, Parameter, Prior};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct VelocityGain;

impl Effect for VelocityGain {
    const DESCRIPTION: Description = Description {
        name: "velocity_gain",
        torque: "reported velocity = g × true",
        form: Form::Motion(Moved::Velocity),
        enters: Enters::Positions,
        parameters: &[Parameter::new("g", "1", 0.2, 5.0).neutral(1.0)],
        words: "the reported velocity is a constant multiple of the true one (position is right)",
        look_alikes: &["viscous", "armature", "torque_gain"],
        separated_by: "any motion: positions alone show it",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 1.0,
            std: 0.1,
        }
    }

    fn motion<T: Real>(state: &JointState<T>, _: usize) -> [T; 2] {
        [T::zero(), -state.dq]
    }
}
