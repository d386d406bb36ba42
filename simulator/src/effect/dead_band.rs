//! A motor that gives nothing within a band of what is asked for, and beyond it by the band less.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "dead_band",
    words: "no true torque within a band of the reported",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("b", "N m", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct DeadBand {
    band: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> DeadBand {
    DeadBand {
        band: values[0],
    }
}

impl Effect for DeadBand {
    fn true_torque(&self, tau: f64, _: &JointState) -> f64 {
        tau - tau.clamp(-self.band, self.band)
    }
}
