//! Other models to begin with, whose effects one search alone would not take first: what every drive has, and one cause where two were taken.

use proprio_core::effect::EffectKind;

use super::candidate::Member;
use super::criteria::choice::PLAIN;
use super::state::{State, Step};
use crate::estimate::limb_data::LimbData;

/// Of each effect that every drive has the joints where a model lacks it.
pub(super) fn lacking_of_drive(data: &[LimbData], model: &State) -> Vec<Vec<Member>> {
    let there = model.places();
    let all = |effect: EffectKind| -> Vec<Member> {
        (data.iter().enumerate())
            .flat_map(|(limb, data)| (0..data.joints()).map(move |j| (limb, (effect, j))))
            .filter(|(limb, place)| !there[*limb].contains(place))
            .collect()
    };
    let lacking = PLAIN.map(all).into_iter();
    lacking.filter(|members| !members.is_empty()).collect()
}

/// Whether the model as it was given lacks what makes a drive: two families of the plain effects were found.
pub(super) fn lacks_a_drive(steps: &[Step]) -> bool {
    let found = |effect: &&EffectKind| {
        (steps.iter()).any(|s| s.effect == **effect && s.members.len() > 1 && !s.removed)
    };
    PLAIN.iter().filter(found).count() >= 2
}

/// Friction that differs with the direction where steps have found Coulomb friction and a constant torque at a single joint.
pub(super) fn one_cause(data: &[LimbData], steps: &[Step]) -> Vec<Vec<Member>> {
    let found = |effect: EffectKind, joint: (usize, usize)| {
        steps.iter().any(|step| {
            let [(limb, place)] = step.members[..] else {
                return false;
            };
            !step.removed && place.0 == effect && (limb, place.1) == joint
        })
    };
    let joints = (data.iter().enumerate())
        .flat_map(|(limb, data)| (0..data.joints()).map(move |joint| (limb, joint)));
    joints
        .filter(|&at| found(EffectKind::Coulomb, at) && found(EffectKind::Bias, at))
        .map(|(limb, joint)| vec![(limb, (EffectKind::AsymmetricCoulomb, joint))])
        .collect()
}
