//! Which candidate is taken next, and what it cannot be told from.

use proprio_core::effect::{EffectKind, Form};

use super::feasible::{is_feasible, is_unresolved_delay};
use super::presence::{acts_by_weight, is_beyond_chance, is_family, is_there};
use super::statistics::sum_and_error;
use super::step::LEAST_SHARE;
use crate::catalogue;
use crate::select::candidate::{Candidate, Member};

/// An effect whose held-out gain is at least this share of the best one's may be what the best one only resembles.
pub(crate) const RIVAL: f64 = 0.3;
/// A simple effect that gains at least this share of what a richer one gains that contains it is taken for it.
pub(crate) const PART: f64 = 0.95;

/// What a look at the model has shown.
pub(crate) struct Look<'c> {
    /// All candidates.
    pub(crate) all: &'c [Candidate],
    /// How many windows they were judged by.
    pub(crate) windows: f64,
    /// What a candidate adds to the model with another one in it.
    pub(crate) beside: &'c dyn Fn(&Candidate, &Candidate) -> Option<Candidate>,
}

impl Look<'_> {
    /// The candidate to be taken next of those that are `open`: there, feasible, and the one that takes most torque error away.
    ///
    /// Candidates at its joints, and no others, that take away a like share of torque error and whose held-out gains differ by less than the
    /// error of their difference, or by less than ln n for each parameter more, n windows, are equals. Among them counts how much the sum
    /// of squares of all data and of the priors falls, less ln n for each parameter (Schwarz 1978, *Annals of Statistics* 6:461). A simpler
    /// rival that is there even beside the best goes before it: a load on a calf swings with it as its rotor turns. Not so where both act by
    /// weight, or as a scale of the torque does, and the simpler one asks bodies to be farther from the CAD than it saves: an offset of an
    /// encoder is like another inertia of what it turns. Nor do springs and plays between motors and links, whose columns are of hardly any motion and
    /// resemble all that a link does. What a delay too small to be resolved explains better, and all of it, is none.
    pub(crate) fn best<'o>(&self, open: &[&'o Candidate]) -> Option<&'o Candidate> {
        let late: Vec<&Candidate> = (self.all.iter())
            .filter(|c| is_unresolved_delay(c))
            .collect();
        let good: Vec<&Candidate> = (open.iter().copied())
            .filter(|c| is_there(c) && is_feasible(c))
            .filter(|c| c.members.len() == 1 || c.is_shared() || is_family(c, self.all))
            .filter(|c| !late.iter().any(|late| self.is_only(c, late)))
            .collect();
        let first = *(good.iter())
            .max_by(|a, b| a.torque_error_taken().total_cmp(&b.torque_error_taken()))?;
        let each = self.windows.ln();
        let is_equal = |c: &&&Candidate| {
            let differences: Vec<f64> = first
                .gains
                .iter()
                .zip(&c.gains)
                .map(|(a, b)| a - b)
                .collect();
            let (difference, error) = sum_and_error(&differences);
            let more = (first.parameters() - c.parameters()).max(0.0);
            c.is_within(first)
                && c.torque_error_taken() >= RIVAL * first.torque_error_taken()
                && difference <= error.max(more * each)
        };
        let worth = |c: &Candidate| c.fall - c.parameters() * each;
        let equals = good.iter().filter(is_equal);
        let best = *equals.max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
        if let Some(plain) = part_of(best, &good) {
            return Some(plain);
        }
        let simpler = good.iter().copied().filter(|c| {
            // Every drive has a plain effect: it needs no rival to be there.
            !best.effect.description().is_plain()
                && c.parameters() < best.parameters()
                && c.effect != best.effect
                && c.meets(best)
                && !c.effect.description().is_compliant()
                && c.gain().0 >= RIVAL * best.gain().0
                && !(looks_like_weight(c, best) && worth(c) < worth(best))
        });
        let mut simpler: Vec<&Candidate> = simpler.collect();
        simpler.sort_by(|a, b| b.gain().0.total_cmp(&a.gain().0));
        let there = simpler
            .into_iter()
            .find(|c| (self.beside)(c, best).is_some_and(|c| is_beyond_chance(&c)));
        Some(there.unwrap_or(best))
    }

    /// Whether a candidate is no more than another one resembles: nothing beside that.
    fn is_only(&self, candidate: &Candidate, other: &Candidate) -> bool {
        candidate.meets(other)
            && candidate.gain().0 < other.gain().0
            && (self.beside)(candidate, other).is_none_or(|left| !is_there(&left))
    }

    /// What the best candidate cannot be told from: rivals beside which it adds nothing beyond chance.
    pub(crate) fn alternatives(&self, best: &Candidate) -> Vec<(EffectKind, Vec<Member>)> {
        let (most, _) = best.gain();
        let same_limbs = |c: &Candidate| {
            let limbs = |c: &Candidate| c.trials.iter().map(|(limb, _)| *limb).collect::<Vec<_>>();
            limbs(c) == limbs(best)
                && (c.members.len() == best.members.len() || c.is_shared() || best.is_shared())
        };
        let rivals = (self.all.iter()).filter(|c| {
            !c.is_same(best) && same_limbs(c) && c.gain().0 >= RIVAL * most && is_feasible(c)
        });
        let explains = |rival: &&Candidate| {
            (self.beside)(best, rival).is_none_or(|left| !is_beyond_chance(&left))
        };
        let mut found: Vec<_> = rivals
            .filter(explains)
            .map(|c| (c.effect, c.members.clone()))
            .collect();
        // Beside its other parts, which a drive may have, the last part of a sum is the sum: friction that differs with the direction is a
        // constant torque beside Coulomb friction.
        let is_last =
            |effect: &EffectKind| effect.description().sum_of.last() == Some(&best.effect);
        let sums = catalogue::effects().filter(is_last);
        found.extend(sums.map(|sum| (sum, instead(&best.members, sum))));
        found
    }
}

