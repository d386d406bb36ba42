//! A model of all limbs, and how it predicts what it has not seen: what a search compares.

use std::sync::{Arc, Weak};

use proprio_core::effect::{Enters, Shapes, Transmission};

use super::candidate::{Candidate, Member};
use super::criteria::feasible::{is_likely, is_resolved_spring};
use super::criteria::step::{HeldOut, LEAST_VALUE};
use super::fitted::Fitted;
use crate::equation::values::{Place, Values};
use crate::estimate::fit::{FarBodies, How, LimbFit};
use crate::estimate::grid::size_of;
use crate::estimate::limb_data::{LimbData, Squares};
use crate::estimate::parameter_estimate::Constraint;
use crate::estimate::robot::{self, Shared};
use crate::estimate::shapes::Scan;
use crate::parallel::{by_number, side_by_side};

/// A shape that differs by less than this share makes no difference to a prediction.
const SAME_SHAPE: f64 = 0.05;

/// A model of all limbs, and how it predicts what it has not seen.
#[derive(Clone)]
pub(crate) struct State<'a> {
    pub(crate) fits: Vec<Arc<LimbFit<'a>>>,
    pub(crate) shared: Vec<Shared>,
    /// Of each limb.
    pub(crate) squares: Vec<Squares>,
}

impl<'a> State<'a> {
    /// The model with these effects.
    pub(super) fn of(data: &'a [LimbData<'a>], places: &[Vec<Place>]) -> Option<Self> {
        let (fits, shared) = robot::fit(data, places, &how());
        if fits.len() < data.len() {
            return None;
        }
        let squares = side_by_side(&fits, held_out_squares)
            .into_iter()
            .collect::<Option<_>>()?;
        Some(Self {
            fits: fits.into_iter().map(Arc::new).collect(),
            shared,
            squares,
        })
    }

    /// The model with other effects, from the values of `start`: limbs whose effects stay are not fitted again.
    pub(super) fn with(
        &self,
        data: &'a [LimbData<'a>],
        places: &[Vec<Place>],
        start: &[Values],
        new: &[Place],
    ) -> Option<Self> {
        self.with_worthwhile(data, places, start, &how_with(new), &|_| true)
    }

    /// The same where `is_worth` says so of the model before it is known how it predicts what it has not seen: that is half the work.
    pub(super) fn with_worthwhile(
        &self,
        data: &'a [LimbData<'a>],
        places: &[Vec<Place>],
        start: &[Values],
        how: &How,
        is_worth: &dyn Fn(&Self) -> bool,
    ) -> Option<Self> {
        let (fits, shared) = robot::refit(data, places, how, start, &self.fits, &self.shared)?;
        let mut after = Self {
            fits,
            shared,
            squares: self.squares.clone(),
        };
        if !is_worth(&after) {
            return None;
        }
        after.squares = self.squares_of(&after.fits)?;
        Some(after)
    }

    /// The model with the values that limbs share fitted anew beside all else: while effects are tried they are held, and what they stood for
    /// may have been explained since. `steady`: values that move by fewer standard deviations stay.
    pub(super) fn settled(self, data: &'a [LimbData<'a>], steady: f64) -> Self {
        if self.shared.is_empty() {
            return self;
        }
        let Some((fits, shared)) =
            robot::settle(data, &how_kept(), self.fits.clone(), &self.shared, steady)
        else {
            return self;
        };
        let squares = self.squares_of(&fits);
        match squares {
            Some(squares) => Self {
                fits,
                shared,
                squares,
            },
            None => self,
        }
    }

    /// Held-out sums of squares of other fits of the limbs, each where it is another.
    fn squares_of(&self, fits: &[Arc<LimbFit<'a>>]) -> Option<Vec<Squares>> {
        let squares = by_number(0..fits.len(), |n| {
            match Arc::ptr_eq(&fits[n], &self.fits[n]) {
                true => Some(self.squares[n].clone()),
                false => held_out_squares(&fits[n]),
            }
        });
        squares.into_iter().collect()
    }

    pub(super) fn values(&self) -> Vec<Values> {
        self.fits.iter().map(|fit| fit.values.clone()).collect()
    }

    pub(super) fn places(&self) -> Vec<Vec<Place>> {
        self.fits
            .iter()
            .map(|fit| fit.values.places().collect())
            .collect()
    }

    /// The effects with `members` among them.
    pub(super) fn places_with(&self, members: &[Member]) -> Vec<Vec<Place>> {
        let mut places = self.places();
        for (limb, place) in members {
            places[*limb].push(*place);
        }
        places
    }

    /// In units of the joints' noise under `noise`'s model.
    pub(super) fn weighted(&self, noise: &Self) -> f64 {
        let limbs = self.squares.iter().zip(&noise.fits);
        limbs
            .map(|(squares, fit)| squares.weighted(&fit.noise))
            .sum()
    }

    /// The same of a limb in the windows in which a `limited` fit's joints report less than their limits.
    pub(super) fn weighted_below(&self, noise: &Self, limb: usize, limited: &LimbFit) -> f64 {
        let squares = self.fits[limb].predicted_held_out();
        let squares = squares.map(|predicted| limited.below_limits().squares(&predicted));
        squares.map_or(f64::INFINITY, |s| s.weighted(&noise.fits[limb].noise))
    }

    /// Whether a spring between motor and link gives way by no more than a gear may; how wide a play may be nobody says.
    pub(super) fn is_likely(&self, member: &Member) -> bool {
        let (limb, place) = *member;
        if place.0.description().transmission() != Some(Transmission::Spring) {
            return true;
        }
        let values = self.parameters(member).into_iter().enumerate();
        let mut values = values.map(|(n, value)| (value, self.fits[limb].data.prior(place, n)));
        values.all(|(value, prior)| is_likely(value, prior)) && self.is_resolved(*member)
    }

    /// Whether a spring between motor and link is more than how a torque runs between two samples; what a second encoder sees is.
    fn is_resolved(&self, (limb, place): Member) -> bool {
        let (data, values) = (self.fits[limb].data, &self.fits[limb].values);
        let inertia = || (data.motion).mean_inertia(&data.body, values, place.1);
        let (compliance, period) = (values.get(place, 0), data.recording.period());
        !data.recording.q_link.is_empty() || is_resolved_spring(compliance, inertia(), period)
    }

    /// Whether an effect's nonlinear parameter is more than nothing, where with none the effect is another.
    pub(super) fn tells_shape(&self, &(limb, place): &Member) -> bool {
        let fit = &self.fits[limb];
        let tells = |n| fit.values.get(place, n) >= LEAST_VALUE * fit.known_shape(place, n);
        place.0.description().without_shape.is_none() || place.0.description().shapes().all(tells)
    }
}

