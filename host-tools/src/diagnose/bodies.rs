//! Bodies that are not the CAD's, beside or instead of effects.
//!
//! A search keeps bodies near the CAD, so that what a model lacks shows in the residual and not as an absurd mass. Where effects beyond
//! those of every drive were found, or bodies pull away, the model is fitted once more with those of every drive alone and its bodies free: where
//! that leaves noise alone, a body is the plainer cause, and the search is made again with that body free. Where no more effects than bodies leave noise
//! alone too (a load, an encoder's zero), either may be the cause: both are told. At the end bodies are told by the same fit as `identify` tells them.

use std::sync::Arc;

use proprio_core::effect::{EffectKind, Form};

use crate::detect::bodies;
use crate::equation::values::{Place, Values};
use crate::estimate::Constraint;
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::{LimbData, Squares};
use crate::identify::model_fit::{parameters, places_of};
use crate::identify::{BodyQuantity, OtherBody, other_bodies, released};
use crate::model::Model;
use crate::parallel::side_by_side;
use crate::select::criteria::step::{LEAST_PART, SAME};
use crate::select::fitted::{Fitted, Step};
use crate::select::limbs::Limbs;
use crate::select::search::Found;
use crate::select::state::{State, held_out_squares};

/// The limbs' fits, and what each leaves of what it has not seen.
pub(super) type Fits<'a> = (Vec<LimbFit<'a>>, Vec<Squares>);

/// Bodies are told only by a model that predicts to this share of the torque's square: else what it lacks is in them.
const PREDICTS: f64 = 0.05;

/// What bodies do instead of effects.
pub(super) struct Instead<'a> {
    /// The data with the bodies released that do.
    pub(super) data: Vec<LimbData<'a>>,
    /// Those bodies, where either they or the effects found may be the cause, and whether these are loads: then a body is the cause either way.
    pub(super) as_well: Option<(Vec<OtherBody>, bool)>,
}

/// The bodies that do instead of the effects found beyond the drives': released, they leave noise alone.
pub(super) fn instead<'a>(
    data: &[LimbData<'a>],
    found: &Found<Limbs>,
    model: &Model,
) -> Option<Instead<'a>> {
    let is_held = found.end.fits.iter().any(|fit| is_held(fit));
    if !is_held && beyond(found).next().is_none() {
        return None;
    }
    let plain: Vec<Vec<Place>> = data.iter().map(with_drive).collect();
    // Of a log too short to have a noise floor, what the effects found leave is to be reached; where none was found, most of what is left is to go.
    let by_effects = |n: usize| {
        let end = found.end.squares[n].total();
        match here(&[n], found).next() {
            Some(_) => end,
            None => LEAST_PART * end,
        }
    };
    let most = |n: usize| Some(bodies::at_floor(&data[n]).unwrap_or_else(|| by_effects(n)));
    let (fits, _) = bodies::fit_from(data, &plain, &how(), &vec![None; data.len()], &most);
    if fits.len() < data.len() || !fits.iter().any(is_released) {
        return None;
    }
    let freed = data.iter().zip(&fits);
    let freed = freed.map(|(data, fit)| data.with_bodies(fit.less_certain()));
    let others = other(fits.iter(), model);
    let limbs: Vec<usize> = (0..fits.len()).filter(|n| is_released(&fits[*n])).collect();
    let is_load = |step: &Step<_>| step.effect.description().form == Form::Inertia;
    let are_loads = here(&limbs, found).all(is_load);
    // A load adds mass: where a body is lighter than the CAD's, one on its neighbour stands for what the CAD has too much.
    let is_lighter =
        |body: &OtherBody| body.quantity == BodyQuantity::Mass && body.value[0] < body.stated[0];
    let is_wrong = here(&limbs, found).any(is_load) && others.iter().any(is_lighter);
    let count = |fits: &[LimbFit]| {
        let bodies = limbs.iter().flat_map(|n| fits[*n].less_certain());
        bodies.filter(|times| *times > 1.0).count()
    };
    // The effects found, with the bodies released that are not the CAD's beside them: as plain where both together are no more, and leave noise alone.
    let (effects, mut as_well) = (here(&limbs, found).count(), None);
    if (1..=count(&fits)).contains(&effects) && !is_wrong {
        let (end, squares) = free_end(data, found)?;
        let by_bodies = |n: usize| Some(SAME * held_out_squares(&fits[n])?.total());
        let leave_noise = |n: &usize| {
            let most = bodies::at_floor(&data[*n]).or_else(|| by_bodies(*n));
            most.is_some_and(|most| squares[*n].total() <= most)
        };
        let beside = count(&end);
        if effects + beside <= count(&fits) && limbs.iter().all(leave_noise) {
            if beside > 0 {
                return None;
            }
            as_well = Some((others, are_loads));
        }
    }
    Some(Instead {
        data: freed.collect(),
        as_well,
    })
}

/// Those of [`beyond`] at one of these limbs.
pub(super) fn here<'f, 'd>(
    limbs: &'f [usize],
    found: &'f Found<Limbs<'d>>,
) -> impl Iterator<Item = &'f Step<State<'d>>> {
    let is_here = |step: &&Step<_>| step.members.iter().any(|(limb, _)| limbs.contains(limb));
    beyond(found).filter(is_here)
}

/// The steps that added what the model at the end has beyond the drives' effects.
fn beyond<'f, 'd>(found: &'f Found<Limbs<'d>>) -> impl Iterator<Item = &'f Step<State<'d>>> {
    let is_there = |step: &Step<_>| step.members.iter().any(|member| found.end.has(member));
    let steps = found.steps.iter();
    steps
        .filter(|step| !step.effect.description().is_plain() && !step.removed)
        .filter(move |step| is_there(step))
}

