//! Which candidate is the best, and what it cannot be told from.

use proprio_core::effect::EffectKind;

use super::candidate::{self, Candidate, Member};
use super::criteria;
use super::screen::Screen;
use crate::equation::motion::LOOSE;

/// The effects of every geared drive.
pub(crate) const PLAIN: [EffectKind; 4] = [
    EffectKind::Armature,
    EffectKind::Coulomb,
    EffectKind::Viscous,
    EffectKind::Bias,
];

/// Effects that contain a simpler one, and which.
const PARTS: [(EffectKind, EffectKind); 2] = [
    (EffectKind::AsymmetricCoulomb, EffectKind::Coulomb),
    (EffectKind::Spring, EffectKind::Bias),
];

/// A candidate and the verdict on it.
#[derive(Debug, Clone)]
pub(crate) struct Judged {
    pub(crate) candidate: Candidate,
    pub(crate) significant: bool,
    pub(crate) possible: bool,
    /// Of each member its parameters as the catalogue means them: value and standard deviation.
    pub(crate) parameters: Vec<Vec<(f64, f64)>>,
    /// What it cannot be told from on these data.
    pub(crate) alternatives: Vec<(EffectKind, Vec<Member>)>,
}

pub(super) fn judged(screens: &[Screen], candidate: &Candidate) -> Judged {
    let possible = candidate.is_possible(screens);
    let of = |(limb, place): &Member| {
        let trial = candidate
            .trials
            .iter()
            .find(|(l, _)| l == limb)
            .map(|(_, trial)| trial);
        let parameter = |n: usize| {
            let told = trial.and_then(|trial| screens[*limb].parameter(trial, *place, n));
            // A screen finds a shape and not how surely: until it is fitted no surer than before.
            let unsure = || {
                (
                    screens[*limb].shape(*place),
                    screens[*limb].fit.data.prior(*place, n).1,
                )
            };
            let (value, std) = told.unwrap_or_else(unsure);
            // A column says little of a spring or a play: until it is fitted it is no surer than before either.
            let open = match LOOSE.contains(&place.0) {
                true => screens[*limb].fit.data.prior(*place, n).1,
                false => 0.0,
            };
            (value, std.hypot(open))
        };
        (0..place.0.description().parameters.len())
            .map(parameter)
            .collect()
    };
    Judged {
        significant: possible && candidate.is_there(),
        possible,
        parameters: candidate.members.iter().map(of).collect(),
        alternatives: Vec::new(),
        candidate: candidate.clone(),
    }
}

/// Judges all candidates: the `best` first, then by how much torque error they take away.
pub(super) fn judge(
    screens: &[Screen],
    candidates: &[Candidate],
    best: Option<&Candidate>,
) -> Vec<Judged> {
    let mut all: Vec<Judged> = candidates.iter().map(|c| judged(screens, c)).collect();
    all.sort_by(|a, b| {
        b.candidate
            .torque_error_taken()
            .total_cmp(&a.candidate.torque_error_taken())
    });
    let Some(best) = best else {
        return all;
    };
    if let Some(at) = all
        .iter()
        .position(|j| j.candidate.effect == best.effect && j.candidate.members == best.members)
    {
        all[..=at].rotate_right(1);
        all[0].alternatives = alternatives(screens, best, candidates);
    }
    all
}

/// The candidate to be taken next: there, possible, and the one that takes most torque error away.
///
/// Candidates at its joints, and no others, that take away a like share of torque error and whose held-out gains differ by less than the
/// error of their difference, or by less than ln n for each parameter more, n windows, are equals. Among them counts how much the sum
/// of squares of all data and of the priors falls, less ln n for each parameter (Schwarz 1978, *Annals of Statistics* 6:461). A simpler
/// rival that is there even beside the best goes before it: a load on a calf swings with it as its rotor turns. Not so where both act by
/// weight, or as a scale of the torque does, and the simpler one asks bodies to be farther from the CAD than it saves: an offset of an
/// encoder is like another inertia of what it turns. What a delay too small to be resolved explains better, and all of it, is none.
pub(super) fn best<'c>(
    screens: &[Screen],
    open: &[&'c Candidate],
    all: &[Candidate],
) -> Option<&'c Candidate> {
    let late: Vec<&Candidate> = (all.iter())
        .filter(|c| c.is_unresolved_delay(screens))
        .collect();
    let good: Vec<&Candidate> = (open.iter().copied())
        .filter(|c| c.is_there() && c.is_possible(screens))
        .filter(|c| c.members.len() == 1 || c.is_shared() || candidate::is_family(c, all))
        .filter(|c| !late.iter().any(|late| is_only(screens, c, late)))
        .collect();
    let first =
        *(good.iter()).max_by(|a, b| a.torque_error_taken().total_cmp(&b.torque_error_taken()))?;
    let windows: f64 = screens.iter().flat_map(|s| s.fit.data.windows()).sum();
    let is_equal = |c: &&&Candidate| {
        let differences: Vec<f64> = first
            .gains
            .iter()
            .zip(&c.gains)
            .map(|(a, b)| a - b)
            .collect();
        let (difference, error) = criteria::sum_and_error(&differences);
        let more = (first.parameters() - c.parameters()).max(0.0);
        c.is_within(first)
            && c.torque_error_taken() >= criteria::RIVAL * first.torque_error_taken()
            && difference <= error.max(more * windows.ln())
    };
    let worth = |c: &Candidate| c.fall - c.parameters() * windows.ln();
    let equals = good.iter().filter(is_equal);
    let best = *equals.max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
    if let Some(plain) = part_of(best, &good) {
        return Some(plain);
    }
    let simpler = good.iter().copied().filter(|c| {
        !PLAIN.contains(&best.effect)
            && c.parameters() < best.parameters()
            && c.effect != best.effect
            && c.meets(best)
            && c.gain().0 >= criteria::RIVAL * best.gain().0
            && !(looks_like_weight(c, best) && worth(c) < worth(best))
    });
    let mut simpler: Vec<&Candidate> = simpler.collect();
    simpler.sort_by(|a, b| b.gain().0.total_cmp(&a.gain().0));
    let there = simpler
        .into_iter()
        .find(|c| beside(screens, c, best).is_some_and(|c| c.is_beyond_chance()));
    Some(there.unwrap_or(best))
}