impl<'a> Fitted for State<'a> {
    type Fit = LimbFit<'a>;
    /// Of each limb.
    type Errors = Vec<Squares>;

    fn errors(&self) -> &Vec<Squares> {
        &self.squares
    }

    fn total(errors: &Vec<Squares>) -> f64 {
        errors.iter().map(Squares::total).sum()
    }

    fn fits_of(&self, candidate: &Candidate) -> Vec<Weak<LimbFit<'a>>> {
        let limbs = candidate.trials.iter();
        limbs
            .map(|(limb, _)| Arc::downgrade(&self.fits[*limb]))
            .collect()
    }

    fn has(&self, &(limb, place): &Member) -> bool {
        self.fits[limb].values.has(place)
    }

    fn held_out(&self, noise: &Self) -> HeldOut {
        let is_by_log = self.fits.iter().all(|fit| fit.data.blocks.by_log);
        let folds = (self.squares.iter()).map(|s| s.cells.len()).max();
        let log = |f: usize| {
            self.squares
                .iter()
                .filter_map(|s| s.by_fold().get(f).copied())
                .sum()
        };
        let by_log = match is_by_log {
            true => (0..folds.unwrap_or(0)).map(log).collect(),
            false => vec![Self::total(&self.squares)],
        };
        HeldOut {
            weighted: self.weighted(noise),
            by_log,
            is_by_log,
        }
    }

    fn parameters(&self, &(limb, (effect, joint)): &Member) -> Vec<(f64, f64)> {
        let fit = &self.fits[limb];
        let entries = fit.columns.of_effect(effect, joint);
        let parameter = |n: usize| {
            let one = |one: &&Shared| {
                one.effect == effect && one.parameter == n && joint == crate::model::BASE
            };
            if let Some(one) = self.shared.iter().find(one) {
                return (one.value, one.std);
            }
            let own = entries
                .iter()
                .find(|e| fit.columns.entries[**e].parameter == n);
            let Some(&entry) = own else {
                let place = (effect, joint);
                return (fit.values.get(place, n), fit.known_shape(place, n));
            };
            (fit.value(entry), fit.std(entry))
        };
        (0..effect.description().parameters.len())
            .map(parameter)
            .collect()
    }

    fn size(&self, &(limb, (effect, joint)): &Member) -> f64 {
        let fit = &self.fits[limb];
        if let Some(one) = self
            .shared
            .iter()
            .find(|one| one.effect == effect && joint == crate::model::BASE)
        {
            return (one.value / one.std).abs();
        }
        let deviations = fit.deviations();
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
        far_bodies: FarBodies::Held,
        ..How::default()
    }
}

