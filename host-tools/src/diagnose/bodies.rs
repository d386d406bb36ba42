//! Bodies that are not the CAD's, beside or instead of effects.
//!
//! A search keeps bodies near the CAD, so that what a model lacks shows in the residual and not as an absurd mass. Where effects beyond
//! those of every drive were found, or bodies pull away, the model is fitted once more with those of every drive alone and its bodies free: if
//! that predicts as well, a body is the plainer cause.

use proprio_core::effect::EffectKind;

use crate::equation::values::Place;
use crate::estimate::fit::How;
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
/// A body that is named instead of effects is farther from the CAD's, in standard deviations: what a model lacks moves bodies too, on real
/// chirps by up to 4.6.
const INSTEAD: f64 = 5.0;
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
    if (pulled || found.steps.iter().any(|step| beyond(&step.effect)))
        && let Some((mut bodies, squares)) = with_free_bodies(data, model)
        && squares < AS_WELL * end
        && squares < PREDICTS * torque
    {
        bodies.retain(|body| body.z > INSTEAD);
        if !bodies.is_empty() {
            return (bodies, true);
        }
    }
    if pulled || end > PREDICTS * torque {
        return (Vec::new(), false);
    }
    let all: Vec<_> = found
        .end
        .fits
        .iter()
        .flat_map(|fit| parameters(fit))
        .collect();
    (other_bodies(&all, model), false)
}

/// The bodies of the model as given with what every drive has, and its held-out squares, (N m)².
fn with_free_bodies(data: &[LimbData], model: &Model) -> Option<(Vec<OtherBody>, f64)> {
    let places = |limb: &LimbData| -> Vec<Place> {
        let mut places = places_of(limb);
        let drive = (0..limb.joints()).flat_map(|j| EffectKind::PLAIN.map(|effect| (effect, j)));
        for place in drive {
            if !places.contains(&place) && limb.can_tell(place) {
                places.push(place);
            }
        }
        places
    };
    let places: Vec<Vec<Place>> = data.iter().map(places).collect();
    let (fits, _) = robot::fit(data, &places, &How::default());
    let squares: Option<Vec<f64>> = (fits.iter())
        .map(|fit| Some(fit.data.squares(&fit.predicted_held_out()?).total()))
        .collect();
    let all: Vec<_> = fits.iter().flat_map(|fit| parameters(fit)).collect();
    Some((other_bodies(&all, model), squares?.iter().sum()))
}
