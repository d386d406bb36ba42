//! From a model as it is given to one that lacks nothing the data can tell: forward and backward selection over all limbs.
//!
//! A step is judged on the user's path: the model with it is fitted to all folds but one, by the estimator that writes model files,
//! and predicts that one by the predictor that scores them. A step stays if the held-out error falls, no log's rises, and its values
//! are physical and not nothing.
//!
//! The four plain effects of every drive (viscous, coulomb, armature, bias at all joints) are always among the answers: a search that
//! ends above them starts again from them.

use std::sync::Arc;

use proprio_core::effect::EffectKind;

use super::candidate::{self, Candidate, Member};
use super::criteria;
use super::drift::{Drift, drifts};
use super::screen::{self, Screen};
use crate::equation::values::{Place, Values};
use crate::estimate::deviation::Deviations;
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::{LimbData, Squares};
use crate::estimate::parameter_estimate::Constraint;
use crate::estimate::robot::{self, Shared, side_by_side};
use crate::estimate::shapes::{Scan, shape_parameter};

/// Most steps of a search.
const MOST_STEPS: usize = 40;
/// Most candidates that are refused one after the other before a search ends.
const MOST_REFUSED: usize = 6;

/// A shape that differs by less than this share makes no difference to a prediction.
const SAME_SHAPE: f64 = 0.05;

/// Effects that contain a simpler one, and which.
const PARTS: [(EffectKind, EffectKind); 2] = [
    (EffectKind::AsymmetricCoulomb, EffectKind::Coulomb),
    (EffectKind::Spring, EffectKind::Bias),
];

/// The effects of every geared drive.
pub(crate) const PLAIN: [EffectKind; 4] = [
    EffectKind::Armature,
    EffectKind::Coulomb,
    EffectKind::Viscous,
    EffectKind::Bias,
];

/// A model of all limbs, and how it predicts what it has not seen.
#[derive(Clone)]
pub(crate) struct State<'a> {
    pub(crate) fits: Vec<Arc<LimbFit<'a>>>,
    pub(crate) shared: Vec<Shared>,
    /// Of each limb.
    pub(crate) squares: Vec<Squares>,
}

/// One step of a search.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(crate) effect: EffectKind,
    pub(crate) members: Vec<Member>,
    /// Held-out sums of squares after it, limb by limb.
    pub(crate) squares: Vec<Squares>,
    pub(crate) removed: bool,
}

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

