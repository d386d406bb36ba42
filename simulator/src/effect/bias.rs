//! A constant torque β.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "bias",
    words: "a constant torque",
    scope: Scope::Joint,
    parameters: &[
        Parameter::new("beta", "N m", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Bias {
    torque: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Bias {
    Bias {
        torque: values[0],
    }
}

impl Effect for Bias {
    fn motor_torque(&self, _: &JointState) -> f64 {
        self.torque
    }
}
