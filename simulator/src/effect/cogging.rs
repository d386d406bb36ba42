//! Cogging, A sin(N q + ψ) with N = k × gear ratio: k periods per turn of the motor.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "cogging",
    words: "a torque that repeats with the motor's turn",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("A", "N m", 0.0),
        Parameter::new("psi", "rad", 0.0),
        Parameter::within("k", "1", 1.0, 1e-3, 1e3),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Cogging {
    size: f64,
    phase: f64,
    per_turn: f64,
}

pub(super) fn new(values: &[f64], site: &Site) -> Cogging {
    Cogging {
        size: values[0],
        phase: values[1],
        per_turn: values[2] * site.gear,
    }
}

impl Effect for Cogging {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.size * (self.per_turn * state.q + self.phase).sin()
    }
}