/// Searches from the limbs' effects `given`.
pub(crate) fn search<'a>(data: &'a [LimbData<'a>], given: &[Vec<Place>]) -> Option<Found<'a>> {
    let start = State::of(data, given)?;
    let mut search = Search::new(data, given, start);
    search.forward();
    search.backward();
    let plain = search.with_plain();
    if let Some(plain) = plain {
        search = plain;
    }
    search.finish()
}

impl<'a> State<'a> {
    /// The model with these effects.
    fn of(data: &'a [LimbData<'a>], places: &[Vec<Place>]) -> Option<Self> {
        let (fits, shared) = robot::fit(data, places, &how());
        if fits.len() < data.len() {
            return None;
        }
        let squares = side_by_side(&fits, held_out)
            .into_iter()
            .collect::<Option<_>>()?;
        Some(Self {
            fits: fits.into_iter().map(Arc::new).collect(),
            shared,
            squares,
        })
    }

    /// The model with other effects, from the values of `start`: limbs whose effects stay are not fitted again.
    fn with(
        &self,
        data: &'a [LimbData<'a>],
        places: &[Vec<Place>],
        start: &[Values],
        new: &[Place],
    ) -> Option<Self> {
        let (fits, shared) = robot::refit(
            data,
            places,
            &how_with(new),
            start,
            &self.fits,
            &self.shared,
        )?;
        let limbs: Vec<usize> = (0..fits.len()).collect();
        let squares = side_by_side(&limbs, |&n| {
            let same = Arc::ptr_eq(&fits[n], &self.fits[n]);
            if same {
                Some(self.squares[n].clone())
            } else {
                held_out(&fits[n])
            }
        });
        Some(Self {
            fits,
            shared,
            squares: squares.into_iter().collect::<Option<_>>()?,
        })
    }

    fn values(&self) -> Vec<Values> {
        self.fits.iter().map(|fit| fit.values.clone()).collect()
    }

    fn places(&self) -> Vec<Vec<Place>> {
        self.fits
            .iter()
            .map(|fit| fit.values.places().collect())
            .collect()
    }

    /// In units of the joints' noise under `noise`'s model.
    fn weighted(&self, noise: &Self) -> f64 {
        let limbs = self.squares.iter().zip(&noise.fits);
        limbs
            .map(|(squares, fit)| squares.weighted(&fit.noise))
            .sum()
    }

    fn total(&self) -> f64 {
        self.squares.iter().map(Squares::total).sum()
    }

    /// Each log's, if each is held out as a whole; else of all.
    fn by_log(&self) -> Vec<f64> {
        if !self.fits.iter().all(|fit| fit.data.blocks.by_log) {
            return vec![self.total()];
        }
        let folds = self
            .squares
            .iter()
            .map(|s| s.cells.len())
            .max()
            .unwrap_or(0);
        let log = |f: usize| {
            self.squares
                .iter()
                .filter_map(|s| s.by_fold().get(f).copied())
                .sum()
        };
        (0..folds).map(log).collect()
    }

    /// Whether this model predicts better than `before`, and no log worse.
    fn is_better_than(&self, before: &Self) -> bool {
        let logs = self.by_log().into_iter().zip(before.by_log());
        self.weighted(before) < before.weighted(before)
            && logs
                .into_iter()
                .all(|(after, before)| after <= criteria::SAME * before)
    }

    /// The largest of an effect's parameters in units of its standard deviation.
    fn size(&self, &(limb, (effect, joint)): &Member) -> f64 {
        let fit = &self.fits[limb];
        if let Some(one) = self
            .shared
            .iter()
            .find(|one| one.effect == effect && joint == crate::model::BASE)
        {
            return (one.value / one.std).abs();
        }
        let deviations = Deviations::of(fit);
        let sizes = fit
            .columns
            .of_effect(effect, joint)
            .into_iter()
            .map(|entry| {
                let neutral =
                    effect.description().parameters[fit.columns.entries[entry].parameter].neutral;
                let [independent, blocks] = deviations.of_parameter(entry);
                (fit.value(entry) - neutral).abs() / independent.max(blocks)
            });
        sizes.fold(0.0, f64::max)
    }
}

/// How a model is fitted while it is judged.
pub(crate) fn how() -> How {
    How {
        constraint: Constraint::Physical,
        hold_bodies: true,
        ..How::default()
    }
}

/// The same where shapes are known but for those of `places`.
fn how_with(places: &[Place]) -> How {
    // A screen has found the others' shapes.
    let searched = places
        .iter()
        .copied()
        .filter(|place| place.0 == EffectKind::Backlash);
    How {
        shapes: Some(searched.collect()),
        passes: Some(3),
        ..how()
    }
}

/// Held-out sums of squares of a limb's fit.
fn held_out(fit: &LimbFit) -> Option<Squares> {
    Some(
        fit.data
            .squares(&fit.data.predicted_by_fold(&fit.held_out()?)),
    )
}

