//! How far from the CAD the hip and calf inertias of recorded logs come out.
//!
//! A study of the same robot's leg found 146e-3 kg m² for the hip's inertia where the
//! CAD says 0.48e-3: a fit without a prior puts there whatever its model lacks.

use std::path::Path;

use proprio_core::effect::EffectKind;
use proprio_core::go2::Leg;
use proprio_host::estimate::ParameterEstimate;
use proprio_host::identify::{FitOptions, fit_model};
use proprio_host::model::Model;
use proprio_host::recording::Recording;

use crate::device_fit::Failure;

/// Inertias about the joints' own axes.
const INERTIAS: [(&str, &str); 2] = [("Ixx", "hip"), ("Iyy", "calf")];

/// The hip and calf inertias of a log, leg by leg, with `effects` at every joint; bodies physical.
///
/// # Errors
/// A log that cannot be read or is too short.
pub fn inertias(log: &Path, effects: &[EffectKind]) -> Result<Vec<ParameterEstimate>, Failure> {
    let mut model = Model::default();
    for &effect in effects {
        for joint in model.robot().place(effect, None)? {
            model.add_effect(effect, joint);
        }
    }
    let recording = Recording::read(&[log.to_path_buf()], &model, |_, _| {})?;
    let options = FitOptions::PHYSICAL;
    let fitted = fit_model(&recording, &model, options)?;
    let names = Leg::ALL
        .iter()
        .flat_map(|leg| INERTIAS.map(|(what, joint)| format!("{what}:{}_{joint}", leg.name())));
    let all: Option<Vec<ParameterEstimate>> =
        names.map(|name| fitted.parameter(&name).cloned()).collect();
    Ok(all.ok_or("an inertia is missing")?)
}

/// How far an estimate is from the prior, in the prior's standard deviations.
pub fn distance(estimate: &ParameterEstimate) -> f64 {
    (estimate.value - estimate.prior) / estimate.prior_std
}
