//! What a diagnosis names first.

use super::candidate::Member;
use super::fitted::{Fitted, Step};
use super::ranking::Judged;

/// What is told of the first candidate is of the fit with it: what a column says of a value is true to first order, and of what was found
/// by trying not even that it is there.
pub(super) fn with_values<M: Fitted>(
    mut first: Vec<Judged>,
    after: &M,
    by_trying: bool,
) -> Vec<Judged> {
    if let Some(first) = first.first_mut() {
        first.parameters = values(&first.candidate.members, after);
        if by_trying {
            (first.significant, first.possible) = (true, true);
        }
    }
    first
}

/// What was judged of the model as it was given, as it is told in the end.
pub(super) fn kept<M: Fitted>(
    first: Vec<Judged>,
    start: &M::Errors,
    steps: &[Step<M>],
    end: &M,
) -> Vec<Judged> {
    with_values_at_end(with_largest_first(first, start, steps, end), end)
}

/// What the model has in the end is told with its value there; but a limit, which the rest of the model does not tell, as it was found.
fn with_values_at_end<M: Fitted>(mut first: Vec<Judged>, end: &M) -> Vec<Judged> {
    let stays = |member: &Member| !member.1.0.description().is_limit() && end.has(member);
    for told in &mut first {
        let members = &told.candidate.members;
        if members.iter().all(stays) {
            told.parameters = values(members, end);
        }
    }
    first
}

/// The headline is what takes most torque error away of what the model has in the end: a candidate that was refused or taken out again
/// only resembled that. Where nothing was taken nothing is named.
fn with_largest_first<M: Fitted>(
    mut first: Vec<Judged>,
    start: &M::Errors,
    steps: &[Step<M>],
    end: &M,
) -> Vec<Judged> {
    let stays = |member: &Member| end.has(member);
    let is_it = |j: &Judged, step: &Step<M>| {
        (j.candidate.effect, &j.candidate.members) == (step.effect, &step.members)
    };
    let before = [start]
        .into_iter()
        .chain(steps.iter().map(|step| &step.errors));
    let kept: Vec<(f64, &Step<M>)> = before
        .zip(steps)
        .filter(|(_, step)| !step.removed && step.members.iter().any(stays))
        .map(|(before, step)| (M::total(before) - M::total(&step.errors), step))
        .collect();
    if kept.is_empty() {
        first.iter_mut().for_each(|j| j.significant = false);
        return first;
    }
    let told = kept.into_iter().filter_map(|(fall, step)| {
        let at = first.iter().position(|j| is_it(j, step))?;
        Some((fall, at))
    });
    let most = told.max_by(|a, b| a.0.total_cmp(&b.0));
    let (Some((_, at)), Some(old)) = (most, first.first()) else {
        return first;
    };
    if at == 0 && old.significant {
        return first;
    }
    let old = old.candidate.clone();
    first[..=at].rotate_right(1);
    let told = &mut first[0];
    (told.significant, told.possible) = (true, true);
    told.parameters = values(&told.candidate.members, end);
    told.alternatives = Vec::new();
    // What was first and did not stay only resembled what did.
    if old.meets(&told.candidate) && !old.members.iter().any(stays) {
        told.alternatives.push((old.effect, old.members));
    }
    first
}

fn values<M: Fitted>(members: &[Member], model: &M) -> Vec<Vec<(f64, f64)>> {
    members
        .iter()
        .map(|member| model.parameters(member))
        .collect()
}
