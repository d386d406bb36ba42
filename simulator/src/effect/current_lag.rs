//! A motor whose torque follows what is asked for as a filter of first order does, dτ/dt = (asked − τ)/T; what is asked for is reported.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "current_lag",
    words: "true torque follows the reported with a lag",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("T", "s", 0.0, 0.0, 0.1),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct CurrentLag {
    time: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> CurrentLag {
    CurrentLag {
        time: values[0],
    }
}

impl Effect for CurrentLag {
    fn lag(&self) -> f64 {
        self.time
    }
}
