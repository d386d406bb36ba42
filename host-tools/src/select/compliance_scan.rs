//! What no column tells is found by trying: of what lies between motor and link, a soft spring or a wide play, a column says little, and other effects
//! look like them to first order.

use super::accept::Context;
use super::candidate::{Candidate, Finding, Trial};
use super::criteria::choice::{handicap, may_be_transmission};
use super::criteria::presence::is_worth_trying;
use super::criteria::step::{LEAST_SHARE, is_held, is_less, is_structure, may_take_away};
use super::fitted::Fitted;
use super::refused::Refused;
use super::score_test::Screen;
use super::source::Tried;
use super::state::State;

/// Springs and plays that are tried where no column shows one: a fit with each predicts a limb some thirty times.
const MOST_TRIED: usize = 2;

/// A candidate that takes a sure part of a joint's error, and the model with it; or a spring or a play there with which the model
/// predicts better. With the springs and plays that were found to be none.
///
/// The `first` look tells what the best one would be, taken or not.
pub(super) fn best_by_trying<'c, 'a>(
    context: &Context<'_, 'a>,
    refused: &Refused<State<'a>>,
    best: &'c Candidate,
    all: &'c [Candidate],
    is_first: bool,
) -> (Tried<'c, State<'a>>, Vec<&'c Candidate>) {
    let now = context.now();
    let may_be_worth = |c: &Candidate, share: f64| may_be_worth(context.screens, c, share, now);
    let weighted = |after: &State| after.weighted(context.model);
    let is_tried = is_first || may_be_worth(best, LEAST_SHARE);
    let first = (best, is_tried.then(|| context.with(best)).flatten());
    let is_loose = best.effect.description().is_compliant();
    // What a joint's own columns show and no fit keeps is no spring either.
    let keeps = (first.1.as_ref()).is_some_and(|after| is_less(weighted(after), now));
    if !is_loose && !may_be_transmission(best, keeps) {
        return (first, Vec::new());
    }
    let error = |(c, after): &Tried<State>| {
        let error = after.as_ref().map_or(f64::INFINITY, weighted);
        error + handicap(c, best) * now
    };
    // What several promise together may be of one, which alone, the others rigid, promises less: its column is believed.
    let one_of_several = is_loose && is_tried && best.members.len() > 1;
    let gained = 1.0 - error(&first) / now;
    let (mut kept, mut useless) = (Vec::new(), Vec::new());
    for c in transmission_at(context, refused, best, all) {
        if !one_of_several && !may_be_worth(c, LEAST_SHARE + handicap(c, best)) {
            useless.push(c);
            continue;
        }
        // One that the first leaves behind need not be known.
        if !one_of_several && !may_be_worth(c, gained + handicap(c, best)) {
            continue;
        }
        // One that is found to be nothing need not be judged.
        let is_something = |after: &State| is_held(after.size(&c.members[0]));
        let tried = (c, context.with_worthwhile(c, &is_something));
        if is_less(error(&tried), now) {
            kept.push(tried);
        } else {
            useless.push(c);
        }
    }
    let told = (kept.into_iter().chain([first]))
        .min_by(|a, b| error(a).total_cmp(&error(b)))
        .unwrap_or((best, None));
    (told, useless)
}

