//! Other models to begin with, whose effects one search alone would not take first: what every drive has, and one cause where two were taken.

use proprio_core::effect::EffectKind;

use super::candidate::Member;
use super::state::{State, Step};
use crate::catalogue;
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
    let lacking = EffectKind::PLAIN.map(all).into_iter();
    lacking.filter(|members| !members.is_empty()).collect()
}

/// Whether the model as it was given lacks what makes a drive: two families of the plain effects were found.
pub(super) fn lacks_a_drive(steps: &[Step]) -> bool {
    let found = |effect: &&EffectKind| {
        (steps.iter()).any(|s| s.effect == **effect && s.members.len() > 1 && !s.removed)
    };
    EffectKind::PLAIN.iter().filter(found).count() >= 2
}

/// Of each effect that is a sum of others the joints at each of which steps have found all of them: one cause where they see two.
pub(super) fn one_cause(data: &[LimbData], steps: &[Step]) -> Vec<Vec<Member>> {
    let found = |effect: EffectKind, limb: usize, joint: usize| {
        let member = [(limb, (effect, joint))];
        (steps.iter()).any(|step| !step.removed && step.members == member)
    };
    let sums = catalogue::effects().filter(|sum| !sum.description().sum_of.is_empty());
    let at = |sum: EffectKind| {
        let joints = (data.iter().enumerate())
            .flat_map(|(limb, data)| (0..data.joints()).map(move |joint| (limb, joint)));
        joints
            .filter(move |&(limb, joint)| {
                let mut parts = sum.description().sum_of.iter();
                parts.all(|part| found(*part, limb, joint))
            })
            .map(move |(limb, joint)| vec![(limb, (sum, joint))])
    };
    sums.flat_map(at).collect()
}
