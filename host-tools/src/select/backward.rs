//! The way back: what a model does without again.

use super::candidate::Member;
use super::criteria::feasible::is_resolved_shift;
use super::criteria::step::is_held;
use super::fitted::{Fitted, Step};

/// What steps have added and has become nothing beside the others, the smallest first. What makes a `drive` stays where it was missing.
pub(super) fn nothing<M: Fitted>(model: &M, steps: &[Step<M>], drive: bool) -> Vec<Member> {
    let added = steps.iter().flat_map(|step| step.members.clone());
    let mut small: Vec<(f64, Member)> = added
        .filter(|(_, place)| !(drive && place.0.description().is_plain()))
        // What is asked for beyond a limit is anything: how much of it on average may be nothing.
        .filter(|(_, place)| !place.0.description().is_limit())
        .map(|member| (model.size(&member), member))
        .filter(|(size, _)| !is_held(*size))
        .collect();
    small.sort_by(|a, b| a.0.total_cmp(&b.0));
    small.into_iter().map(|(_, member)| member).collect()
}

/// What steps have added beyond a drive's own effects and limits, the last first.
pub(super) fn beyond_drives<M: Fitted>(steps: &[Step<M>]) -> Vec<Member> {
    let own = |step: &&Step<M>| {
        let description = step.effect.description();
        !step.removed && !description.is_plain() && !description.is_limit()
    };
    let added = steps.iter().filter(own).rev();
    added.flat_map(|step| step.members.clone()).collect()
}

/// What steps have added and has become a shift in time that samples of this `period` (s) do not show: as a candidate it would not be taken.
pub(super) fn unresolved<M: Fitted>(model: &M, steps: &[Step<M>], period: f64) -> Vec<Member> {
    let is_resolved = |member: &Member| {
        let first = model.parameters(member).first().copied();
        first.is_none_or(|(time, _)| is_resolved_shift(member.1.0, time, period))
    };
    let added = steps.iter().flat_map(|step| step.members.clone());
    added
        .filter(|member| model.has(member) && !is_resolved(member))
        .collect()
}

/// What was taken at a joint before another effect there, or before a link of its limb was let go: it may only have resembled that. A link that
/// swings against its motor shakes all joints of its limb.
pub(super) fn superseded<M: Fitted>(steps: &[Step<M>]) -> Vec<Member> {
    let own = |step: &Step<M>| match step.members[..] {
        [member] if !step.removed && !step.effect.description().is_plain() => Some(member),
        _ => None,
    };
    let is_superseded = |(n, member): &(usize, Member)| {
        (steps[n + 1..].iter())
            .filter_map(own)
            .filter(|later| later.0 == member.0)
            .any(|(_, (effect, joint))| joint == member.1.1 || effect.description().is_compliant())
    };
    let members = steps.iter().enumerate();
    members
        .filter_map(|(n, step)| Some((n, own(step)?)))
        .filter(is_superseded)
        .map(|(_, member)| member)
        .filter(|(_, place)| !place.0.description().is_limit())
        .collect()
}
