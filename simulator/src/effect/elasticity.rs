//! A spring and a damper between motor and link: two masses, of which the motor's is measured. The motor has its
//! armature, on paper if none is simulated.

use super::{Description, Effect, Parameter, Scope, Site, Transmission};

pub(super) const DESCRIPTION: Description = Description {
    name: "elasticity",
    words: "a spring between motor and link, with friction f inside it that builds up over w",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("k", "N m/rad", 0.0, 1.0, 1e7),
        Parameter::positive("d", "N m s/rad", 0.1),
        Parameter::positive("f", "N m", 0.0),
        Parameter::within("w", "rad", 0.002, 1e-6, 1.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Elasticity {
    stiffness: f64,
    damping: f64,
    friction: f64,
    displacement: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Elasticity {
    Elasticity {
        stiffness: values[0],
        damping: values[1],
        friction: values[2],
        displacement: values[3],
    }
}

impl Effect for Elasticity {
    fn transmission(&self) -> Option<Transmission> {
        Some(Transmission {
            stiffness: self.stiffness,
            damping: self.damping,
            gap: 0.0,
            friction: self.friction,
            displacement: self.displacement,
        })
    }
}
