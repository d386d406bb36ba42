//! What `proprio identify --model` does: the effects that a model file names, fitted to logs.

mod result;

use proprio_core::effect::EffectKind;
use proprio_core::inertia::{INERTIAL, NAMES, UNITS};

use super::deviation::Deviations;
use super::limb::LimbFit;
use crate::criticism::column::{BASE, Entry};
use crate::criticism::velocity::VelocityGain;
use crate::criticism::{CriticismError, Recording};
use crate::estimate::{Constraint, ParameterEstimate, Status};
use crate::model::{Limb, Model};
use crate::parameter::name_at;
pub use result::{Fitted, FittedJoint, FittedParameter, Held};

/// Fits `model`, whose values are not looked at but whose priors are, to a recording.
///
/// # Errors
/// [`CriticismError::TooShort`] if no limb has enough samples.
pub fn fit_model(
    recording: &Recording,
    model: &Model,
    constraint: Constraint,
) -> Result<Fitted, CriticismError> {
    let without = without_values(model);
    let too_short = || CriticismError::TooShort { duration: recording.duration };
    let mut fits = fit_limbs(recording, &without, constraint, None);
    if fits.is_empty() {
        return Err(too_short());
    }
    let mut tilt = None;
    if without.effect(EffectKind::BaseTilt, BASE).is_some() {
        let common = common_tilt(&fits);
        tilt = Some(common);
        fits = fit_limbs(recording, &without, constraint, Some(common.map(|(value, _)| value)));
    }
    Ok(Fitted::new(recording, &fits, tilt))
}

/// The model with its effects and priors, but with no effect's value: an effect's shape is found anew.
pub(crate) fn without_values(model: &Model) -> Model {
    let mut without = model.clone();
    for effect in model.effects() {
        without.remove_effect(effect.effect, effect.joint);
        without.add_effect(effect.effect, effect.joint);
        if let Some(prior) = effect.prior {
            // It was possible in the model that it comes from.
            let _ = without.set_effect_prior(effect.effect, effect.joint, prior);
        }
    }
    without
}

