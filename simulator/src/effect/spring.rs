//! A spring beside the joint, k (q − q0), as of a cable or a cover; it acts on the link.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "spring",
    words: "a spring beside the joint",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("k", "N m/rad", 0.0),
        Parameter::new("q0", "rad", 0.0),
    ],
    in_catalogue: true,
};

/// See the module.
pub(super) struct Spring {
    stiffness: f64,
    rest: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> Spring {
    Spring {
        stiffness: values[0],
        rest: values[1],
    }
}

impl Effect for Spring {
    fn link_torque(&self, state: &JointState) -> f64 {
        self.stiffness * (state.link_q - self.rest)
    }
}
