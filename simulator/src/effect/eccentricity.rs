//! An encoder's disc off its axis: the position that is reported is wrong by a sine of the true one, and the velocity by its rate.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "eccentricity",
    words: "an encoder's disc off its axis",
    scope: Scope::Joint,
    parameters: &[
        Parameter::within("s", "rad", 0.0, -0.2, 0.2),
        Parameter::within("c", "rad", 0.0, -0.2, 0.2),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Eccentricity {
    sine: f64,
    cosine: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Eccentricity {
    Eccentricity {
        sine: values[0],
        cosine: values[1],
    }
}

impl Effect for Eccentricity {
    fn reported(&self, q: f64, dq: f64) -> (f64, f64) {
        let (sin, cos) = q.sin_cos();
        (
            q + self.sine * sin + self.cosine * cos,
            dq * (1.0 + self.sine * cos - self.cosine * sin),
        )
    }
}
