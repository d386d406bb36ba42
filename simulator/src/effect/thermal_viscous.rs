//! Viscous friction that depends on the motor's temperature, kT (T − T0) q̇; kT is negative for grease, which thins.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "thermal_viscous",
    words: "viscous friction that changes with temperature",
    scope: Scope::Joint,
    parameters: &[
        Parameter::new("kT", "N m s/(rad K)", 0.0),
        Parameter::new("T0", "degC", 40.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct ThermalViscous {
    slope: f64,
    reference: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> ThermalViscous {
    ThermalViscous {
        slope: values[0],
        reference: values[1],
    }
}

impl Effect for ThermalViscous {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.slope * (state.temperature - self.reference) * state.dq
    }

    fn is_thermal(&self) -> bool {
        true
    }
}
