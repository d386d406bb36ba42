//! A torque reported late by d against the motion; any time, not whole samples. Control does not feel it.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "delay",
    words: "the reported torque is late",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("d", "s", 0.0, 0.0, 0.1),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Delay {
    time: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Delay {
    Delay {
        time: values[0],
    }
}

impl Effect for Delay {
    fn delay(&self) -> f64 {
        self.time
    }
}