/// The same with the shape of an effect searched within the folds as well, on what the model `before` it leaves.
fn held_out_with_shape(before: &LimbFit, after: &LimbFit, place: Place) -> Option<Squares> {
    let data = after.data;
    let predicted = data.predicted(&before.values, &|_| true);
    let columns = data.columns(&before.values, &before.places, &[place]);
    let n = data.joints();
    let scan = Scan::new(data, &columns, [&before.values; 2], &|w, j| {
        data.torque[w * n + j] - predicted[w * n + j]
    });
    let shape = shape_parameter(place.0);
    let mut values = after.held_out()?;
    for (fold, values) in values.iter_mut().enumerate() {
        let Some(best) = scan.best(place, &|f| f != fold) else {
            continue;
        };
        let known = after.values.get(place, shape);
        if (best - known).abs() <= SAME_SHAPE * known.abs() {
            continue;
        }
        let mut start = after.values.clone();
        start.set(place, shape, best);
        let train = data.without_fold(fold);
        let places: Vec<Place> = start.places().collect();
        let held = places.iter().copied().filter(|p| !after.places.contains(p));
        let how = How {
            start: Some(start.clone()),
            shapes: Some(Vec::new()),
            held: held.collect(),
            ..how()
        };
        *values = LimbFit::of(&train, &places, &how)?.values;
    }
    Some(data.squares(&data.predicted_by_fold(&values)))
}

/// A search on its way.
struct Search<'a> {
    data: &'a [LimbData<'a>],
    given: Vec<Vec<Place>>,
    start: Vec<Squares>,
    state: State<'a>,
    steps: Vec<Step>,
    first: Vec<Judged>,
    /// Of each limb what its model may lack, and what that would add: made anew when the limb's fit is another.
    screens: Vec<Screen<'a>>,
    possible: Vec<Vec<Place>>,
    /// What was tried beside which fits of its limbs, and not taken.
    refused: Vec<Refused<'a>>,
}

/// A candidate that was not taken, and the fits of its limbs that it was tried beside.
struct Refused<'a> {
    effect: EffectKind,
    members: Vec<Member>,
    beside: Vec<Arc<LimbFit<'a>>>,
}

