//! Viscous friction of what turns with a joint and the one that carries it: Fc times the sum of their velocities, on both.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "coupled_viscous",
    words: "viscous friction of what turns with this joint and the one before",
    scope: Scope::Pair,
    parameters: &[Parameter::new("Fc", "N m s/rad", 0.0)],
    in_catalogue: true,
};

/// See the module.
pub(super) struct CoupledViscous {
    friction: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> CoupledViscous {
    CoupledViscous {
        friction: values[0],
    }
}

impl Effect for CoupledViscous {
    fn coupled_torque(&self, [_, own]: [f64; 2], [_, carrier]: [f64; 2]) -> [f64; 2] {
        [self.friction * (own + carrier); 2]
    }
}