/// Whether an effect looks like one that acts by weight to all but what is known of the bodies: a torque of a wrong scale does, too.
fn looks_like_weight(effect: &Candidate, weight: &Candidate) -> bool {
    candidate::acts_by_weight(weight.effect)
        && (candidate::acts_by_weight(effect.effect) || effect.effect == EffectKind::TorqueGain)
}

/// The simple effect that a richer one contains, where it does as well.
fn part_of<'c>(rich: &Candidate, good: &[&'c Candidate]) -> Option<&'c Candidate> {
    let (_, plain) = PARTS.iter().find(|(effect, _)| *effect == rich.effect)?;
    let own: Vec<Member> = (rich.members.iter())
        .map(|(limb, place)| (*limb, (*plain, place.1)))
        .collect();
    let plain = *good.iter().find(|c| c.members == own)?;
    let enough = plain.gain().0 >= criteria::PART * rich.gain().0;
    enough.then_some(plain)
}

/// Whether a candidate is no more than another one resembles: nothing beside that.
fn is_only(screens: &[Screen], candidate: &Candidate, other: &Candidate) -> bool {
    candidate.meets(other)
        && candidate.gain().0 < other.gain().0
        && beside(screens, candidate, other).is_none_or(|left| !left.is_there())
}

/// What a candidate adds to the model with another one in it.
fn beside(screens: &[Screen], candidate: &Candidate, other: &Candidate) -> Option<Candidate> {
    let trials: Option<Vec<_>> = (candidate.trials.iter())
        .map(|(limb, trial)| {
            let there = other.trials.iter().find(|(l, _)| l == limb);
            let trial = match there {
                None => trial.clone(),
                Some((_, with)) => screens[*limb].trial_beside(&trial.places, &with.places)?,
            };
            Some((*limb, trial))
        })
        .collect();
    Candidate::of(candidate.effect, trials?, candidate.tried)
}

/// What the best candidate cannot be told from: rivals beside which it adds nothing beyond chance.
fn alternatives(
    screens: &[Screen],
    best: &Candidate,
    all: &[Candidate],
) -> Vec<(EffectKind, Vec<Member>)> {
    let (most, _) = best.gain();
    let same_limbs = |c: &Candidate| {
        let limbs = |c: &Candidate| c.trials.iter().map(|(limb, _)| *limb).collect::<Vec<_>>();
        limbs(c) == limbs(best)
            && (c.members.len() == best.members.len() || c.is_shared() || best.is_shared())
    };
    let rivals = all.iter().filter(|c| {
        !(c.effect == best.effect && c.members == best.members)
            && same_limbs(c)
            && c.gain().0 >= criteria::RIVAL * most
            && c.is_possible(screens)
    });
    let explains = |rival: &&Candidate| {
        beside(screens, best, rival).is_none_or(|left| !left.is_beyond_chance())
    };
    let mut found: Vec<_> = rivals
        .filter(explains)
        .map(|c| (c.effect, c.members.clone()))
        .collect();
    if best.effect == EffectKind::Bias {
        // With Coulomb friction in the model, friction that differs with the direction is a bias.
        let of = |(limb, place): &Member| (*limb, (EffectKind::AsymmetricCoulomb, place.1));
        found.push((
            EffectKind::AsymmetricCoulomb,
            best.members.iter().map(of).collect(),
        ));
    }
    found
}
