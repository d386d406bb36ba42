//! Dahl's friction (1968), exponent 1: torque F σ, dσ/dq = (1 − σ sign(q̇)) / zs, with σ from −1 to 1.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "presliding",
    words: "dry friction that builds up over a displacement",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("F", "N m", 0.0),
        Parameter::within("zs", "rad", 0.01, 1e-4, 1.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Presliding {
    size: f64,
    displacement: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Presliding {
    Presliding {
        size: values[0],
        displacement: values[1],
    }
}

impl Effect for Presliding {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.size * state.memory
    }

    // The velocity is one within a step, the deflection's way to its limit exponential.
    fn remember(&self, share: f64, dq: f64, h: f64) -> f64 {
        let limit = dq.signum();
        limit + (share - limit) * (-(h * dq / self.displacement).abs()).exp()
    }

    fn has_memory(&self) -> bool {
        true
    }
}
