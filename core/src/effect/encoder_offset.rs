//! A zero position that is off: reported = true + δ. The rigid body's torque then changes by its slope along the position.

use super::{
    Description, Effect, Enters, Form, JointState, Moved, Parameter, Prior, Reach, Varies,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct EncoderOffset;

impl Effect for EncoderOffset {
    const DESCRIPTION: Description = Description {
        name: "encoder_offset",
        torque: "reported position = true + δ",
        form: Form::Motion(Moved::Zero),
        enters: Enters::Derivative,
        reach: Reach::Joint,
        varies: Varies::LikeWeight,
        parameters: &[Parameter::new("δ", "rad", -1.0, 1.0)],
        words: "the joint's zero is not where the model thinks",
        look_alikes: &["bias", "base_tilt", "payload", "spring"],
        separated_by: "poses of large gravity torque on both sides of the zero, and fast motion of the joints above",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.05,
        }
    }

    fn motion<T: Real>(_: &JointState<T>, _: usize) -> [T; 2] {
        [-T::one(), T::zero()]
    }
}