impl<'a> Search<'a> {
    fn new(data: &'a [LimbData<'a>], given: &[Vec<Place>], state: State<'a>) -> Self {
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
        }
    }

    /// The fits of a candidate's limbs.
    fn beside(&self, candidate: &Candidate) -> Vec<Arc<LimbFit<'a>>> {
        let limbs = candidate.trials.iter();
        limbs
            .map(|(limb, _)| self.state.fits[*limb].clone())
            .collect()
    }

    /// Whether a candidate was refused beside the same fits of its limbs: it would be again.
    fn was_refused(&self, candidate: &Candidate) -> bool {
        let beside = self.beside(candidate);
        let same = |a: &[Arc<LimbFit>]| {
            a.len() == beside.len() && a.iter().zip(&beside).all(|(a, b)| Arc::ptr_eq(a, b))
        };
        (self.refused.iter()).any(|refused| {
            refused.effect == candidate.effect
                && refused.members == candidate.members
                && same(&refused.beside)
        })
    }

    /// Whether what a candidate promises is worth a fit: a step takes away a share of the error of all joints, and the fit all but
    /// never takes away twice of what the columns promise.
    fn is_worth_trying(&self, candidate: &Candidate) -> bool {
        let base: f64 = self.screens.iter().map(Screen::error).sum();
        candidate.gain().0 > 0.5 * criteria::LEAST_SHARE * base
    }

    /// Looks at all candidates beside the present model.
    fn look(&mut self) -> Vec<Candidate> {
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
                let possible = screen::possible(&fit, &self.given[n]);
                (Screen::of(fit, &possible), possible)
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
    fn forward(&mut self) {
        while self.steps.len() < MOST_STEPS {
            let candidates = self.look();
            if self.first.is_empty() && self.steps.is_empty() {
                self.first = judge(&self.screens, &candidates);
            }
            let mut open: Vec<&Candidate> = (candidates.iter())
                .filter(|c| self.is_worth_trying(c) && !self.was_refused(c))
                .collect();
            let mut taken = false;
            for _ in 0..MOST_REFUSED {
                let Some(next) = best(&self.screens, &open, &candidates) else {
                    break;
                };
                taken = self.take(next);
                if taken {
                    break;
                }
                self.refused.push(Refused {
                    effect: next.effect,
                    members: next.members.clone(),
                    beside: self.beside(next),
                });
                open.retain(|c| !(c.effect == next.effect && c.members == next.members));
            }
            if !taken {
                break;
            }
        }
    }

    /// Takes an effect into the model if it keeps what it promised.
    fn take(&mut self, candidate: &Candidate) -> bool {
        let members = &candidate.members;
        let mut places = self.state.places();
        for (limb, place) in members {
            places[*limb].push(*place);
        }
        let start = start_with(&self.screens, candidate);
        let new: Vec<Place> = members.iter().map(|(_, place)| *place).collect();
        let Some(mut after) = self.state.with(self.data, &places, &start, &new) else {
            return false;
        };
        if let [(limb, place)] = members[..]
            && place.0.description().shape().is_some()
            && after.is_better_than(&self.state)
        {
            let squares = held_out_with_shape(&self.state.fits[limb], &after.fits[limb], place);
            let Some(squares) = squares else { return false };
            after.squares[limb] = squares;
        }
        let held = members
            .iter()
            .filter(|m| after.size(m) >= criteria::LEAST_VALUE)
            .count();
        let before = self.state.weighted(&self.state);
        let worth = after.weighted(&self.state) < (1.0 - criteria::LEAST_SHARE) * before;
        if !worth || !after.is_better_than(&self.state) || 2 * held <= members.len() {
            return false;
        }
        self.state = after;
        self.push(members, false);
        true
    }

    fn push(&mut self, members: &[Member], removed: bool) {
        self.steps.push(Step {
            effect: members[0].1.0,
            members: members.to_vec(),
            squares: self.state.squares.clone(),
            removed,
        });
    }

    /// Takes out again what has become nothing, or what the others do without.
    fn backward(&mut self) {
        let added: Vec<Member> = self
            .steps
            .iter()
            .flat_map(|step| step.members.clone())
            .collect();
        let mut small: Vec<(f64, Member)> = (added.into_iter())
            .map(|member| (self.state.size(&member), member))
            .filter(|(size, _)| *size < criteria::LEAST_VALUE)
            .collect();
        small.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (_, member) in small {
            let mut places = self.state.places();
            places[member.0].retain(|place| *place != member.1);
            let Some(without) = self
                .state
                .with(self.data, &places, &self.state.values(), &[])
            else {
                continue;
            };
            let logs = without.by_log().into_iter().zip(self.state.by_log());
            let same = logs
                .into_iter()
                .all(|(after, before)| after <= criteria::SAME * before)
                && without.weighted(&self.state)
                    <= criteria::SAME * self.state.weighted(&self.state);
            if same {
                self.state = without;
                self.push(&[member], true);
            }
        }
    }

    /// A search that starts with the four plain effects at all joints, if this one ends above them.
    fn with_plain(&self) -> Option<Self> {
        if self.steps.is_empty() {
            return None;
        }
        let there = self.state.places();
        let all = |effect: EffectKind| -> Vec<Member> {
            (self.data.iter().enumerate())
                .flat_map(|(limb, data)| (0..data.joints()).map(move |j| (limb, (effect, j))))
                .filter(|(limb, place)| !self.given[*limb].contains(place))
                .collect()
        };
        let plain: Vec<Vec<Member>> = PLAIN
            .map(all)
            .into_iter()
            .filter(|m| !m.is_empty())
            .collect();
        if plain
            .iter()
            .flatten()
            .all(|(limb, place)| there[*limb].contains(place))
        {
            return None;
        }
        let start = State::of(self.data, &self.given)?;
        let mut other = Self::new(self.data, &self.given, start);
        other.first.clone_from(&self.first);
        for members in plain {
            let mut places = other.state.places();
            for (limb, place) in &members {
                places[*limb].push(*place);
            }
            other.state = State::of(self.data, &places)?;
            other.push(&members, false);
        }
        if other.state.total() > (1.0 - criteria::LEAST_SHARE) * self.state.total() {
            return None;
        }
        other.forward();
        other.backward();
        Some(other)
    }

    fn finish(mut self) -> Option<Found<'a>> {
        let candidates = self.look();
        let screens = &self.screens;
        let (floor, drifts, unphysical) = {
            let mut unphysical: Vec<Judged> = Vec::new();
            for c in candidates
                .iter()
                .filter(|c| c.members.len() == 1 && c.is_there())
            {
                let known = unphysical.iter().any(|j| j.candidate.meets(c));
                if !known && c.held_out_gain().0 > criteria::SURE_GAIN && !c.is_possible(screens) {
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

/// The limbs' values with a candidate at what it was found to be.
fn start_with(screens: &[Screen], candidate: &Candidate) -> Vec<Values> {
    let mut values: Vec<Values> = screens
        .iter()
        .map(|screen| screen.fit.values.clone())
        .collect();
    for (limb, trial) in &candidate.trials {
        values[*limb] = screens[*limb].with(trial);
    }
    values
}

fn judged(screens: &[Screen], candidate: &Candidate) -> Judged {
    let possible = candidate.is_possible(screens);
    let of = |(limb, place): &Member| {
        let trial = candidate
            .trials
            .iter()
            .find(|(l, _)| l == limb)
            .map(|(_, trial)| trial);
        let parameter = |n: usize| {
            let told = trial.and_then(|trial| screens[*limb].parameter(trial, *place, n));
            told.unwrap_or((screens[*limb].shape(*place), 0.0))
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

/// Judges all candidates: the best first, then by how much torque error they take away.
fn judge(screens: &[Screen], candidates: &[Candidate]) -> Vec<Judged> {
    let mut all: Vec<Judged> = candidates.iter().map(|c| judged(screens, c)).collect();
    all.sort_by(|a, b| {
        b.candidate
            .torque_error_taken()
            .total_cmp(&a.candidate.torque_error_taken())
    });
    let open: Vec<&Candidate> = candidates.iter().collect();
    let Some(best) = best(screens, &open, candidates) else {
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
/// Candidates at the same joints whose held-out gains differ by less than the error of their difference, or by less than ln n for each
/// parameter more, n windows, are equals. Among them counts how much the sum of squares of all data and of the priors falls, less
/// ln n for each parameter (Schwarz 1978, *Annals of Statistics* 6:461). A simpler rival that is there even beside the best goes
/// before it: a load on a calf swings with it as its rotor turns. What a delay too small to be resolved explains better, and all of
/// it, is none.
fn best<'c>(
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
        c.meets(first) && difference <= error.max(more * windows.ln())
    };
    let worth = |c: &Candidate| c.fall - c.parameters() * windows.ln();
    let equals = good.iter().filter(is_equal);
    let best = *equals.max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
    // Simple before rich.
    let part = PARTS.iter().find(|(rich, _)| *rich == best.effect);
    if let Some((_, plain)) = part {
        let of = |(limb, place): &Member| (*limb, (*plain, place.1));
        let own: Vec<Member> = best.members.iter().map(of).collect();
        let enough =
            |c: &&&Candidate| c.members == own && c.gain().0 >= criteria::RIVAL * best.gain().0;
        if let Some(plain) = good.iter().find(enough) {
            return Some(plain);
        }
    }
    let simpler = good.iter().copied().filter(|c| {
        !PLAIN.contains(&best.effect)
            && c.parameters() < best.parameters()
            && c.effect != best.effect
            && c.meets(best)
            && c.gain().0 >= criteria::RIVAL * best.gain().0
    });
    let mut simpler: Vec<&Candidate> = simpler.collect();
    simpler.sort_by(|a, b| b.gain().0.total_cmp(&a.gain().0));
    let there = simpler
        .into_iter()
        .find(|c| beside(screens, c, best).is_some_and(|c| c.is_beyond_chance()));
    Some(there.unwrap_or(best))
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
        // With Coulomb friction in the model, friction that differs with the direction is a bias but at rest.
        let of = |(limb, place): &Member| (*limb, (EffectKind::AsymmetricCoulomb, place.1));
        found.push((
            EffectKind::AsymmetricCoulomb,
            best.members.iter().map(of).collect(),
        ));
    }
    found
}
