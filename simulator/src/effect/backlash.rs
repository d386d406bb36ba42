//! Play between motor and link: two masses and stops, stiff ones, a gap apart. The motor is what is measured.

use super::{Description, Effect, Parameter, Scope, Site, Transmission};

pub(super) const DESCRIPTION: Description = Description {
    name: "backlash",
    words: "a gap between motor and link",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("gap", "rad", 0.0),
        Parameter::within("k", "N m/rad", 3000.0, 1.0, 1e7),
        Parameter::positive("d", "N m s/rad", 1.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Backlash {
    gap: f64,
    stiffness: f64,
    damping: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Backlash {
    Backlash {
        gap: values[0],
        stiffness: values[1],
        damping: values[2],
    }
}

impl Effect for Backlash {
    fn transmission(&self) -> Option<Transmission> {
        Some(Transmission {
            stiffness: self.stiffness,
            damping: self.damping,
            gap: self.gap,
            friction: 0.0,
            displacement: 1.0,
        })
    }
}
