//! Coulomb friction that changes suddenly at a share of the log: a seal that gives way.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "friction_step",
    words: "dry friction that changes suddenly",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("F", "N m", 0.0),
        Parameter::within("share", "1", 0.5, 0.0, 1.0),
    ],
    in_catalogue: false,
};

/// See the module.
pub(super) struct FrictionStep {
    size: f64,
    time: f64,
}

pub(super) fn new(values: &[f64], site: &Site) -> FrictionStep {
    FrictionStep {
        size: values[0],
        time: values[1] * site.duration,
    }
}

impl Effect for FrictionStep {
    fn dry_friction(&self, state: &JointState) -> [f64; 2] {
        if state.t < self.time {
            [0.0; 2]
        } else {
            [self.size; 2]
        }
    }
}
