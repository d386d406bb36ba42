//! A motor whose true torque is limited below the reported value.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "saturation",
    words: "true torque limited below the reported",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("limit", "N m", 0.0, 1e-3, f64::INFINITY),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Saturation {
    limit: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Saturation {
    Saturation {
        limit: values[0],
    }
}

impl Effect for Saturation {
    fn true_torque(&self, tau: f64, _: &JointState) -> f64 {
        tau.clamp(-self.limit, self.limit)
    }
}
