//! What a model's effects are worth: the file's values, or those of the fit.

use proprio_core::effect::{Form, Moved};
use serde::Serialize;

use crate::detect::contact::LeftOut;
use crate::detect::twist::told_by_encoders;
use crate::equation::values::{Place, places};
use crate::estimate::fit::LimbFit;
use crate::estimate::limb_data::LimbData;
use crate::parameter::of_effect;

/// The value of an effect's parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectValue {
    /// `coulomb:FR_calf`; parameters after the first `stribeck.vs:FR_calf`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Value; none if the model file gives none and nothing is fitted.
    pub value: Option<f64>,
    /// Standard deviation, if known; of a fit, all told, as `identify` has it.
    pub std: Option<f64>,
    /// Value before any data.
    pub prior: f64,
    /// Standard deviation of that.
    pub prior_std: f64,
}

/// The values of the effects of one limb and of what all share: the file's, or the fit's; of a contact, what was found at the `foot`.
pub(super) fn of(
    data: &LimbData,
    fit: Option<&LimbFit>,
    foot: Option<&LeftOut>,
) -> Vec<EffectValue> {
    let mut values = Vec::new();
    for (place, e) in places(data.model, data.limb) {
        let joint = data.model.joint_name(e.joint);
        for n in 0..place.0.description().parameters.len() {
            let (value, std) = match fit {
                // No fit has a column for it.
                Some(_) if place.0.description().form == Form::Force => {
                    let force = foot.map(|foot| &foot.contact);
                    (force.map(|c| c.force), force.map(|c| c.std))
                }
                Some(fit) => fitted(fit, place, n),
                None => {
                    let known = e.estimates[n];
                    (known.map(|e| e.value), known.and_then(|e| e.std))
                }
            };
            let (prior, prior_std) = data.prior(place, n);
            values.push(EffectValue {
                name: of_effect(place.0, n, joint),
                unit: data.model.unit(place.0, e.joint, n),
                value,
                std,
                prior,
                prior_std,
            });
        }
    }
    values
}

/// Each value once: what all limbs share, each limb tells.
pub(super) fn once(values: impl Iterator<Item = EffectValue>) -> Vec<EffectValue> {
    let mut told: Vec<EffectValue> = Vec::new();
    for value in values {
        if told.iter().all(|known| known.name != value.name) {
            told.push(value);
        }
    }
    told
}

/// A parameter by all data, and its standard deviation.
fn fitted(fit: &LimbFit, place: Place, n: usize) -> (Option<f64>, Option<f64>) {
    let description = place.0.description();
    if description.form == Form::Motion(Moved::Velocity) {
        return (Some(fit.data.velocity_gain[place.1]), None);
    }
    if description.transmission().is_some() && fit.data.motion.link(place.1).is_some() {
        let told = told_by_encoders(fit.data, &fit.values, place);
        return told.map_or((None, None), |values| {
            (Some(values[n][0]), Some(values[n][1]))
        });
    }
    let entries = fit.columns.of_effect(place.0, place.1);
    let entry = entries
        .into_iter()
        .find(|&k| fit.columns.entries[k].parameter == n);
    let std = entry.map(|k| fit.std(k));
    (Some(fit.values.get(place, n)), std)
}