/// Whether an effect looks like one that acts by weight to all but what is known of the bodies: a torque of a wrong scale does, too.
fn looks_like_weight(effect: &Candidate, weight: &Candidate) -> bool {
    acts_by_weight(weight.effect)
        && (acts_by_weight(effect.effect) || effect.effect.description().form == Form::Scale)
}

/// The simple effect that a richer one contains, where it does as well.
fn part_of<'c>(rich: &Candidate, good: &[&'c Candidate]) -> Option<&'c Candidate> {
    let own = instead(&rich.members, rich.effect.description().simpler?);
    let plain = *good.iter().find(|c| c.members == own)?;
    let enough = plain.gain().0 >= PART * rich.gain().0;
    enough.then_some(plain)
}

/// An effect at the joints of `members`.
fn instead(members: &[Member], effect: EffectKind) -> Vec<Member> {
    let own = members.iter();
    own.map(|(limb, place)| (*limb, (effect, place.1)))
        .collect()
}

/// Fold by fold, gains that differ by less than this share are the same: what rounding makes.
const ROUNDING: f64 = 1e-9;

/// Whether two candidates are of one column, so that no first order tells which it is: a delay and the lag of a current loop of as many milliseconds.
pub(crate) fn are_one_column(one: &Candidate, other: &Candidate) -> bool {
    let most = one
        .gains
        .iter()
        .fold(0.0f64, |most, gain| most.max(gain.abs()));
    let mut pairs = one.gains.iter().zip(&other.gains);
    one.is_within(other)
        && other.is_within(one)
        && most > 0.0
        && one.gains.len() == other.gains.len()
        && pairs.all(|(a, b)| (a - b).abs() <= ROUNDING * most)
}

/// Whether a spring or a play may be what a candidate resembles that takes a sure part of a joint's error; of one that no fit `keeps` it is
/// not, and springs are expensive to try.
pub(crate) fn may_be_transmission(candidate: &Candidate, keeps: bool) -> bool {
    keeps
        && super::presence::is_sure_of_one_joint(candidate)
        && !candidate.effect.description().is_plain()
}

/// Share of the error of all joints that a candidate between motor and link has to take away beyond what the `best` does: one that its column
/// does not show has to do so by what a step is worth, and one soft joint looks like several to a column.
pub(crate) fn handicap(candidate: &Candidate, best: &Candidate) -> f64 {
    let shown = candidate.is_same(best) || is_there(candidate) && is_feasible(candidate);
    let more = (candidate.members.len() - 1) as f64 + if shown { 0.0 } else { 1.0 };
    LEAST_SHARE * more
}
