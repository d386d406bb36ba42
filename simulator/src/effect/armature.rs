//! Armature Ia q̈: the rotor's inertia times the gear ratio squared.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "armature",
    words: "rotor inertia seen through the gear",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("Ia", "kg m^2", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Armature {
    inertia: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Armature {
    Armature {
        inertia: values[0],
    }
}

impl Effect for Armature {
    fn armature(&self) -> f64 {
        self.inertia
    }
}
