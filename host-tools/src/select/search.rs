//! From a model as it is given to one that lacks nothing the data can tell: forward and backward selection over all limbs.
//!
//! A step is judged on the user's path: the model with it is fitted to all folds but one, by the estimator that writes model files,
//! and predicts that one by the predictor that scores them. A step stays if the held-out error falls, no log's rises, and its values
//! are physical and not nothing.
//!
//! The four plain effects of every drive (viscous, coulomb, armature, bias at all joints) are always among the answers: a search that
//! ends above them starts again from them.

use std::sync::{Arc, Weak};

use proprio_core::effect::EffectKind;

use super::candidate::{self, Candidate, Member};
use super::criteria;
use super::drift::{Drift, drifts};
use super::ranking::{Judged, PLAIN, best, judge, judged};
use super::screen::{self, Screen};
use super::state::State;
use crate::equation::values::Place;
use crate::estimate::fit::LimbFit;
use crate::estimate::limb_data::{LimbData, Squares};
use crate::estimate::robot::side_by_side;

/// Most steps of a search.
const MOST_STEPS: usize = 40;
/// Most candidates that are refused one after the other before a search ends.
const MOST_REFUSED: usize = 12;

/// One step of a search.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(crate) effect: EffectKind,
    pub(crate) members: Vec<Member>,
    /// Held-out sums of squares after it, limb by limb.
    pub(crate) squares: Vec<Squares>,
    pub(crate) removed: bool,
}

/// A candidate, and the model with it if one could be fitted.
type Tried<'c, 'a> = (&'c Candidate, Option<State<'a>>);

/// What a search has found.
pub(crate) struct Found<'a> {
    /// What each candidate would add to the model as it was given: the best first, if one is there.
    pub(crate) first: Vec<Judged>,
    /// Held-out sums of squares of the model as it was given, limb by limb.
    pub(crate) start: Vec<Squares>,
    pub(crate) steps: Vec<Step>,
    /// The model at the end.
    pub(crate) end: State<'a>,
    /// What the catalogue might still take away at the end, its values impossible.
    pub(crate) unphysical: Vec<Judged>,
    /// What the model at the end and the whole catalogue leave of each limb's joints, N m.
    pub(crate) floor: Vec<Vec<f64>>,
    /// What each limb's parameters do from fold to fold.
    pub(crate) drifts: Vec<Vec<Drift>>,
}

/// Searches from the limbs' effects `given`.
pub(crate) fn search<'a>(data: &'a [LimbData<'a>], given: &[Vec<Place>]) -> Option<Found<'a>> {
    let start = State::of(data, given)?;
    let mut search = Search::new(data, given, start);
    search.limits();
    search.forward();
    if search.limits() {
        search.forward();
    }
    search.backward();
    if let Some(other) = search.with_plain() {
        search = other;
    }
    if let Some(other) = search.with_one_cause() {
        search = other;
    }
    search.finish()
}

/// A search on its way.
pub(super) struct Search<'a> {
    pub(super) data: &'a [LimbData<'a>],
    pub(super) given: Vec<Vec<Place>>,
    pub(super) start: Vec<Squares>,
    pub(super) state: State<'a>,
    pub(super) steps: Vec<Step>,
    pub(super) first: Vec<Judged>,
    /// Of each limb what its model may lack, and what that would add: made anew when the limb's fit is another.
    pub(super) screens: Vec<Screen<'a>>,
    possible: Vec<Vec<Place>>,
    /// What was tried beside which fits of its limbs, and not taken.
    refused: Vec<Refused<'a>>,
    /// Fits of which it is known what limits they tell.
    pub(super) limits_sought: Vec<Weak<LimbFit<'a>>>,
}

/// A candidate that was refused and promises no more than so many times what it did then would be refused again: it is an eighth more of
/// its standard deviations. A trial costs as much as a look at all candidates of a limb.
const PROMISES_MORE: f64 = 1.25;

/// A candidate that was not taken, what it promised, and the fits of its limbs that it was tried beside, which are told apart and not kept:
/// each has its data as triangles.
struct Refused<'a> {
    effect: EffectKind,
    members: Vec<Member>,
    /// In units of the joints' noise.
    promise: f64,
    beside: Vec<Weak<LimbFit<'a>>>,
}

