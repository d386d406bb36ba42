//! A base that is not mounted as the model thinks: turned further by roll about the known mount's x axis, then by pitch
//! about its y axis.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "base_tilt",
    words: "gravity is not where the model thinks",
    scope: Scope::Base,
    parameters: &[
        Parameter::within("roll", "rad", 0.0, -1.6, 1.6),
        Parameter::within("pitch", "rad", 0.0, -1.6, 1.6),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct BaseTilt {
    roll: f64,
    pitch: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> BaseTilt {
    BaseTilt {
        roll: values[0],
        pitch: values[1],
    }
}

impl Effect for BaseTilt {
    fn tilt(&self) -> [f64; 2] {
        [self.roll, self.pitch]
    }
}
