//! What is to be compared: whether values are fitted, and which model a model is held against.

use std::path::PathBuf;

use proprio_core::effect::Form;

use super::ValuesFrom;
use crate::model::{Model, ModelEffect};

/// What is to be compared.
pub(super) struct Asked {
    /// Whether values are to be fitted.
    pub(super) fitted: bool,
    /// The effects that were added last, where they have no value of other logs.
    pub(super) added: Vec<ModelEffect>,
    /// The model without those and with what was left out, if that is another one.
    pub(super) before: Option<Model>,
    /// The model as its file has it: what was added last has no value there, or is in it.
    pub(super) file: Model,
}

impl Asked {
    /// Of logs and the conditions under which they are judged. `recorded`: whether the logs tell of what a joint, or all, have.
    pub(super) fn of(
        logs: (&[PathBuf], &[String]),
        recorded: &dyn Fn(usize) -> bool,
        model: &Model,
        left_out: &[ModelEffect],
        values: ValuesFrom,
    ) -> Self {
        let unvalued = match unvalued(recorded, model) {
            none if none.is_empty() && values == ValuesFrom::Auto => valued_by(logs, model),
            some => some,
        };
        let fitted = match values {
            ValuesFrom::Auto => !unvalued.is_empty(),
            ValuesFrom::Fitted => true,
            ValuesFrom::Given | ValuesFrom::GivenAlsoAtRest => false,
        };
        let added = match fitted {
            true => last_added(&unvalued),
            false => Vec::new(),
        };
        let is_other = !added.is_empty() || !left_out.is_empty();
        let before = is_other.then(|| with(&without(model, &added), left_out));
        Self {
            file: with(model, left_out),
            fitted,
            added,
            before,
        }
    }
}

/// Effects by their names, `coulomb:FR_calf`.
pub(super) fn names(model: &Model, effects: &[ModelEffect]) -> Vec<String> {
    let name = |e: &ModelEffect| format!("{}:{}", e.effect.name(), model.joint_name(e.joint));
    effects.iter().map(name).collect()
}

/// The effects that have no value yet but could from these logs: a contact's force is unknown at every instant, and no fit gives it one, nor
/// an effect of a limb that was not recorded.
fn unvalued(recorded: &dyn Fn(usize) -> bool, model: &Model) -> Vec<ModelEffect> {
    let is_unvalued = |e: &&ModelEffect| {
        e.estimate().is_none() && e.effect.description().form != Form::Force && recorded(e.joint)
    };
    (model.effects().iter().filter(is_unvalued).copied()).collect()
}

/// What a diagnosis of these very logs has just added, with the values that they give: before and after are to be of data that the fit
/// has not seen.
fn valued_by((logs, only): (&[PathBuf], &[String]), model: &Model) -> Vec<ModelEffect> {
    let last = model.effects().iter().filter(|e| e.just_added);
    let last: Vec<ModelEffect> = last.copied().collect();
    match !last.is_empty() && model.is_of(logs, only) {
        true => last,
        false => Vec::new(),
    }
}

/// Of the effects without a value those that were added last; all, if the model does not say.
fn last_added(unvalued: &[ModelEffect]) -> Vec<ModelEffect> {
    let last = unvalued.iter().filter(|e| e.just_added);
    let last: Vec<ModelEffect> = last.copied().collect();
    if last.is_empty() {
        unvalued.to_vec()
    } else {
        last
    }
}

/// The model without those effects.
fn without(model: &Model, added: &[ModelEffect]) -> Model {
    let mut model = model.clone();
    for e in added {
        model.remove_effect(e.effect, e.joint);
    }
    model
}

/// The model with those effects again.
fn with(model: &Model, left_out: &[ModelEffect]) -> Model {
    let mut model = model.clone();
    model.put_back(left_out);
    model
}
