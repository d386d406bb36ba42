//! A disturbance tied to time, A sin(2π f t): a fan, a mains hum, a swinging cable.

use super::{Description, Effect, JointState, Parameter, Scope, Site};
use std::f64::consts::TAU;

pub(super) const DESCRIPTION: Description = Description {
    name: "periodic_torque",
    words: "a disturbance tied to time",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("A", "N m", 0.0),
        Parameter::positive("f", "Hz", 3.3),
    ],
    in_catalogue: false,
};

/// See the module.
pub(super) struct PeriodicTorque {
    size: f64,
    frequency: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> PeriodicTorque {
    PeriodicTorque {
        size: values[0],
        frequency: values[1],
    }
}

impl Effect for PeriodicTorque {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.size * (TAU * self.frequency * state.t).sin()
    }
}
