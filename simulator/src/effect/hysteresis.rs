//! Hysteresis of Bouc and Wen (n = 1): torque A z, ż = (q̇ − ½ (|q̇| z + q̇ |z|)) / width, wide enough to see in the
//! position.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "hysteresis",
    words: "a torque that depends on where the joint came from",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("A", "N m", 0.0),
        Parameter::within("width", "rad", 0.15, 1e-3, 10.0),
    ],
    in_catalogue: false,
};

/// See the module.
pub(super) struct Hysteresis {
    size: f64,
    width: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Hysteresis {
    Hysteresis {
        size: values[0],
        width: values[1],
    }
}

impl Effect for Hysteresis {
    fn motor_torque(&self, state: &JointState) -> f64 {
        self.size * state.memory
    }

    // |z| ≤ 1 and a step is short against the width: the explicit rule holds.
    fn remember(&self, z: f64, dq: f64, h: f64) -> f64 {
        (z + h * (dq - 0.5 * (dq.abs() * z + dq * z.abs())) / self.width).clamp(-1.0, 1.0)
    }

    fn has_memory(&self) -> bool {
        true
    }
}
