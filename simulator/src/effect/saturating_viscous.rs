//! Viscous friction that levels off, F (1 − exp(−|q̇|/vs)) against the motion.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "saturating_viscous",
    words: "viscous friction that levels off with speed",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("F", "N m", 0.0),
        Parameter::within("vs", "rad/s", 1.0, 1e-3, f64::INFINITY),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct SaturatingViscous {
    size: f64,
    speed: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> SaturatingViscous {
    SaturatingViscous {
        size: values[0],
        speed: values[1],
    }
}

impl Effect for SaturatingViscous {
    fn motor_torque(&self, state: &JointState) -> f64 {
        -self.size * (-state.dq.abs() / self.speed).exp_m1() * state.dq.signum()
    }
}
