//! Other models to begin with, whose effects one search alone would not take first: what every drive has, one cause where two were taken, one
//! joint where all were taken and others undone.

use std::collections::BTreeSet;

use proprio_core::effect::EffectKind;

use super::candidate::{Candidate, Member};
use super::fitted::{Fitted, Step};
use crate::catalogue;
use crate::equation::values::is_shared;

/// Whether the model as it was given lacks what makes a drive: two families of the plain effects were found.
pub(super) fn lacks_a_drive<M: Fitted>(steps: &[Step<M>]) -> bool {
    let found = |effect: &&EffectKind| {
        (steps.iter()).any(|s| s.effect == **effect && s.members.len() > 1 && !s.removed)
    };
    EffectKind::PLAIN.iter().filter(found).count() >= 2
}

/// Of each effect that is a sum of others the joints at each of which steps have found all of them: one cause where they see two.
pub(super) fn one_cause<M: Fitted>(steps: &[Step<M>]) -> Vec<Vec<Member>> {
    let found = |step: &Step<M>| match step.members[..] {
        [member] if !step.removed => Some(member),
        _ => None,
    };
    let found: BTreeSet<Member> = steps.iter().filter_map(found).collect();
    let at = |sum: EffectKind| {
        let parts = sum.description().sum_of;
        let is_whole = |limb: usize, joint: usize| {
            let mut parts = parts.iter();
            parts.all(|part| found.contains(&(limb, (*part, joint))))
        };
        let first = found
            .iter()
            .filter(move |(_, place)| parts.first() == Some(&place.0));
        let whole = first.filter(move |(limb, place)| is_whole(*limb, place.1));
        whole
            .map(|(limb, place)| vec![(*limb, (sum, place.1))])
            .collect::<Vec<_>>()
    };
    catalogue::effects().flat_map(at).collect()
}

/// Where an effect was `added` as a cause that all joints share and, as if to undo it there, at some joints too: that effect at the other
/// joint where it takes away most of what the `first` look saw. What moves a torque in time undoes whatever else does.
pub(super) fn one_joint<'c>(
    added: &[(EffectKind, &[Member])],
    first: impl Iterator<Item = &'c Candidate>,
) -> Option<Member> {
    let all_share = |members: &[Member]| members.iter().all(|member| is_shared(member.1.1));
    let (effect, _) = *added.iter().find(|(_, members)| all_share(members))?;
    let moves = |effect: EffectKind| effect.description().shifts().is_some();
    let undoes = |own: EffectKind| own == effect || (moves(own) && moves(effect));
    let undone: Vec<Member> = (added.iter())
        .filter(|(own, members)| undoes(*own) && !all_share(members))
        .flat_map(|(_, members)| members.iter().copied())
        .collect();
    let own = |candidate: &Candidate| match candidate.members[..] {
        [member] if member.1.0 == effect && !is_shared(member.1.1) => Some(member),
        _ => None,
    };
    first
        .filter_map(|candidate| Some((candidate.torque_error_taken(), own(candidate)?)))
        .filter(|(_, (limb, place))| {
            let is_undone = |(own, at): &Member| (own, at.1) == (limb, place.1);
            !undone.is_empty() && !undone.iter().any(is_undone)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, member)| member)
}
