//! Coulomb friction of what turns with the sum of a joint's velocity and that of the one that carries it.
//!
//! The method that takes dry friction at its sign ([`super::super::dry`]) knows friction of one joint only, so that this one rises
//! over a small speed, as a greased seal's does.

use super::{Description, Effect, Parameter, Scope, Site};

/// The speed over which it rises, rad/s: slower than a Go2's encoders tell.
const RISE: f64 = 0.03;

pub(super) const DESCRIPTION: Description = Description {
    name: "coupled_coulomb",
    words: "Coulomb friction of what turns with this joint and the one before",
    scope: Scope::Pair,
    parameters: &[Parameter::positive("F", "N m", 0.0)],
    in_catalogue: true,
};

/// See the module.
pub(super) struct CoupledCoulomb {
    size: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> CoupledCoulomb {
    CoupledCoulomb { size: values[0] }
}

impl Effect for CoupledCoulomb {
    fn coupled_torque(&self, [_, own]: [f64; 2], [_, carrier]: [f64; 2]) -> [f64; 2] {
        [self.size * ((own + carrier) / RISE).tanh(); 2]
    }
}
