//! What `proprio diagnose --free-base` does: what a model of a walking robot lacks, an effect at a joint or a load on a body.
//!
//! 1. [`crate::free_base`]: the walks' equations that contact forces leave, one factor per block of time.
//! 2. `model`: a model fitted to walks. `screen`: what may be missing, and what each would take away to first order.
//! 3. `search`: walks as a source of rows for the search of [`crate::select`].
//! 4. `formulas`: torques outside the catalogue. `text`: what was found, as a [`Diagnosis`].

mod formulas;
mod model;
mod screen;
mod search;
mod text;

use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::Vector3;
use proprio_core::effect::Form;
use serde::Serialize;

use super::Diagnosis;
use super::changed::changed;
use crate::detect::ladder::Yardsticks;
use crate::equation::values::Place;
use crate::estimate::ParameterEstimate;
use crate::free_base::columns::{EffectSite, body_of};
use crate::free_base::data::Data;
use crate::free_base::fit::Fit;
use crate::free_base::legged::Legged;
use crate::free_base::rungs::rungs;
use crate::free_base::shapes;
use crate::free_base::structure::ModelStructure;
use crate::free_base::{FreeBaseError, StanceShares, UnseenFoot, Walks, Windows};
use crate::identify::{
    NotAModel, quantities, set_walk, total_std, walk_bodies, walk_parameters, without_loaded,
};
use crate::log::Samples;
use crate::model::Model;
use crate::select::search::search;
use model::WalkModel;
use search::WalkSource;

/// What `proprio diagnose --free-base` says.
#[derive(Debug, Clone, Serialize)]
pub struct FreeBaseDiagnosis {
    /// As of a robot that hangs: errors are of the equations that contact forces leave.
    #[serde(flatten)]
    pub diagnosis: Diagnosis,
    /// What became of the windows.
    pub windows: Windows,
    /// Why feet were projected out, log by log.
    pub stance: Vec<StanceShares>,
    /// Feet that carry a force in windows in which they are taken to be in the air.
    pub unseen_feet: Vec<UnseenFoot>,
    /// What became of the samples; one sample is all of the robot's.
    pub samples: Samples,
    /// What the model has at the end.
    #[serde(skip)]
    found: Vec<ParameterEstimate>,
    /// Standard deviations of all bodies together.
    #[serde(skip)]
    total_std: Option<[f64; 4]>,
    /// Its effects.
    #[serde(skip)]
    effects: Vec<EffectSite>,
}

/// Diagnoses what a robot's `model` lacks on logs of it walking, taken together; formulas are sought unless it is of the `catalogue_only`. `progress` hears of logs read, and of how many in all.
///
/// # Errors
/// [`FreeBaseError`]: a log that is bad or too short, or a model that walks are not judged with.
pub fn diagnose_free_base(
    logs: &[PathBuf],
    model: &Model,
    catalogue_only: bool,
    progress: impl FnMut(u64, u64),
) -> Result<FreeBaseDiagnosis, FreeBaseError> {
    let structure = ModelStructure::of(model)?;
    let walks = Walks::read(logs, (model, &structure.robot), progress)?;
    let candidates = structure.candidates(model);
    let (data, structure) = Data::believed(&walks, structure, &candidates)?;
    if !data.can_hold_out() {
        return Err(FreeBaseError::TooShort);
    }
    let unsolvable = || FreeBaseError::Unsolvable;
    let rungs = rungs(&data, model)?;
    let as_given = data.by_coordinate(&walks, &[vec![&rungs[2]]]);
    let yardsticks = Yardsticks::of_walk(rungs.each_ref().map(|theta| data.rms(theta)));
    let held_against = (yardsticks, &as_given[0]);
    let source = WalkSource::new(&walks, model, &structure, Arc::new(data));
    let mut found = search(source, &[]).ok_or_else(unsolvable)?;
    let formulas = match catalogue_only {
        true => Vec::new(),
        false => {
            let left = text::left(&found.end, &walks).ok_or_else(unsolvable)?;
            let joints = text::outside(&left, &walks);
            formulas::find_formulas((&walks, model), &mut found, &joints)
        }
    };
    let WalkModel {
        structure: end,
        data,
        fit,
        ..
    } = &found.end;
    let all = |data: &Data, fit: &Fit| {
        let deviations = data.deviations(fit);
        let total = total_std(&quantities(fit, &deviations, &end.robot));
        (walk_parameters(data, fit, &deviations), total)
    };
    let (values, total_std) = match shapes::is_shaped(end) {
        true => {
            let of = (&walks, model);
            let (told, sites) = shapes::with_derivatives(of, data, end.clone(), fit)?;
            let fit = told.fit(&sites).ok_or_else(unsolvable)?;
            all(&told, &fit)
        }
        false => all(data, fit),
    };
    let formulas = formulas::told(model, &formulas, &values);
    let mut diagnosis = text::diagnosis(logs, &walks, &structure, held_against, &found, formulas)
        .ok_or_else(unsolvable)?;
    let structure = end;
    diagnosis.has_values = model.has_values();
    // What no effect explains is in the bodies too.
    if diagnosis.outside_catalogue.is_empty()
        && let Some(free) = data.fit_with_free_bodies(structure, fit)
    {
        let values = walk_parameters(data, &free, &data.deviations(&free));
        let other = walk_bodies(&walks, structure, &values, model);
        diagnosis.bodies = super::text::bodies(&other, false);
    }
    if !model.is_of(logs, &[]) {
        diagnosis.changed = changed(model, &without_loaded(structure, &values));
    }
    Ok(FreeBaseDiagnosis {
        diagnosis,
        windows: data.windows.clone(),
        stance: walks.stance(),
        unseen_feet: data.unseen.clone(),
        samples: walks.samples(),
        found: values,
        total_std,
        effects: structure.effects.clone(),
    })
}

impl FreeBaseDiagnosis {
    /// Gives a model the bodies and effects at the end of the path, with their standard deviations. Loads that it had are in its bodies then.
    ///
    /// # Errors
    /// [`NotAModel`] if a value cannot be.
    pub fn apply(&self, model: &mut Model) -> Result<(), NotAModel> {
        let loads = model.effects().iter().filter(|own| is_load(own.effect));
        let loads: Vec<Place> = loads.map(|own| (own.effect, own.joint)).collect();
        for (effect, joint) in loads {
            model.remove_effect(effect, joint);
        }
        set_walk((&self.found, self.total_std), &self.effects, model)
    }
}

/// Whether an effect is a load: on a walk its values are a mass and a place.
fn is_load(effect: proprio_core::effect::EffectKind) -> bool {
    effect.description().form == Form::Inertia
}

/// Where the CAD has the centre of mass of the body that a joint moves, or the trunk's, from its origin, m: a load's first moment is about it.
fn centre(robot: &Legged, joint: usize) -> Vector3<f64> {
    let inertia = &robot.tree.bodies()[body_of(joint)].inertia;
    inertia.first_moment() / inertia.mass()
}
