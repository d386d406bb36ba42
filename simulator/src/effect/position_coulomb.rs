//! Dry friction that depends on position, F (1 + sin(w (q − centre))) sign(q̇): a gear that is tight on one side.

use super::{Description, Effect, JointState, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "position_coulomb",
    words: "dry friction that depends on position",
    scope: Scope::Joint,
    parameters: &[
        Parameter::positive("F", "N m", 0.0),
        Parameter::new("w", "1", 3.0),
    ],
    in_catalogue: false,
};

/// See the module.
pub(super) struct PositionCoulomb {
    size: f64,
    waves: f64,
    centre: f64,
}

pub(super) fn new(values: &[f64], site: &Site) -> PositionCoulomb {
    PositionCoulomb {
        size: values[0],
        waves: values[1],
        centre: site.centre,
    }
}

impl Effect for PositionCoulomb {
    fn dry_friction(&self, state: &JointState) -> [f64; 2] {
        let wave = (self.waves * (state.q - self.centre)).sin();
        [self.size * (1.0 + wave); 2]
    }
}
