//! Friction that grows with the load, μ |transmitted torque| sign(q̇); the load is what the gear hands to the link.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "load_friction",
    words: "friction that grows with the load",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("mu", "1", 0.0, 0.0, 0.9),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct LoadFriction {
    coefficient: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> LoadFriction {
    LoadFriction {
        coefficient: values[0],
    }
}

impl Effect for LoadFriction {
    fn dry_friction(&self, state: &JointState) -> [f64; 2] {
        [self.coefficient * state.transmitted.abs(); 2]
    }

    fn depends_on_load(&self) -> bool {
        true
    }
}
