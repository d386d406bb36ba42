//! Bodies that are not the CAD's, beside or instead of effects.
//!
//! A search keeps bodies near the CAD, so that what a model lacks shows in the residual and not as an absurd mass. Where effects beyond
//! those of every drive were found, or bodies pull away, the model is fitted once more with those of every drive alone and its bodies free: if
//! that predicts as well, a body is the plainer cause. At the end bodies are told by the same fit as `identify` tells them.

use std::sync::Arc;

use proprio_core::effect::EffectKind;

use crate::detect::bodies;
use crate::equation::values::Place;
use crate::estimate::Constraint;
use crate::estimate::fit::{FarBodies, How, LimbFit};
use crate::estimate::limb_data::{LimbData, Squares};
use crate::estimate::robot::{self, Shared};
use crate::identify::model_fit::{parameters, places_of};
use crate::identify::{OtherBody, other_bodies};
use crate::model::Model;
use crate::parallel::side_by_side;
use crate::select::limbs::Limbs;
use crate::select::search::Found;

/// The limbs' fits, and what each leaves of what it has not seen.
pub(super) type Fits<'a> = (Vec<LimbFit<'a>>, Vec<Squares>);

/// Held-out squares up to so many times those of the effects found: the prior pulls a body that is another one back to the CAD's, and leaves that
/// much of it.
const AS_WELL: f64 = 1.35;
/// A body that pulls away is farther from the CAD's than this, in standard deviations, if it is named instead of effects or beside them: what
/// a model lacks moves bodies too, on real chirps by up to 4.6.
const FAR: f64 = 5.0;
/// Bodies are told only by a model that predicts to this share of the torque's square: else what it lacks is in them.
const PREDICTS: f64 = 0.05;

/// The bodies that do as well as the effects that were found, if a fit of every drive's effects alone puts any beyond what is known of them.
pub(super) fn instead(data: &[LimbData], found: &Found<Limbs>, model: &Model) -> Vec<OtherBody> {
    let beyond = |effect: &EffectKind| !effect.description().is_plain();
    let is_held = found.end.fits.iter().any(|fit| is_held(fit));
    if !is_held && !found.steps.iter().any(|step| beyond(&step.effect)) {
        return Vec::new();
    }
    let plain: Vec<Vec<Place>> = data.iter().map(with_drive).collect();
    let end: f64 = found.end.squares.iter().map(Squares::total).sum();
    far_with_free_bodies(data, &plain, model, (AS_WELL * end).min(told_below(data)))
}

/// The bodies that the model at the end puts beyond what is known of them; none of a model that does not predict.
pub(super) fn beside(data: &[LimbData], found: &Found<Limbs>, model: &Model) -> Vec<OtherBody> {
    let end: f64 = found.end.squares.iter().map(Squares::total).sum();
    if end > told_below(data) {
        return Vec::new();
    }
    let fits = found.end.fits.iter();
    let all: Vec<_> = fits.flat_map(|fit| parameters(fit)).collect();
    other_bodies(all.iter().map(|own| &own.estimate), model)
}

/// Held-out squares below which a model tells bodies, (N m)².
fn told_below(data: &[LimbData]) -> f64 {
    let torque = data
        .iter()
        .map(|limb| limb.squares(&vec![0.0; limb.torque.len()]).total());
    PREDICTS * torque.sum::<f64>()
}

/// Whether a fit holds a body nearer to the CAD than its uncertainty says.
fn is_held(fit: &LimbFit) -> bool {
    fit.tightness.iter().any(|tightness| *tightness > 1.0)
}

/// How a model's values are fitted where nothing is searched for: as `identify` and `compare` do.
fn how() -> How {
    How {
        constraint: Constraint::Physical,
        ..How::default()
    }
}

/// The model as given, its values fitted anew as `identify` does; `None` if numbers are not finite.
pub(super) fn refitted<'a>(data: &'a [LimbData<'a>]) -> Option<Fits<'a>> {
    let places: Vec<Vec<Place>> = data.iter().map(places_of).collect();
    let (fits, _) = bodies::fit(data, &places, &how());
    let squares = side_by_side(&fits, |fit| {
        Some(fit.data.squares(&fit.predicted_held_out()?))
    });
    let squares: Option<Vec<Squares>> = squares.into_iter().collect();
    (fits.len() == data.len()).then_some((fits, squares?))
}

/// Lets go of the bodies that the search has held nearer to the CAD, as `identify` would fit the same effects. Where nothing was added, the model at the end is
/// the one that was `refitted`.
pub(super) fn let_go<'a>(found: &mut Found<Limbs<'a>>, refitted: Fits<'a>) {
    let end = &mut found.end;
    let is_start = found.steps.is_empty();
    for (n, (fit, squares)) in refitted.0.into_iter().zip(refitted.1).enumerate() {
        if !is_held(&end.fits[n]) {
            continue;
        }
        let told = match is_start {
            true => Some((fit, squares)),
            false => {
                let held = &end.fits[n];
                let how = How {
                    start: Some(held.values.clone()),
                    shapes: Some(Vec::new()),
                    held: end.shared.iter().map(Shared::place).collect(),
                    ..how()
                };
                let places = vec![held.values.places().collect()];
                let data = std::slice::from_ref(held.data);
                let (fits, _) = bodies::fit(data, &places, &how);
                fits.into_iter().next().and_then(|fit| {
                    let squares = fit.data.squares(&fit.predicted_held_out()?);
                    Some((fit, squares))
                })
            }
        };
        if let Some((fit, squares)) = told {
            end.fits[n] = Arc::new(fit);
            end.squares[n] = squares;
        }
    }
    if let Some(last) = found.steps.last_mut() {
        last.errors.clone_from(&found.end.squares);
    }
}

/// The effects of the model as given and those of every drive.
fn with_drive(limb: &LimbData) -> Vec<Place> {
    let mut places = places_of(limb);
    let drive = (0..limb.joints()).flat_map(|j| EffectKind::PLAIN.map(|effect| (effect, j)));
    for place in drive {
        if !places.contains(&place) && limb.can_tell(place) {
            places.push(place);
        }
    }
    places
}

/// The bodies that a model of the effects `places` puts far from the CAD's where nothing holds them nearer than the CAD's uncertainty; none if
/// its held-out squares are `most` or more, (N m)²: then it is not known to be the model.
fn far_with_free_bodies(
    data: &[LimbData],
    places: &[Vec<Place>],
    model: &Model,
    most: f64,
) -> Vec<OtherBody> {
    let how = How {
        far_bodies: FarBodies::Released,
        ..How::default()
    };
    let (fits, _) = robot::fit(data, places, &how);
    let squares = |fit: &LimbFit| Some(fit.data.squares(&fit.predicted_held_out()?).total());
    let squares: Option<f64> = fits.iter().map(squares).sum();
    if squares.is_none_or(|squares| squares >= most) {
        return Vec::new();
    }
    let all: Vec<_> = fits.iter().flat_map(|fit| parameters(fit)).collect();
    let mut bodies = other_bodies(all.iter().map(|own| &own.estimate), model);
    bodies.retain(|body| body.z > FAR);
    bodies
}
