//! A load on a body: a point mass m at the body's centre of mass and, to first order, away from it: h is the first moment
//! about that centre, in the axes of the joint frame; I is what its inertia has beyond a point mass, the same about all axes.

use super::{Description, Effect, Form, Parameter, Prior, Reach, Varies};
use crate::robot::Actuator;

/// See the module.
pub(super) struct Payload;

impl Effect for Payload {
    const DESCRIPTION: Description = Description {
        name: "payload",
        torque: "rigid-body torque of a mass on the body",
        form: Form::Inertia,
        reach: Reach::Body,
        varies: Varies::LikeWeight,
        parameters: &[
            Parameter::new("m", "kg", 0.0, f64::INFINITY),
            Parameter::new("hx", "kg m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("hy", "kg m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("hz", "kg m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("I", "kg m^2", 0.0, f64::INFINITY),
        ],
        words: "a mass on this body that the model does not have",
        look_alikes: &[
            "torque_gain",
            "bias",
            "armature",
            "spring",
            "encoder_offset",
        ],
        separated_by: "slow motion through the whole range and fast motion, of this joint and of those above",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        let std = match parameter {
            0 => 0.5,
            4 => 0.005,
            _ => 0.03,
        };
        Prior { mean: 0.0, std }
    }
}
