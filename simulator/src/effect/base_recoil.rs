//! A base that moves as the legs push it: a share of what a base would do that nothing holds (`suspension`).

use super::{Description, Effect, Parameter, Scope, Site};

pub(super) const DESCRIPTION: Description = Description {
    name: "base_recoil",
    words: "the base recoils from the legs: 0 of a fixed base, 1 of a free one",
    scope: Scope::Base,
    parameters: &[Parameter::within("s", "1", 0.0, 0.0, 1.0)],
    in_catalogue: true,
};

/// See the module.
pub(super) struct BaseRecoil {
    share: f64,
}

pub(super) fn new(values: &[f64], _: &Site) -> BaseRecoil {
    BaseRecoil { share: values[0] }
}

impl Effect for BaseRecoil {
    fn recoil(&self) -> f64 {
        self.share
    }
}
