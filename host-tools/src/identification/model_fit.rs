//! What `proprio identify --model` does: the effects that a model file names, fitted to logs.

mod result;
mod words;

use proprio_core::effect::EffectKind;
use proprio_core::inertia::{INERTIAL, NAMES, UNITS};

use super::deviation::Deviations;
use super::limb::{How, LimbFit};
use super::method::Method;
use super::runs::{self, Run};
use super::stages::{self, Stage, StageParameter};
use crate::criticism::column::{BASE, Entry};
use crate::criticism::velocity::VelocityGain;
use crate::criticism::{CriticismError, Recording};
use crate::estimate::{Constraint, ParameterEstimate, Status};
use crate::model::{Limb, Model};
use crate::parameter::name_at;
pub use result::{Fitted, FittedJoint, FittedParameter, Place};

/// How a model is fitted.
#[derive(Debug, Clone, Copy, Default)]
pub struct FitOptions {
    /// Whether values may be unphysical.
    pub constraint: Constraint,
    /// By which equation.
    pub method: Method,
    /// Friction first, then inertia: see [`Stage`].
    pub stages: bool,
}

/// Fits `model`, whose values are not looked at but whose priors are, to a recording.
///
/// # Errors
/// [`CriticismError::TooShort`] if no limb has enough samples, [`CriticismError::AtRest`] if no joint moves.
pub fn fit_model(
    recording: &Recording,
    model: &Model,
    options: FitOptions,
) -> Result<Fitted, CriticismError> {
    let without = without_values(model);
    let mut how = How {
        constraint: options.constraint,
        method: options.method,
        tilt: None,
    };
    let mut fits = fit_limbs(recording, &without, how);
    if fits.is_empty() {
        return Err(CriticismError::TooShort {
            duration: recording.duration,
        });
    }
    let rests = |fit: &LimbFit| fit.all.iter().all(|rows| rows.count == 0.0);
    if fits.iter().all(rests) {
        return Err(CriticismError::at_rest(recording));
    }
    let mut tilt = None;
    if without.effect(EffectKind::BaseTilt, BASE).is_some() {
        let common = common_tilt(&fits);
        tilt = Some(common);
        how.tilt = Some(common.map(|(value, _)| value));
        fits = fit_limbs(recording, &without, how);
    }
    let stages = if options.stages {
        go_through_stages(&mut fits)
    } else {
        Vec::new()
    };
    Ok(Fitted::new(recording, &fits, tilt, stages))
}

/// Fits `model` to each log on its own and to all together, and compares the runs.
///
/// # Errors
/// As [`fit_model`]'s, and as [`Recording::read`]'s.
pub fn fit_runs(
    recording: &Recording,
    model: &Model,
    options: FitOptions,
) -> Result<Fitted, CriticismError> {
    let mut all = fit_model(recording, model, options)?;
    if recording.logs.len() < 2 {
        return Ok(all);
    }
    let (mut runs, mut fits) = (Vec::new(), Vec::new());
    for log in &recording.logs {
        let own = Recording::read(std::slice::from_ref(log), model, |_, _| {})?;
        let fitted = fit_model(&own, model, options)?;
        runs.push(Run::of(&own, &fitted));
        fits.push(fitted);
    }
    all.consistency = runs::compare(&fits);
    for disagreement in all.consistency.iter().filter(|c| !c.consistent) {
        runs[disagreement.differs].disagreements += 1;
    }
    all.runs = runs;
    Ok(all)
}

/// The steps of all limbs, parameter by parameter.
fn go_through_stages(fits: &mut [LimbFit]) -> Vec<Stage> {
    let mut parameters: [Vec<StageParameter>; 3] = Default::default();
    let mut sums = [[0.0; 2]; 3];
    for fit in fits {
        let Some(stages) = fit.go_through_stages() else {
            continue;
        };
        for (n, solution) in stages.iter().enumerate() {
            let folds = fit.criticism.blocks.folds;
            let squares = fit.squares(&vec![solution.theta.clone(); folds]);
            sums[n][0] += squares.iter().sum::<f64>();
            sums[n][1] += fit.all.iter().map(|rows| rows.count).sum::<f64>();
            for (k, entry) in fit.criticism.columns.entries.iter().enumerate() {
                if entry.effect.is_some() == (n == 0) {
                    parameters[n].push(StageParameter {
                        name: entry_name(fit.model, fit.limb, entry),
                        value: fit.criticism.value(k, solution.theta[k]),
                    });
                }
            }
        }
    }
    let all = stages::NAMES.into_iter().zip(parameters).zip(sums);
    all.map(|((name, parameters), [square, rows])| Stage {
        name,
        rms: (square / f64::max(rows, 1.0)).sqrt(),
        parameters,
    })
    .collect()
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
    how: How,
) -> Vec<LimbFit<'a>> {
    std::thread::scope(|scope| {
        let limbs = recording.limbs.iter();
        let work: Vec<_> = limbs
            .map(|(limb, data)| scope.spawn(move || LimbFit::of(model, limb, data, how)))
            .collect();
        let done = work.into_iter().map(|limb| {
            // A panic goes on.
            limb.join()
                .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        });
        done.flatten().collect()
    })
}