/// Whether nothing but bodies that are not the CAD's is missing.
pub(super) fn are_all(bodies: &[OtherBody], found: &Found<Limbs>) -> bool {
    !bodies.is_empty() && beyond(found).next().is_none()
}

/// The bodies that fits put beyond what is known of them.
fn other<'f>(fits: impl Iterator<Item = &'f LimbFit<'f>> + Clone, model: &Model) -> Vec<OtherBody> {
    let all: Vec<_> = fits.clone().flat_map(parameters).collect();
    other_bodies(all.iter().map(|own| &own.estimate), &released(fits), model)
}

/// The bodies that the model at the end puts beyond what is known of them; none of a model that does not predict, and of a limb none while one is held: a
/// value at its bound is no finding.
pub(super) fn beside(data: &[LimbData], found: &Found<Limbs>, model: &Model) -> Vec<OtherBody> {
    let end: f64 = found.end.squares.iter().map(Squares::total).sum();
    if end > told_below(data) {
        return Vec::new();
    }
    let fits = found.end.fits.iter().map(|fit| &**fit);
    other(fits.filter(|fit| !is_held(fit)), model)
}

/// Held-out squares below which a model tells bodies, (N m)².
fn told_below(data: &[LimbData]) -> f64 {
    let torque = data
        .iter()
        .map(|limb| limb.squares(&vec![0.0; limb.torque.len()]).total());
    PREDICTS * torque.sum::<f64>()
}

/// Whether a fit holds a body nearer to the CAD than its uncertainty says.
pub(super) fn is_held(fit: &LimbFit) -> bool {
    fit.tightness.iter().any(|tightness| *tightness > 1.0)
}

/// Whether a fit has released a body.
fn is_released(fit: &LimbFit) -> bool {
    fit.less_certain().iter().any(|times| *times > 1.0)
}

/// How a model's values are fitted where nothing is searched for: as `identify` and `compare` do.
fn how() -> How {
    How {
        constraint: Constraint::Physical,
        ..How::default()
    }
}

/// The model as given with bodies released, where that leaves noise alone at a limb: then its values fitted anew are those of `identify`.
pub(super) fn refitted<'a>(data: &'a [LimbData<'a>]) -> Option<Fits<'a>> {
    let told = fitted(data, &given(data), &how(), &vec![None; data.len()])?;
    told.0.iter().any(is_released).then_some(told)
}

/// Each limb's effects as they are given.
fn given(data: &[LimbData]) -> Vec<Vec<Place>> {
    data.iter().map(places_of).collect()
}

fn fitted<'a>(
    data: &'a [LimbData<'a>],
    places: &[Vec<Place>],
    how: &How,
    start: &[Option<Values>],
) -> Option<Fits<'a>> {
    let floor = |n: usize| bodies::at_floor(&data[n]);
    let (fits, _) = bodies::fit_from(data, places, how, start, &floor);
    let squares = side_by_side(&fits, held_out_squares);
    let squares: Option<Vec<Squares>> = squares.into_iter().collect();
    (fits.len() == data.len()).then_some((fits, squares?))
}

/// How a model is fitted of which the search has found the shapes.
fn how_found() -> How {
    How {
        shapes: Some(Vec::new()),
        ..how()
    }
}

fn values_at_end(found: &Found<Limbs>) -> Vec<Option<Values>> {
    let fits = found.end.fits.iter();
    fits.map(|fit| Some(fit.values.clone())).collect()
}

/// The model at the end with what the search has held let go of.
fn free_end<'a>(data: &'a [LimbData<'a>], found: &Found<Limbs>) -> Option<Fits<'a>> {
    let fits = found.end.fits.iter();
    let places: Vec<Vec<Place>> = fits.map(|fit| fit.values.places().collect()).collect();
    fitted(data, &places, &how_found(), &values_at_end(found))
}

/// Lets go of the bodies that the search has held nearer to the CAD where that leaves noise alone: the models after each step as `identify` would fit the same
/// effects, with the shapes that the search has found.
pub(super) fn let_go<'a>(data: &'a [LimbData<'a>], found: &mut Found<Limbs<'a>>) {
    // Where none is held, the model with what is held let go of is the one at the end.
    if !found.end.fits.iter().any(|fit| is_held(fit)) {
        return;
    }
    let end = free_end(data, found);
    let Some((fits, squares)) = end.filter(|(fits, _)| fits.iter().any(is_released)) else {
        return;
    };
    let start = values_at_end(found);
    let mut places = given(data);
    for step in &mut found.steps {
        for (limb, place) in &step.members {
            match step.removed {
                true => places[*limb].retain(|own| own != place),
                false => places[*limb].push(*place),
            }
        }
        if let Some((_, squares)) = fitted(data, &places, &how_found(), &start) {
            step.errors = squares;
        }
    }
    if let Some(last) = found.steps.last_mut() {
        last.errors.clone_from(&squares);
    }
    found.end.fits = fits.into_iter().map(Arc::new).collect();
    found.end.squares = squares;
}

/// The effects of the model as given and those of every drive.
pub(super) fn with_drive(limb: &LimbData) -> Vec<Place> {
    let mut places = places_of(limb);
    let drive = (0..limb.joints()).flat_map(|j| EffectKind::PLAIN.map(|effect| (effect, j)));
    for place in drive {
        if !places.contains(&place) && limb.can_tell(place) {
            places.push(place);
        }
    }
    places
}
