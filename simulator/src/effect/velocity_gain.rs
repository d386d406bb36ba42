//! A velocity reported in a wrong scale: reported = g × true. The controller sees it too.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "velocity_gain",
    words: "reported velocity = g × true",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("g", "1", 1.0, 0.2, 5.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct VelocityGain {
    gain: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> VelocityGain {
    VelocityGain {
        gain: values[0],
    }
}

impl Effect for VelocityGain {
    fn reported(&self, q: f64, dq: f64) -> (f64, f64) {
        (q, self.gain * dq)
    }
}