/// Roll and pitch of the one base, from what each limb says of it: means weighted by their errors, and their errors.
fn common_tilt(fits: &[LimbFit]) -> [(f64, f64); 2] {
    let mut sums = [[0.0; 2]; 2];
    for fit in fits {
        let deviations = Deviations::of(fit);
        for entry in fit.criticism.columns.of_effect(EffectKind::BaseTilt, BASE) {
            let [independent, blocks] = deviations.of_parameter(entry);
            let weight = independent.max(blocks).powi(-2);
            let sum = &mut sums[fit.criticism.columns.entries[entry].parameter];
            sum[0] += weight;
            sum[1] += weight * fit.value(entry);
        }
    }
    sums.map(|[weight, sum]| (sum / weight, weight.powf(-0.5)))
}

/// A parameter's name: `m:FR_hip`, `coulomb:FR_hip`, and beyond an effect's first parameter `stribeck.vs:FR_hip`.
pub(crate) fn entry_name(model: &Model, limb: &Limb, entry: &Entry) -> String {
    let joint = if entry.joint == BASE {
        BASE
    } else {
        limb.bodies.start + entry.joint
    };
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
        n => name_at(
            &format!(
                "{}.{}",
                effect.name(),
                effect.description().parameters[n].symbol
            ),
            joint,
        ),
    }
}

/// All parameters of a limb: its bodies', its effects' by column, then what is known without a column.
pub(crate) fn parameters(fit: &LimbFit) -> Vec<FittedParameter> {
    let deviations = Deviations::of(fit);
    let prior = fit.problem.without_data().solve();
    let prior_std = prior.as_ref().map(super::physical::Solution::std);
    let there = fit.problem.prior_root(&fit.solution.theta);
    let entries = fit.criticism.columns.entries.iter().enumerate();
    let mut all: Vec<FittedParameter> = entries
        .filter(|(_, entry)| entry.joint != BASE)
        .map(|(k, entry)| {
            let scale = fit.scale(k);
            let [independent, blocks] = deviations.of_parameter(k).map(|std| std * scale);
            let prior_std = prior_std
                .as_ref()
                .map_or(f64::INFINITY, |std| std[k] * scale);
            let std = independent.max(blocks).hypot(fit.criticism.scan_error(k));
            let unit = entry.effect.map_or(UNITS[entry.parameter], |effect| {
                effect.description().parameters[entry.parameter].unit
            });
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
                    status: Status::there(std, prior_std, independent, there.row(k).norm() * scale),
                    at_bound: fit.solution.held[k],
                },
                std_independent: independent,
                place: entry.effect.map_or(
                    Place::Body(fit.limb.bodies.start + entry.joint, entry.parameter),
                    |effect| {
                        Place::Effect(effect, fit.limb.bodies.start + entry.joint, entry.parameter)
                    },
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
        let n = effect.description().shape()?;
        let body = fit.limb.bodies.start + joint;
        let prior = fit.model.robot().parameter_prior(effect, body, n);
        let value = fit.criticism.shape((effect, joint));
        let mut shape =
            FittedParameter::of_effect(fit.model, (effect, body, n), (value, prior.std), prior);
        shape.estimate.status = Status::Prior;
        shape.place = Place::Shape(effect, body, n);
        Some(shape)
    };
    let active = fit
        .criticism
        .active
        .iter()
        .filter(|(_, joint)| *joint != BASE);
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
        let gain = VelocityGain::of(fit.criticism.recording, joint, &fit.criticism.blocks);
        let told = gain.map_or((prior.mean, prior.std), |gain| (gain.value, gain.std));
        Some(FittedParameter::of_effect(
            fit.model,
            (effect, body, 0),
            told,
            prior,
        ))
    };
    fit.criticism.active.iter().filter_map(of).collect()
}
