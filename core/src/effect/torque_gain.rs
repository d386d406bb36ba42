//! A wrong torque constant: true torque = g × reported.
//!
//! The reported torque is 1/g times all that the model says of the joint; the column of 1/g is the model's own torque. (With
//! W θ = g ∫τ instead, g = 0 and no body at all would fit best.)

use super::{Description, Effect, Enters, Form, Parameter, Prior};
use crate::robot::Actuator;

/// See the module.
pub(super) struct TorqueGain;

impl Effect for TorqueGain {
    const DESCRIPTION: Description = Description {
        name: "torque_gain",
        torque: "true torque = g × reported",
        form: Form::Scale,
        enters: Enters::Derivative,
        drifts: true,
        parameters: &[Parameter::new("g", "1", 0.2, 5.0).neutral(1.0)],
        words: "the reported torque is a constant multiple of the true one (torque constant, gear efficiency)",
        look_alikes: &["payload", "armature", "load_friction", "encoder_offset"],
        separated_by: "a known mass on the foot, in several poses: only it fixes the torque's scale",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 1.0,
            std: 0.2,
        }
    }
}
