//! A cable that catches at one position, A exp(−((q − q0)/width)²), and only in positive motion; q0 counts from the
//! middle of the motion.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "cable_snag",
    words: "a cable that jerks at one position",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("A", "N m", 0.0),
        Parameter::new("q0", "rad", 0.1),
        Parameter::within("width", "rad", 0.02, 1e-3, 10.0),
    ],
    in_catalogue: false,
};

/// See the module.
pub(super) struct CableSnag {
    size: f64,
    place: f64,
    width: f64,
}

pub(super) fn new(values: &[f64], site: &Site) -> CableSnag {
    CableSnag {
        size: values[0],
        place: site.centre + values[1],
        width: values[2],
    }
}

impl Effect for CableSnag {
    fn dry_friction(&self, state: &JointState) -> [f64; 2] {
        let off = (state.q - self.place) / self.width;
        [self.size * (-off * off).exp(), 0.0]
    }
}
