//! Estimates into a model, where they can be.

use std::array;

use proprio_core::inertia::InertialParameters;

use crate::catalogue;
use crate::estimate::{ParameterEstimate, find};
use crate::model::{Impossible, Model, Witness};
use crate::parameter::{INERTIAL_NAMES, name_at};

/// A value that was identified but that no model may hold.
#[derive(Debug, thiserror::Error)]
#[error("what was identified of {of} cannot be: {fault}")]
pub struct NotAModel {
    /// The joint, or the body that it moves.
    pub of: String,
    /// Why not.
    pub fault: Impossible,
}

/// Sets each body and each effect of the Go2's `model` to what was identified of it, where that can be; says what cannot.
pub fn set_possible(parameters: &[ParameterEstimate], model: &mut Model) -> Vec<NotAModel> {
    let joints = model.robot().bodies().iter();
    let joints: Vec<String> = joints.map(|body| body.name.clone()).collect();
    let mut impossible = Vec::new();
    for (joint, of) in joints.into_iter().enumerate() {
        let own = parameters
            .iter()
            .filter(|p| p.name.ends_with(&format!(":{of}")));
        let (inertial, effects): (Vec<_>, Vec<_>) =
            own.cloned().partition(ParameterEstimate::is_inertial);
        for part in effects.chunks(1).chain([&inertial[..]]) {
            if let Err(fault) = set_joint(part, model, joint, &of) {
                let of = part.first().map_or(of.clone(), |p| p.name.clone());
                impossible.push(NotAModel { of, fault });
            }
        }
    }
    impossible
}

/// Sets a body, and what its joint has, to what was identified of them.
pub(crate) fn set_joint(
    parameters: &[ParameterEstimate],
    model: &mut Model,
    joint: usize,
    of: &str,
) -> Result<(), Impossible> {
    let found = |what: &str| find(parameters, &name_at(what, of));
    let inertial = INERTIAL_NAMES.map(|(what, _)| found(what));
    if inertial.iter().all(Option::is_some) {
        let phi = array::from_fn(|k| inertial[k].map_or(0.0, |p| p.value));
        let std = array::from_fn(|k| inertial[k].map_or(0.0, |p| p.std));
        model.set_body(joint, &InertialParameters(phi.into()), Some(&std))?;
    }
    for effect in catalogue::effects() {
        if let Some(parameter) = found(effect.name()) {
            model.set_measured(
                effect,
                joint,
                Witness::Motion,
                parameter.value,
                parameter.std,
            )?;
        }
    }
    Ok(())
}
