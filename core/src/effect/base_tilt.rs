//! Gravity is not where the model thinks: the base is turned by roll and pitch (small angles about its x and y axes).

use super::{Description, Effect, Enters, Form, Parameter, Prior, Reach, Varies};
use crate::robot::Actuator;

/// See the module.
pub(super) struct BaseTilt;

impl Effect for BaseTilt {
    const DESCRIPTION: Description = Description {
        name: "base_tilt",
        torque: "gravity turned by roll, pitch",
        form: Form::Gravity,
        enters: Enters::Derivative,
        reach: Reach::Robot,
        varies: Varies::LikeWeight,
        parameters: &[
            Parameter::new("roll", "rad", -0.8, 0.8),
            Parameter::new("pitch", "rad", -0.8, 0.8),
        ],
        words: "the base is not level as the model takes it to be",
        look_alikes: &["bias", "encoder_offset", "payload"],
        separated_by: "poses in which gravity's torque on hips and thighs differs; or the IMU's accelerometer at rest",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.0,
                std: 0.05,
            },
            _ => Prior {
                mean: 0.0,
                std: 0.05,
            },
        }
    }
}
