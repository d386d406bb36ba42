//! LuGre friction (Canudas de Wit et al. 1995): bristles of deflection z, ż = q̇ − σ0 |q̇| z / F, torque σ0 z, σ0 = F /
//! reach.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "lugre",
    words: "dry friction that yields before it slides",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("F", "N m", 0.0),
        Parameter::within("reach", "rad", 5e-3, 1e-4, 1.0),
    ],
    in_catalogue: false,
};

/// See the module.
pub(super) struct Lugre {
    size: f64,
    reach: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Lugre {
    Lugre {
        size: values[0],
        reach: values[1],
    }
}

impl Effect for Lugre {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.size * state.memory / self.reach
    }

    // The bristles' relaxation is fast at speed: implicit in z.
    fn remember(&self, z: f64, dq: f64, h: f64) -> f64 {
        (z + h * dq) / (1.0 + h * dq.abs() / self.reach)
    }

    fn has_memory(&self) -> bool {
        true
    }
}
