//! What a model's effects are worth: the file's values, or those of the fit.

use proprio_core::effect::{EffectKind, Form};
use serde::Serialize;

use crate::criticism::column::BASE;
use crate::criticism::contact::LeftOut;
use crate::criticism::limb::LimbCriticism;
use crate::criticism::series::Predict;
use crate::model::{Limb, Model};
use crate::parameter::name_at;

/// The value of an effect's parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EffectValue {
    /// `coulomb:FR_calf`; parameters after the first `vs:stribeck:FR_calf`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Value; none if the model file gives none and nothing is fitted.
    pub value: Option<f64>,
    /// Standard deviation, if known; of a fit, under independent residuals.
    pub std: Option<f64>,
    /// Value before any data.
    pub prior: f64,
    /// Standard deviation of that.
    pub prior_std: f64,
}

/// The values of the effects of one limb, or of the base; of a contact, what was found at the `foot`.
pub(super) fn of(
    criticism: &LimbCriticism,
    model: &Model,
    predict: Predict,
    foot: Option<&LeftOut>,
) -> Vec<EffectValue> {
    let mut values = Vec::new();
    for &(effect, joint) in &criticism.active {
        let body = body(criticism.limb, joint);
        let place = name_at(effect.name(), model.joint_name(body));
        for (n, parameter) in effect.description().parameters.iter().enumerate() {
            let (value, std) = match predict {
                Predict::Given | Predict::Named(_) => {
                    let known = model.effect(effect, body).and_then(|e| e.estimates[n]);
                    (known.map(|e| e.value), known.and_then(|e| e.std))
                }
                // No fit has a column for it.
                Predict::HeldOut if effect.description().form == Form::Force => {
                    let force = foot.map(|foot| &foot.contact);
                    (force.map(|c| c.force), force.map(|c| c.std))
                }
                Predict::HeldOut => fitted(criticism, (effect, joint), n),
            };
            let root = body.min(model.robot().bodies().len() - 1);
            let prior = match n {
                0 => model.effect_prior(effect, root).prior,
                n => model.robot().parameter_prior(effect, root, n),
            };
            values.push(EffectValue {
                name: match n {
                    0 => place.clone(),
                    _ => format!("{}:{place}", parameter.symbol),
                },
                unit: parameter.unit,
                value,
                std,
                prior: prior.mean,
                prior_std: prior.std,
            });
        }
    }
    values
}

fn body(limb: &Limb, joint: usize) -> usize {
    if joint == BASE {
        BASE
    } else {
        limb.bodies.start + joint
    }
}

/// A parameter by all data, and its standard deviation.
fn fitted(
    criticism: &LimbCriticism,
    place: (EffectKind, usize),
    parameter: usize,
) -> (Option<f64>, Option<f64>) {
    let (effect, joint) = place;
    if effect == EffectKind::VelocityGain {
        return (Some(criticism.corrections.velocity_gain[joint]), None);
    }
    let entries = criticism.columns.of_effect(effect, joint);
    let of_parameter = |&k: &usize| criticism.columns.entries[k].parameter == parameter;
    let Some(k) = entries.into_iter().find(of_parameter) else {
        return (Some(criticism.shape(place)), None);
    };
    let (theta, std) = (criticism.fit.theta[k], criticism.fit.std[k]);
    let slope = (criticism.value(k, theta + 1e-6) - criticism.value(k, theta - 1e-6)) / 2e-6;
    (Some(criticism.value(k, theta)), Some(std * slope.abs()))
}