/// Each limb's fit, limbs side by side.
pub(crate) fn fit_limbs<'a>(
    recording: &'a Recording,
    model: &'a Model,
    constraint: Constraint,
    tilt: Option<[f64; 2]>,
) -> Vec<LimbFit<'a>> {
    std::thread::scope(|scope| {
        let limbs = recording.limbs.iter();
        let work: Vec<_> = limbs
            .map(|(limb, data)| scope.spawn(move || LimbFit::of(model, limb, data, constraint, tilt)))
            .collect();
        let done = work.into_iter().map(|limb| {
            // A panic goes on.
            limb.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        done.flatten().collect()
    })
}

/// Roll and pitch of the one base, from what each limb says of it: means weighted by their errors, and their errors.
fn common_tilt(fits: &[LimbFit]) -> [(f64, f64); 2] {
    let mut sums = [[0.0; 2]; 2];
    for fit in fits {
        let std = Deviations::of(fit).larger();
        for entry in fit.criticism.columns.of_effect(EffectKind::BaseTilt, BASE) {
            let weight = std[entry].powi(-2);
            let sum = &mut sums[fit.criticism.columns.entries[entry].parameter];
            sum[0] += weight;
            sum[1] += weight * fit.value(entry);
        }
    }
    sums.map(|[weight, sum]| (sum / weight, weight.powf(-0.5)))
}

/// A parameter's name: `m:FR_hip`, `coulomb:FR_hip`, and beyond an effect's first parameter `stribeck.vs:FR_hip`.
pub(crate) fn entry_name(model: &Model, limb: &Limb, entry: &Entry) -> String {
    let joint = if entry.joint == BASE { BASE } else { limb.bodies.start + entry.joint };
    let joint = model.joint_name(joint);
    match entry.effect {
        None => name_at(NAMES[entry.parameter], joint),
        Some(effect) => parameter_name(effect, entry.parameter, joint),
    }
}

/// The name of an effect's parameter at a joint.
pub(crate) fn parameter_name(effect: EffectKind, parameter: usize, joint: &str) -> String {
    match parameter {
        0 => name_at(effect.name(), joint),
        n => name_at(&format!("{}.{}", effect.name(), effect.description().parameters[n].symbol), joint),
    }
}

/// All parameters of a limb: its bodies', its effects' by column, then what is known without a column.
pub(crate) fn parameters(fit: &LimbFit) -> Vec<FittedParameter> {
    let deviations = Deviations::of(fit);
    let prior = fit.problem.without_data().solve();
    let prior_std = prior.as_ref().map(super::physical::Solution::std);
    let entries = fit.criticism.columns.entries.iter().enumerate();
    let mut all: Vec<FittedParameter> = entries
        .filter(|(_, entry)| entry.joint != BASE)
        .map(|(k, entry)| {
            let scale = fit.scale(k);
            let [independent, blocks] = [&deviations.independent, &deviations.blocks].map(|s| s[k] * scale);
            let prior_std = prior_std.as_ref().map_or(f64::INFINITY, |std| std[k] * scale);
            let std = independent.max(blocks);
            let unit = entry
                .effect
                .map_or(UNITS[entry.parameter], |effect| effect.description().parameters[entry.parameter].unit);
            let mean = match k.checked_sub(INERTIAL * fit.problem.bodies.len()) {
                Some(n) => fit.criticism.value(k, fit.problem.others[n].mean),
                None => fit.problem.bodies[k / INERTIAL].0.0[k % INERTIAL],
            };
            FittedParameter {
                estimate: ParameterEstimate {
                    name: entry_name(fit.model, fit.limb, entry),
                    unit,
                    value: fit.value(k),
                    std,
                    prior: mean,
                    prior_std,
                    status: Status::of(std, prior_std),
                    at_bound: fit.solution.held[k],
                },
                std_independent: independent,
                held: entry.effect.map_or(
                    Held::Body(fit.limb.bodies.start + entry.joint, entry.parameter),
                    |effect| Held::Effect(effect, fit.limb.bodies.start + entry.joint, entry.parameter),
                ),
            }
        })
        .collect();
    all.extend(shapes(fit));
    all.extend(velocity_gains(fit));
    all
}

/// The shapes that were scanned.
fn shapes(fit: &LimbFit) -> Vec<FittedParameter> {
    let of = |&(effect, joint): &(EffectKind, usize)| {
        let parameters = effect.description().parameters;
        let n = parameters.iter().position(|p| p.shape)?;
        let body = fit.limb.bodies.start + joint;
        let prior = fit.model.robot().parameter_prior(effect, body, n);
        Some(FittedParameter {
            estimate: ParameterEstimate {
                name: parameter_name(effect, n, fit.model.joint_name(body)),
                unit: parameters[n].unit,
                value: fit.criticism.shape((effect, joint)),
                std: prior.std,
                prior: prior.mean,
                prior_std: prior.std,
                status: Status::Prior,
                at_bound: false,
            },
            std_independent: prior.std,
            held: Held::Shape(effect, body, n),
        })
    };
    let active = fit.criticism.active.iter().filter(|(_, joint)| *joint != BASE);
    active.filter_map(of).collect()
}

/// The velocity gains, which positions tell.
fn velocity_gains(fit: &LimbFit) -> Vec<FittedParameter> {
    let of = |&(effect, joint): &(EffectKind, usize)| {
        if effect != EffectKind::VelocityGain {
            return None;
        }
        let body = fit.limb.bodies.start + joint;
        let prior = fit.model.effect_prior(effect, body).prior;
        let gain = VelocityGain::of(fit.criticism.recording, joint, fit.criticism.blocks);
        let (value, std) = gain.map_or((prior.mean, prior.std), |gain| (gain.value, gain.std));
        Some(FittedParameter {
            estimate: ParameterEstimate {
                name: parameter_name(effect, 0, fit.model.joint_name(body)),
                unit: effect.description().parameters[0].unit,
                value,
                std,
                prior: prior.mean,
                prior_std: prior.std,
                status: Status::of(std, prior.std),
                at_bound: false,
            },
            std_independent: std,
            held: Held::Effect(effect, body, 0),
        })
    };
    fit.criticism.active.iter().filter_map(of).collect()
}
