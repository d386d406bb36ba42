//! Whether a model that was fitted is worth a step: judged by what it predicts of data that it has not seen.

use super::presence::{LEAST_EFFECT, STRUCTURE};

/// Most steps of a search.
const MOST_STEPS: usize = 40;
/// Most candidates that are refused one after the other before a search ends.
const MOST_REFUSED: usize = 12;
/// Smallest share of the held-out error of all joints that a step takes away: below, what one log asks for is as likely to be worse on
/// the next.
pub(crate) const LEAST_SHARE: f64 = 0.01;
/// A value within so many of its standard deviations of nothing is not kept.
pub(crate) const LEAST_VALUE: f64 = 2.0;
/// Held-out error may rise by this share without being worse: a comparison shows four digits, which stay the same.
pub(crate) const SAME: f64 = 1.001;
/// A fit all but never takes away so many times what columns promise: the half of it is asked for.
const MARGIN: f64 = 2.0;
/// A candidate that was refused and promises no more than so many times what it did then would be refused again: it is an eighth more of
/// its standard deviations. A trial costs as much as a look at all candidates of a limb.
const PROMISES_MORE: f64 = 1.25;

/// Squares of a joint above so many times its noise are of something that the model lacks: three quarters of them.
const FAR_FROM_NOISE: f64 = 4.0;
/// An effect that is there explains this share of what a joint's squares have above the noise; one that explains less where much is left
/// takes a part of something else. Of logs with a cause outside the catalogue (studies/pinocchio/outside.py) most such effects take 0.1 to 0.5.
pub(crate) const LEAST_PART: f64 = 0.5;

/// What is said of a log, or taken by an effect, is made by noise of the motion where that alone makes so much of it. Where a cause makes it, a complete
/// model has nothing of it. Where noise does, noise that is added to the log's own is told half as well as that, for what is regressed on has both; a
/// draw of it, to a third and better.
const MOST_BY_NOISE: f64 = 1.0 / 3.0;

/// An effect takes less than this share of all that it takes, in units of the noise, at joints that others depend on.
const A_LITTLE: f64 = 0.1;

/// Fewer folds have no majority.
const LEAST_FOLDS: usize = 4;

/// How a model predicts what it has not seen: sums of squares over all limbs.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HeldOut {
    /// In units of the joints' noise, of whatever model it is compared with.
    pub(crate) weighted: f64,
    /// Each log's if each is held out as a whole, else one of all, (N m)².
    pub(crate) by_log: Vec<f64>,
    /// Whether each log is held out as a whole.
    pub(crate) is_by_log: bool,
}

/// Whether a search goes on that has taken so many `steps`, and has `refused` so many candidates since the last.
pub(crate) fn goes_on(steps: usize, refused: usize) -> bool {
    steps < MOST_STEPS && refused < MOST_REFUSED
}

/// Whether what columns `promise` of the error `now` is enough for a fit to take away this share of it.
pub(crate) fn may_take_away(promise: f64, share: f64, now: f64) -> bool {
    MARGIN * promise >= share * now
}

/// Whether a candidate that was `refused` when it promised so much would be refused again.
pub(crate) fn promises_no_more(promise: f64, refused: f64) -> bool {
    promise <= PROMISES_MORE * refused
}

/// Whether an error is less than the one `before` by what a step is worth.
pub(crate) fn is_less(after: f64, before: f64) -> bool {
    after < (1.0 - LEAST_SHARE) * before
}

/// Whether a model predicts better than the one `before` it, and no log worse: what one log asks for and another does not bear is the log's.
pub(crate) fn is_better(after: &HeldOut, before: &HeldOut) -> bool {
    after.weighted < before.weighted && no_log_rises(after, before, SAME)
}

/// Whether a model takes away what a step is worth, and makes no log worse.
pub(crate) fn is_worth_a_step(after: &HeldOut, before: &HeldOut) -> bool {
    is_less(after.weighted, before.weighted) && is_better(after, before)
}

/// Whether more than half of an effect's members have values that are not nothing: of a family some joints may have little of it.
pub(crate) fn are_most(held: usize, members: usize) -> bool {
    2 * held > members
}

/// Whether a size, in its standard deviations, is more than nothing.
pub(crate) fn is_held(size: f64) -> bool {
    size >= LEAST_VALUE
}

