//! What `proprio diagnose --free-base` does: what a model of a walking robot lacks, an effect at a joint or a load on a body.
//!
//! 1. [`crate::free_base`]: the walks' equations that contact forces leave, one factor per block of time.
//! 2. `screen`: what may be missing, and what each would take away to first order. `shapes`: nonlinear parameters.
//! 3. `search`: the best by the rules of [`crate::select`] fitted, judged on time that the fit has not seen, added as long as anything is there.
//! 4. `words`: what was found, as a [`Diagnosis`].

mod screen;
mod search;
mod shapes;
mod words;

use std::path::PathBuf;

use proprio_core::effect::Form;
use proprio_core::go2::JOINT_NAMES;
use serde::Serialize;

use super::Diagnosis;
use crate::estimate::{ParameterEstimate, find};
use crate::free_base::columns::EffectSite;
use crate::free_base::data::Data;
use crate::free_base::structure::ModelStructure;
use crate::free_base::{FreeBaseError, StanceShares, UnseenFoot, Walks, Windows};
use crate::identify::{NotAModel, set_joint, walk_parameters};
use crate::log::Samples;
use crate::model::{BASE, Model};
use crate::parameter;

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
    /// Its effects.
    #[serde(skip)]
    effects: Vec<EffectSite>,
}

/// Diagnoses what a Go2's `model` lacks on logs of it walking, taken together. `progress` hears of logs read, and of how many in all.
///
/// # Errors
/// [`FreeBaseError`]: a log that is bad or too short, or a model that walks are not judged with.
pub fn diagnose_free_base(
    logs: &[PathBuf],
    model: &Model,
    progress: impl FnMut(u64, u64),
) -> Result<FreeBaseDiagnosis, FreeBaseError> {
    let structure = ModelStructure::of(model)?;
    let walks = Walks::read(logs, progress)?;
    let candidates = structure.candidates(model);
    let data = Data::of(&walks, &structure, &candidates)?;
    if !data.can_hold_out() {
        return Err(FreeBaseError::TooShort);
    }
    let unsolvable = || FreeBaseError::Unsolvable;
    let found = search::search(&walks, data, model, &structure).ok_or_else(unsolvable)?;
    let diagnosis = words::diagnosis(logs, &walks, &structure, &found).ok_or_else(unsolvable)?;
    let data = &found.data;
    Ok(FreeBaseDiagnosis {
        diagnosis,
        windows: data.windows,
        stance: walks.stance(),
        unseen_feet: data.unseen.clone(),
        samples: walks.samples(),
        found: walk_parameters(data, &found.fit, &data.deviations(&found.fit)),
        effects: found.structure.effects,
    })
}

impl FreeBaseDiagnosis {
    /// Gives a model the bodies and effects at the end of the path, with their standard deviations.
    ///
    /// # Errors
    /// [`NotAModel`] if a value cannot be.
    pub fn apply(&self, model: &mut Model) -> Result<(), NotAModel> {
        let bodies = std::iter::once((BASE, "base")).chain(JOINT_NAMES.into_iter().enumerate());
        for (body, of) in bodies {
            let named = |fault| NotAModel {
                of: of.to_owned(),
                fault,
            };
            set_joint(&self.found, model, body, of).map_err(named)?;
            for site in self.effects.iter().filter(|site| site.place.1 == body) {
                self.set_others(site, model, of).map_err(named)?;
            }
        }
        Ok(())
    }

    /// Sets the parameters of an effect beyond its first.
    fn set_others(
        &self,
        site: &EffectSite,
        model: &mut Model,
        of: &str,
    ) -> Result<(), crate::model::Impossible> {
        let (effect, joint) = site.place;
        for n in 1..effect.description().parameters.len() {
            let found = find(&self.found, &parameter::of_effect(effect, n, of));
            let (value, std) = found.map_or((site.shape, None), |own| (own.value, Some(own.std)));
            model.set_parameter(effect, joint, n, value, std)?;
        }
        Ok(())
    }
}

/// Whether an effect is a load: on a walk its values are a mass and a place.
fn is_load(effect: proprio_core::effect::EffectKind) -> bool {
    effect.description().form == Form::Inertia
}