/// The same where shapes are known but for those of `places`.
pub(super) fn how_with(places: &[Place]) -> How {
    // A screen has found the others' shapes. A gap and a compliance are found by trying; a limit moves once friction no longer stands
    // for the excess.
    // Several at once are tried by their columns alone.
    let one = places.len() == 1;
    let searched = (places.iter().copied()).filter(|place| {
        let described = place.0.description();
        described.is_compliant() && (one || described.enters == Enters::Trial)
            || described.is_limit()
    });
    let limit = (places.iter()).any(|place| place.0.description().is_limit());
    How {
        shapes: Some(searched.collect()),
        passes: (!limit).then_some(3),
        ..how()
    }
}

/// The same of a model that is held against one that was kept: in as many passes as that one, for a fit of fewer leaves half a percent more.
pub(super) fn how_kept() -> How {
    How {
        shapes: Some(Vec::new()),
        ..how()
    }
}

/// The same with a play or a spring of which it is told already about how large it is.
pub(super) fn how_near(place: Place) -> How {
    How {
        near: true,
        passes: Some(2),
        ..how_with(&[place])
    }
}

/// Held-out sums of squares of a limb's fit.
pub(crate) fn held_out_squares(fit: &LimbFit) -> Option<Squares> {
    Some(fit.data.squares(&fit.predicted_held_out()?))
}

/// The same with the shapes of an effect searched within the folds as well, on what the model `before` it leaves.
pub(super) fn held_out_with_shape(
    before: &LimbFit,
    after: &LimbFit,
    place: Place,
) -> Option<Squares> {
    let data = after.data;
    let predicted = before.predicted();
    let columns = data.columns(&before.values, &before.places, &[place]);
    let n = data.joints();
    let scan = Scan::new(data, &columns, [&before.values; 2], &|w, j| {
        data.torque[w * n + j] - predicted[w * n + j]
    });
    let held_out = after.held_out()?;
    let of = |fold: usize| -> Option<Values> {
        let before = after.values.shapes(place);
        let best = scan.best_beside(place, before, &|f| f != fold);
        let is_other = |best: &Shapes| {
            let mut all = place.0.description().shapes().zip(best.iter().zip(before));
            all.any(|(n, (best, before))| {
                (best - before).abs() > SAME_SHAPE * size_of(data, (place, n), before)
            })
        };
        let Some(best) = best.filter(is_other) else {
            return Some(held_out[fold].clone());
        };
        let mut start = after.values.clone();
        start.set_searched(place, best);
        let train = data.without_fold(fold);
        let places: Vec<Place> = start.places().collect();
        let held = places.iter().copied().filter(|p| !after.places.contains(p));
        let how = How {
            start: Some(start.clone()),
            shapes: Some(Vec::new()),
            held: held.collect(),
            ..how()
        };
        Some(LimbFit::of(&train, &places, &how)?.values)
    };
    let values = by_number(0..held_out.len(), of);
    let values: Vec<Values> = values.into_iter().collect::<Option<_>>()?;
    Some(data.squares(&data.predicted_by_fold(&values)))
}
