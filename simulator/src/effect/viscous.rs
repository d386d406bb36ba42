//! Viscous friction, Fv q̇.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "viscous",
    words: "friction that grows with speed",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("Fv", "N m s/rad", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Viscous {
    coefficient: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Viscous {
    Viscous {
        coefficient: values[0],
    }
}

impl Effect for Viscous {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.coefficient * state.dq
    }
}
