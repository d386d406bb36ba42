//! Force episodes at a foot: from `start` on, every `period` for `length`, each growing and fading within 20 ms.

use super::{Description, Effect, Parameter, Scope, Site};
use nalgebra::Vector3;
use std::f64::consts::PI;

/// A force grows and fades over this time, s.
const EDGE: f64 = 0.02;

pub(super) const DESCRIPTION: Description = Description {
    name: "contact",
    words: "a force at a foot, in episodes",
    scope: Scope::Foot,
    parameters: &[
        Parameter::new("z", "N", 0.0),
        Parameter::new("x", "N", 0.0),
        Parameter::new("y", "N", 0.0),
        Parameter::new("start", "s", 2.0),
        Parameter::positive("length", "s", 0.6),
        Parameter::within("period", "s", 3.0, 1e-3, f64::INFINITY),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Contact {
    force: Vector3<f64>,
    start: f64,
    length: f64,
    period: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Contact {
    Contact {
        force: Vector3::new(values[1], values[2], values[0]),
        start: values[3],
        length: values[4],
        period: values[5],
    }
}

impl Effect for Contact {
    fn foot_force(&self, t: f64) -> Vector3<f64> {
        if t < self.start {
            return Vector3::zeros();
        }
        let since = (t - self.start).rem_euclid(self.period);
        self.force * (rise(since) - rise(since - self.length))
    }
}

/// From 0 to 1 within [`EDGE`] after zero, a half cosine.
fn rise(t: f64) -> f64 {
    0.5 - 0.5 * (PI * (t / EDGE).clamp(0.0, 1.0)).cos()
}
