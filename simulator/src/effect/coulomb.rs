//! Coulomb friction, Fc sign(q̇).

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "coulomb",
    words: "friction of constant size",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("Fc", "N m", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Coulomb {
    size: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Coulomb {
    Coulomb {
        size: values[0],
    }
}

impl Effect for Coulomb {
    fn dry_friction(&self, _: &JointState) -> [f64; 2] {
        [self.size; 2]
    }
}