/// Why an effect may leave a model again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Leaves {
    /// Its value has become nothing.
    Nothing,
    /// It resembles what came after it.
    Resembles,
    /// A candidate with this value would not be taken, whatever it promised.
    Infeasible,
}

/// Whether a model does without what was taken out of it for this reason.
pub(crate) fn does_without(without: &HeldOut, before: &HeldOut, why: Leaves) -> bool {
    let most = match why {
        Leaves::Nothing => SAME,
        // It took its share of the error, which the other may not give back to the last digit.
        Leaves::Resembles => 1.0 + LEAST_SHARE,
        Leaves::Infeasible => return true,
    };
    no_log_rises(without, before, most) && without.weighted <= most * before.weighted
}

/// Whether a joint's squares are far above its noise.
pub(crate) fn is_far_from_noise(left: f64, noise: f64) -> bool {
    left > FAR_FROM_NOISE * noise
}

/// Whether an effect takes a part of something else, by joints' squares without it, with it, and of their noise: much is left, more than the effect
/// has taken, at every joint at which it takes more than a little.
pub(crate) fn is_stand_in(joints: &[(f64, f64, f64)]) -> bool {
    let takes = |(without, with, noise): &(f64, f64, f64)| ((without - with) / noise).max(0.0);
    let all: f64 = joints.iter().map(takes).sum();
    let mut own = joints.iter().filter(|joint| takes(joint) > A_LITTLE * all);
    own.all(|(without, with, noise)| {
        is_far_from_noise(*with, *noise) && !explains_most(*without, *with, *noise)
    })
}

/// Whether a step takes what it is worth of most folds, by each one's error before and after, and not of what one or two of them ask for; of too few
/// nothing is asked.
pub(crate) fn is_of_most_folds(folds: &[(f64, f64)]) -> bool {
    let gain = folds
        .iter()
        .filter(|(before, after)| is_less(*after, *before));
    folds.len() < LEAST_FOLDS || are_most(gain.count(), folds.len())
}

/// Whether noise of the motion makes what something `takes`, where that alone has it take `by_noise`.
pub(crate) fn is_by_noise(by_noise: f64, takes: f64) -> bool {
    by_noise >= MOST_BY_NOISE * takes
}

/// Whether what has brought squares from `without` to `with` explains most of what they had above their `noise`.
pub(crate) fn explains_most(without: f64, with: f64, noise: f64) -> bool {
    without - with >= LEAST_PART * (without - noise)
}

/// Whether a model may have what every drive has, though this log may not tell it: it predicts no worse with it. Of one log, whose folds are
/// alike, a rise of less than a step's share is chance.
pub(crate) fn bears_a_drive(after: &HeldOut, before: &HeldOut) -> bool {
    let most = if after.is_by_log {
        SAME
    } else {
        1.0 + LEAST_SHARE
    };
    no_log_rises(after, before, most)
}

/// Whether a model of one cause predicts as well as one of two (errors in units of the joints' noise): then it is the better one.
pub(crate) fn does_as_well(one: f64, two: f64) -> bool {
    one <= SAME * two
}

/// Whether a joint's frame that is elsewhere is the cause instead of so many effects (errors in units of the joints' noise): one cause before two, and
/// of one effect, which may be the same by another name, where it predicts better by what a step is worth.
pub(crate) fn is_frame(frame: f64, effects: f64, count: usize) -> bool {
    match count {
        0 | 1 => is_less(frame, effects),
        _ => does_as_well(frame, effects),
    }
}

/// Whether a search that begins with every drive's effects is to go on where another has ended: a search finds by small steps what is better
/// yet. `torque` is the sum of squares of all that was measured, (N m)².
pub(crate) fn begins_below(begin: f64, end: f64, torque: f64) -> bool {
    let less = end - begin;
    less >= LEAST_SHARE * end && less >= LEAST_EFFECT.powi(2) * torque
}

/// Whether a fall of all joints' error takes away so much of a joint's that no sampling makes it.
pub(crate) fn is_structure(fall: f64, error: f64) -> bool {
    fall >= STRUCTURE * error
}

fn no_log_rises(after: &HeldOut, before: &HeldOut, most: f64) -> bool {
    let mut logs = after.by_log.iter().zip(&before.by_log);
    logs.all(|(after, before)| *after <= most * before)
}
