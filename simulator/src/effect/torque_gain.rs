//! A torque reported in a wrong scale: true = g × reported.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "torque_gain",
    words: "true torque = g × reported",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("g", "1", 1.0, 0.05, 20.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct TorqueGain {
    gain: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> TorqueGain {
    TorqueGain {
        gain: values[0],
    }
}

impl Effect for TorqueGain {
    fn true_torque(&self, tau: f64, _: &JointState) -> f64 {
        self.gain * tau
    }
}