/// Springs and plays at the joint of a candidate; of several joints at the one where most is gained. Where one may be there also those at
/// other joints of the limb that promise most: what a soft link does, the columns of its neighbours show too.
fn transmission_at<'c, 'a>(
    context: &Context<'_, 'a>,
    refused: &Refused<State<'a>>,
    best: &Candidate,
    all: &'c [Candidate],
) -> Vec<&'c Candidate> {
    let is_one = |c: &&Candidate| {
        c.members.len() == 1
            && c.effect.description().is_compliant()
            && !c.is_same(best)
            && !refused.has(c, context.model)
    };
    let (mut found, elsewhere): (Vec<&Candidate>, Vec<&Candidate>) =
        all.iter().filter(is_one).partition(|c| c.is_within(best));
    if best.members.len() > 1 {
        found.retain(|c| c.effect == best.effect);
        found.sort_by(|a, b| b.gain().0.total_cmp(&a.gain().0));
        found.truncate(1);
        return found;
    }
    let may_be = |c: &&Candidate| may_be_worth(context.screens, c, LEAST_SHARE, context.now());
    if best.effect.description().is_compliant() || found.iter().any(may_be) {
        let of_limb = (elsewhere.into_iter()).filter(|c| c.members[0].0 == best.members[0].0);
        let promise = of_limb.filter_map(|c| Some((c, most(context.screens, c)?)));
        let mut promise: Vec<(&Candidate, f64)> = promise.collect();
        promise.sort_by(|a, b| b.1.total_cmp(&a.1));
        found.extend(promise.into_iter().take(MOST_TRIED).map(|(c, _)| c));
    }
    found
}

/// A spring or a play where no column shows anything that helps, and the model with it; and whether it takes away a share of its joint's
/// error that no sampling makes.
///
/// The joint with the largest error need not be the soft one: what its link does, those that carry it feel. So those are tried that
/// promise most, at whichever joint.
pub(super) fn most_promising_transmission<'c, 'a>(
    context: &Context<'_, 'a>,
    refused: &Refused<State<'a>>,
    all: &'c [Candidate],
) -> Option<(&'c Candidate, State<'a>, bool)> {
    let (model, now) = (context.model, context.now());
    // What is left of the joint where it would be, (N m)², and what it promises; none where it is not worth a trial.
    let worth = |c: &Candidate| -> Option<(f64, f64)> {
        let [(limb, (_, joint))] = c.members[..] else {
            return None;
        };
        let data = &context.data[limb];
        let torque = data.squares(&vec![0.0; data.torque.len()]).by_joint()[joint];
        let left = model.squares[limb].by_joint()[joint];
        let promise = most(context.screens, c);
        is_worth_trying(left, torque, promise, now).then_some((left, promise.unwrap_or(now)))
    };
    let is_open = |c: &&Candidate| c.effect.description().is_compliant() && !refused.has(c, model);
    let mut open: Vec<(&Candidate, f64, f64)> = (all.iter().filter(is_open))
        .filter_map(|c| worth(c).map(|(left, promise)| (c, left, promise)))
        .filter(|(_, _, promise)| may_take_away(*promise, LEAST_SHARE, now))
        .collect();
    open.sort_by(|a, b| b.2.total_cmp(&a.2));
    open.truncate(MOST_TRIED);
    let tried = open.into_iter();
    let tried = tried.filter_map(|(c, left, _)| Some((c, left, context.with(c)?)));
    let (candidate, left, after) = tried.min_by(|a, b| {
        let error = |after: &State| after.weighted(model);
        error(&a.2).total_cmp(&error(&b.2))
    })?;
    let fall = State::total(&model.squares) - State::total(&after.squares);
    let is_sure = is_structure(fall, left);
    Some((candidate, after, is_sure))
}

/// Whether a candidate may take away this share of the error `now` of all joints; where that cannot be told, it may.
fn may_be_worth(screens: &[Screen], candidate: &Candidate, share: f64, now: f64) -> bool {
    if !candidate.effect.description().is_compliant() {
        return true;
    }
    most(screens, candidate).is_none_or(|most| may_take_away(most, share, now))
}

/// How much of the error a candidate between motor and link takes away at most; `None` where that cannot be told.
fn most(screens: &[Screen], candidate: &Candidate) -> Option<f64> {
    let of = |(limb, trial): &(usize, Trial)| {
        let screen = &screens[*limb];
        if let [place] = trial.places[..]
            && candidate.members.len() == 1
        {
            return Some(screen.most_of_one(place)?.0);
        }
        let size = |told: &Finding| Some(told.parameters[0]?.0);
        let sizes: Option<Vec<f64>> = trial.findings.iter().map(size).collect();
        screen.most_of_several(&trial.places, &sizes?)
    };
    candidate.trials.iter().map(of).sum()
}
