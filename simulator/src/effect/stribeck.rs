//! Stribeck friction, Fs exp(−(q̇/vs)²) sign(q̇): what dry friction has more near standstill.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "stribeck",
    words: "friction that falls with speed",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("Fs", "N m", 0.0),
        Parameter::within("vs", "rad/s", 0.05, 1e-3, f64::INFINITY),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Stribeck {
    size: f64,
    speed: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Stribeck {
    Stribeck {
        size: values[0],
        speed: values[1],
    }
}

impl Effect for Stribeck {
    fn dry_friction(&self, state: &JointState) -> [f64; 2] {
        let ratio = state.dq / self.speed;
        [self.size * (-ratio * ratio).exp(); 2]
    }
}
