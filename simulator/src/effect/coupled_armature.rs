//! A rotor that turns with the sum of a joint's angle and that of the one that carries it: both feel Ic times both accelerations.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "coupled_armature",
    words: "inertia that turns with this joint and the one before",
    scope: Scope::Pair,
    parameters: &[Parameter::new("Ic", "kg m^2", 0.0)],
    in_catalogue: true,
};

/// See the module.
pub(super) struct CoupledArmature {
    inertia: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> CoupledArmature {
    CoupledArmature { inertia: values[0] }
}

impl Effect for CoupledArmature {
    fn coupled_inertia(&self) -> f64 {
        self.inertia
    }
}
