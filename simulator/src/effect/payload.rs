//! A mass at a point of a body; the point is in the frame of the joint that moves the body.

use super::{Description, Effect, Parameter, Scope, Site};
use nalgebra::{Matrix3, Vector3};
use proprio_core::inertia::InertialParameters;

pub(super) const DESCRIPTION: Description = Description {
    name: "payload",
    words: "a mass on a body",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("m", "kg", 0.0),
        Parameter::new("x", "m", 0.0),
        Parameter::new("y", "m", 0.0),
        Parameter::new("z", "m", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Payload {
    body: InertialParameters<f64>,
}

pub(super) fn new(values: &[f64], _: &Site) -> Payload {
    Payload {
        body: InertialParameters::from_com(
            values[0],
            Vector3::new(values[1], values[2], values[3]),
            Matrix3::zeros(),
        ),
    }
}

impl Effect for Payload {
    fn load(&self) -> InertialParameters<f64> {
        self.body
    }
}
