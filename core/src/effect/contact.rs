//! A force at the foot that the model does not know: a detector finds it by its direction, Jᵀλ with λ away from the ground.

use super::{Description, Effect, Enters, Form, Parameter, Prior, Reach};
use crate::robot::Actuator;

/// See the module.
pub(super) struct Contact;

impl Effect for Contact {
    const DESCRIPTION: Description = Description {
        name: "contact",
        torque: "Jᵀ × force at the foot",
        form: Form::Force,
        enters: Enters::Direction,
        reach: Reach::Body,
        parameters: &[Parameter::new(
            "force",
            "N",
            f64::NEG_INFINITY,
            f64::INFINITY,
        )],
        words: "a force at the foot: the leg stands on something, or touches it",
        look_alikes: &["payload", "bias", "load_friction"],
        separated_by: "the robot hung in the air",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 50.0,
        }
    }
}
