//! Drag c q̇ |q̇|, as of a fluid or a fan.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "quadratic_drag",
    words: "drag that grows with the speed squared",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("c", "N m s^2/rad^2", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct QuadraticDrag {
    coefficient: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> QuadraticDrag {
    QuadraticDrag {
        coefficient: values[0],
    }
}

impl Effect for QuadraticDrag {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.coefficient * state.dq * state.dq.abs()
    }
}
