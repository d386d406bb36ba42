//! Viscous friction that differs with direction, d |q̇| beside the symmetric one.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "asymmetric_viscous",
    words: "viscous friction that is larger in one direction",
    scope: Scope::Joint,
    parameters: &[Parameter::new("d", "N m s/rad", 0.0)],
    in_catalogue: true,
};

/// See the module.
pub(super) struct AsymmetricViscous {
    size: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> AsymmetricViscous {
    AsymmetricViscous { size: values[0] }
}

impl Effect for AsymmetricViscous {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.size * state.dq.abs()
    }
}
