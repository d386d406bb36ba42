//! Bodies that are not the CAD's, beside or instead of effects.
//!
//! A search keeps bodies near the CAD, so that what a model lacks shows in the residual and not as an absurd mass. Where effects beyond
//! those of every drive were found, or bodies pull away, the model is fitted once more with those of every drive alone and its bodies free: if
//! that predicts as well, a body is the plainer cause. Where it does not, effects and a body are both there: the model found is fitted with its
//! bodies free, and a body that it puts far from the CAD's stands beside the effects.

use proprio_core::effect::EffectKind;

use crate::equation::values::Place;
use crate::estimate::fit::{FarBodies, How, LimbFit};
use crate::estimate::limb_data::LimbData;
use crate::estimate::robot;
use crate::identify::model_fit::{parameters, places_of};
use crate::identify::{OtherBody, other_bodies};
use crate::model::Model;
use crate::select::limbs::Limbs;
use crate::select::search::Found;

/// Held-out squares up to so many times those of the effects found: the prior pulls a body that is another one back to the CAD's, and leaves that
/// much of it.
const AS_WELL: f64 = 1.35;
/// A body that pulls away is farther from the CAD's than this, in standard deviations, if it is named instead of effects or beside them: what
/// a model lacks moves bodies too, on real chirps by up to 4.6.
const FAR: f64 = 5.0;
/// Bodies are told only by a model that predicts to this share of the torque's square: else what it lacks is in them.
const PREDICTS: f64 = 0.05;

/// The bodies that a recording's limbs put beyond what is known of them, and whether they do as well as the effects that were found.
pub(super) fn of(data: &[LimbData], found: &Found<Limbs>, model: &Model) -> (Vec<OtherBody>, bool) {
    let torque: f64 = (data.iter())
        .map(|limb| limb.squares(&vec![0.0; limb.torque.len()]).total())
        .sum();
    let end: f64 = found.end.squares.iter().map(|own| own.total()).sum();
    let beyond = |effect: &EffectKind| !effect.description().is_plain();
    let pulled = found
        .end
        .fits
        .iter()
        .any(|fit| fit.tightness.iter().any(|t| *t > 1.0));
    if pulled || found.steps.iter().any(|step| beyond(&step.effect)) {
        let plain: Vec<Vec<Place>> = data.iter().map(with_drive).collect();
        let most = (AS_WELL * end).min(PREDICTS * torque);
        let instead = far_with_free_bodies(data, &plain, model, most);
        if !instead.is_empty() {
            return (instead, true);
        }
    }
    if end > PREDICTS * torque {
        return (Vec::new(), false);
    }
    if pulled {
        let fits = found.end.fits.iter();
        let places: Vec<Vec<Place>> = fits.map(|fit| fit.values.places().collect()).collect();
        return (far_with_free_bodies(data, &places, model, end), false);
    }
    let all: Vec<_> = found
        .end
        .fits
        .iter()
        .flat_map(|fit| parameters(fit))
        .collect();
    (
        other_bodies(all.iter().map(|own| &own.estimate), model),
        false,
    )
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
