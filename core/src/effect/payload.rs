//! A load on a body: ten inertial parameters more, about the body's joint frame.

use super::{Description, Effect, Form, Parameter, Prior};
use crate::go2::Actuator;

/// See the module.
pub(super) struct Payload;

impl Effect for Payload {
    const DESCRIPTION: Description = Description {
        name: "payload",
        torque: "rigid-body torque of a load on the body",
        form: Form::Inertia,
        parameters: &[
            Parameter::new("m", "kg", 0.0, f64::INFINITY),
            Parameter::new("hx", "kg m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("hy", "kg m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("hz", "kg m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("Ixx", "kg m^2", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("Ixy", "kg m^2", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("Ixz", "kg m^2", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("Iyy", "kg m^2", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("Iyz", "kg m^2", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("Izz", "kg m^2", f64::NEG_INFINITY, f64::INFINITY),
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
        urdf: None,
        mjcf: None,
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        let std = match parameter {
            0 => 0.5,
            1..=3 => 0.1,
            _ => 0.02,
        };
        Prior { mean: 0.0, std }
    }
}
