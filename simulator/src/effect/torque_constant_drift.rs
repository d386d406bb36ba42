//! A torque constant that falls as the motor warms: true = reported × (1 − c (T − T0)).

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "torque_constant_drift",
    words: "a torque constant that falls with temperature",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("c", "1/K", 0.0, -0.02, 0.02),
        Parameter::new("T0", "degC", 35.0),
    ],
    in_catalogue: false,
};

/// See the module.
pub(super) struct TorqueConstantDrift {
    slope: f64,
    reference: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> TorqueConstantDrift {
    TorqueConstantDrift {
        slope: values[0],
        reference: values[1],
    }
}

impl Effect for TorqueConstantDrift {
    fn true_torque(&self, tau: f64, state: &JointState) -> f64 {
        tau * (1.0 - self.slope * (state.temperature - self.reference))
    }

    fn is_thermal(&self) -> bool {
        true
    }
}