impl<'a> Search<'a> {
    pub(super) fn new(data: &'a [LimbData<'a>], given: &[Vec<Place>], state: State<'a>) -> Self {
        Self {
            data,
            given: given.to_vec(),
            start: state.squares.clone(),
            state,
            steps: Vec::new(),
            first: Vec::new(),
            screens: Vec::new(),
            possible: Vec::new(),
            refused: Vec::new(),
            limits_sought: Vec::new(),
        }
    }

    /// The fits of a candidate's limbs.
    fn beside(&self, candidate: &Candidate) -> Vec<Weak<LimbFit<'a>>> {
        let limbs = candidate.trials.iter();
        limbs
            .map(|(limb, _)| Arc::downgrade(&self.state.fits[*limb]))
            .collect()
    }

    /// Whether a candidate was refused beside the same fits of its limbs: it would be again.
    pub(super) fn was_refused(&self, candidate: &Candidate) -> bool {
        let beside = self.beside(candidate);
        let same = |a: &[Weak<LimbFit>]| {
            a.len() == beside.len() && a.iter().zip(&beside).all(|(a, b)| Weak::ptr_eq(a, b))
        };
        (self.refused.iter()).any(|refused| {
            refused.effect == candidate.effect
                && refused.members == candidate.members
                && same(&refused.beside)
        })
    }

    /// Whether a candidate was refused when it promised about as much: it would be again.
    fn promises_no_more(&self, candidate: &Candidate) -> bool {
        (self.refused.iter()).any(|refused| {
            refused.effect == candidate.effect
                && refused.members == candidate.members
                && candidate.gain().0 <= PROMISES_MORE * refused.promise
        })
    }

    pub(super) fn refuse(&mut self, candidate: &Candidate) {
        self.refused.push(Refused {
            effect: candidate.effect,
            members: candidate.members.clone(),
            promise: candidate.gain().0,
            beside: self.beside(candidate),
        });
    }

    /// Whether what a candidate promises is worth a fit: a step takes away a share of the error of all joints, and the fit all but
    /// never takes away twice of what the columns promise.
    fn is_worth_trying(&self, candidate: &Candidate) -> bool {
        let base: f64 = self.screens.iter().map(Screen::error).sum();
        candidate.gain().0 > 0.5 * criteria::LEAST_SHARE * base
    }

    /// Looks at all candidates beside the present model.
    pub(super) fn look(&mut self) -> Vec<Candidate> {
        let limbs: Vec<usize> = (0..self.data.len()).collect();
        let old: Vec<Option<Screen>> = std::mem::take(&mut self.screens)
            .into_iter()
            .map(Some)
            .collect();
        let known = |n: usize| {
            let screen = old.get(n).and_then(Option::as_ref);
            screen.is_some_and(|screen| Arc::ptr_eq(&screen.fit, &self.state.fits[n]))
        };
        let made = side_by_side(&limbs, |&n| {
            (!known(n)).then(|| {
                let fit = self.state.fits[n].clone();
                let predicted = fit.predicted();
                let possible = screen::possible(&fit, &self.given[n]);
                let screen = Screen::of(fit, predicted, &possible);
                let screen = screen.after(old.get(n).and_then(Option::as_ref));
                (screen, possible)
            })
        });
        let mut possible = std::mem::take(&mut self.possible);
        possible.resize(limbs.len(), Vec::new());
        let mut old = old;
        old.resize_with(limbs.len(), || None);
        for (n, made) in made.into_iter().enumerate() {
            let screen = match made {
                Some((screen, places)) => {
                    possible[n] = places;
                    Some(screen)
                }
                None => old[n].take(),
            };
            self.screens.extend(screen);
        }
        self.possible = possible;
        candidate::candidates(&self.screens, &self.possible)
    }

    /// Takes effect after effect into the model while one is there and helps.
    pub(super) fn forward(&mut self) {
        while self.steps.len() < MOST_STEPS {
            let candidates = self.look();
            let mut open: Vec<&Candidate> = (candidates.iter())
                .filter(|c| self.is_worth_trying(c) && !self.was_refused(c))
                .collect();
            let mut known = match self.first.is_empty() {
                true => self.look_first(&candidates),
                false => None,
            };
            let mut taken = false;
            for _ in 0..MOST_REFUSED {
                let Some(mut next) = best(&self.screens, &open, &candidates) else {
                    break;
                };
                if !self.promises_no_more(next) {
                    let after;
                    (next, after) = match known.take() {
                        Some((of, tried)) if std::ptr::eq(of, next) => tried,
                        _ => self.best_by_trying(next, &candidates),
                    };
                    taken = after.is_some_and(|after| self.take(next, after));
                    if taken {
                        break;
                    }
                    self.refuse(next);
                }
                open.retain(|c| !(c.effect == next.effect && c.members == next.members));
            }
            if !taken && !self.take_looseness(&candidates) {
                break;
            }
            if self.lacks_a_drive() {
                self.complete_drive();
            }
        }
    }

    /// Judges what each candidate would add to the model as it was given: the best of them by trying it, which is returned with what was
    /// told of it.
    fn look_first<'c>(
        &mut self,
        candidates: &'c [Candidate],
    ) -> Option<(&'c Candidate, Tried<'c, 'a>)> {
        let all: Vec<&Candidate> = candidates.iter().collect();
        let Some(best) = best(&self.screens, &all, candidates) else {
            self.first = judge(&self.screens, candidates, None);
            return None;
        };
        let (told, after) = self.best_by_trying(best, candidates);
        self.first = judge(&self.screens, candidates, Some(told));
        if let Some(after) = &after {
            self.tell_first(told, after, !std::ptr::eq(told, best));
        }
        Some((best, (told, after)))
    }

    pub(super) fn push(&mut self, members: &[Member], removed: bool) {
        self.steps.push(Step {
            effect: members[0].1.0,
            members: members.to_vec(),
            squares: self.state.squares.clone(),
            removed,
        });
    }

    /// Of each plain effect the joints that do not have it.
    pub(super) fn plain_that_lack(&self) -> Vec<Vec<Member>> {
        let there = self.state.places();
        let all = |effect: EffectKind| -> Vec<Member> {
            (self.data.iter().enumerate())
                .flat_map(|(limb, data)| (0..data.joints()).map(move |j| (limb, (effect, j))))
                .filter(|(limb, place)| !there[*limb].contains(place))
                .collect()
        };
        let lacking = PLAIN.map(all).into_iter();
        lacking.filter(|members| !members.is_empty()).collect()
    }

    /// Whether the model as it was given lacks what makes a drive: two families of the plain effects were found.
    pub(super) fn lacks_a_drive(&self) -> bool {
        let found = |effect: &&EffectKind| {
            (self.steps.iter()).any(|s| s.effect == **effect && s.members.len() > 1 && !s.removed)
        };
        PLAIN.iter().filter(found).count() >= 2
    }

    /// Where two plain effects were missing at many joints, the others are there too and at all joints, whether or not this log moves
    /// fast enough to tell: a model without them fails on one that does.
    fn complete_drive(&mut self) {
        for members in self.plain_that_lack() {
            let mut places = self.state.places();
            for (limb, place) in &members {
                places[*limb].push(*place);
            }
            let new: Vec<Place> = members.iter().map(|(_, place)| *place).collect();
            let start = self.state.values();
            let Some(after) = self.state.with(self.data, &places, &start, &new) else {
                continue;
            };
            let most = if after.is_by_log() {
                criteria::SAME
            } else {
                1.0 + criteria::LEAST_SHARE
            };
            let mut logs = after.by_log().into_iter().zip(self.state.by_log());
            if logs.all(|(after, before)| after <= most * before) {
                self.state = after;
                self.push(&members, false);
            }
        }
    }

    fn finish(mut self) -> Option<Found<'a>> {
        self.keep_headline();
        self.tell_what_is_kept();
        let candidates = self.look();
        let screens = &self.screens;
        let (floor, drifts, unphysical) = {
            let mut unphysical: Vec<Judged> = Vec::new();
            for c in candidates
                .iter()
                .filter(|c| c.members.len() == 1 && c.is_there())
            {
                let known = unphysical.iter().any(|j| j.candidate.meets(c));
                if !known && c.held_out_gain().0 > criteria::STRUCTURE && !c.is_possible(screens) {
                    unphysical.push(judged(screens, c));
                }
            }
            (
                screens.iter().map(|screen| screen.floor.clone()).collect(),
                screens.iter().map(drifts).collect(),
                unphysical,
            )
        };
        Some(Found {
            first: self.first,
            start: self.start,
            steps: self.steps,
            end: self.state,
            unphysical,
            floor,
            drifts,
        })
    }
}
