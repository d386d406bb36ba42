//! A position reported with an offset: reported = true + δ. The controller sees it too.

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "encoder_offset",
    words: "reported position = true + delta",
    scope: Scope::Joint,
    parameters: &[
        Parameter::new("delta", "rad", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct EncoderOffset {
    offset: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> EncoderOffset {
    EncoderOffset {
        offset: values[0],
    }
}

impl Effect for EncoderOffset {
    fn reported(&self, q: f64, dq: f64) -> (f64, f64) {
        (q + self.offset, dq)
    }
}
