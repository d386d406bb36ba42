//! What was added to a model and has no value yet: the model before is what it is held against.

use proprio_core::effect::Form;

use crate::equation::motion::is_shared;
use crate::model::{Model, ModelEffect, Provenance};
use crate::recording::Recording;

/// The effects that have no value yet but could from these logs: a contact's force is unknown at every instant, and no fit gives it one, nor
/// an effect of a limb that was not recorded.
pub(super) fn unvalued(recording: &Recording, model: &Model) -> Vec<ModelEffect> {
    let recorded = |joint: usize| {
        let mut limbs = recording.limbs.iter();
        is_shared(joint) || limbs.any(|(limb, _)| limb.bodies.contains(&joint))
    };
    let is_unvalued = |e: &&ModelEffect| {
        e.estimate().is_none() && e.effect.description().form != Form::Force && recorded(e.joint)
    };
    (model.effects().iter().filter(is_unvalued).copied()).collect()
}

/// What a diagnosis of these very logs has just added, with the values that they give: before and after are to be of data that the fit
/// has not seen.
pub(super) fn valued_by(recording: &Recording, model: &Model) -> Vec<ModelEffect> {
    let last = model.effects().iter().filter(|e| e.just_added);
    let last: Vec<ModelEffect> = last.copied().collect();
    let own = |provenance: &Provenance| provenance.is_of(&recording.logs).unwrap_or(false);
    match !last.is_empty() && model.provenance().is_some_and(own) {
        true => last,
        false => Vec::new(),
    }
}

/// Of the effects without a value those that were added last; all, if the model does not say.
pub(super) fn last_added(unvalued: &[ModelEffect]) -> Vec<ModelEffect> {
    let last = unvalued.iter().filter(|e| e.just_added);
    let last: Vec<ModelEffect> = last.copied().collect();
    if last.is_empty() {
        unvalued.to_vec()
    } else {
        last
    }
}

/// The model without those effects.
pub(super) fn without(model: &Model, added: &[ModelEffect]) -> Model {
    let mut model = model.clone();
    for e in added {
        model.remove_effect(e.effect, e.joint);
    }
    model
}

/// The model with those effects again.
pub(super) fn with(model: &Model, left_out: &[ModelEffect]) -> Model {
    let mut model = model.clone();
    model.put_back(left_out);
    model
}
