//! Coulomb friction that differs with direction: F+ in positive motion, F− in negative.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "asymmetric_coulomb",
    words: "friction that differs with direction",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("F_plus", "N m", 0.0),
        Parameter::positive("F_minus", "N m", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct AsymmetricCoulomb {
    sizes: [f64; 2],
}

pub(super) fn new(values: &[f64], _: &Site) -> AsymmetricCoulomb {
    AsymmetricCoulomb {
        sizes: [values[0], values[1]],
    }
}

impl Effect for AsymmetricCoulomb {
    fn dry_friction(&self, _: &JointState) -> [f64; 2] {
        self.sizes
    }
}
