//! From logs to parameters: what `proprio identify` does.
//!
//! 1. `model_fit`: a model's effects, or the four of a plain drive, fitted to a recording by the one estimator ([`crate::estimate`]).
//! 2. `runs`: several logs, each on its own, and where they disagree.
//! 3. `bus`: samples as a device receives them over the motor bus.
//! 4. `to_model`: estimates into a model file.
//! 5. `bodies`: bodies that are not the CAD's.
//! 6. `free_base`: the same questions of a robot on a floating base.
//! 7. `screen`: what their first screens have in common.

mod bodies;
mod bus;
mod free_base;
pub(crate) mod model_fit;
mod runs;
mod screen;
mod to_model;

use std::path::PathBuf;

use proprio_core::effect::EffectKind;

use crate::detect::mismatch::{MismatchKind, mismatches};
pub use crate::estimate::Method;
pub use crate::estimate::stages::{Stage, StageParameter};
use crate::model::{Model, Robot};
use crate::recording::{Recording, RecordingError};
pub use bodies::{BodyQuantity, OtherBody};
pub(crate) use bodies::{other_bodies, released};
pub use bus::received;
pub use free_base::{FreeBaseIdentification, Quantity, identify_free_base};
pub(crate) use free_base::{
    quantities, set_walk, total_std, walk_bodies, walk_parameters, without_loaded,
};
pub use model_fit::{
    FitOptions, Fitted, FittedJoint, FittedParameter, NotReproduced, Where, check_reproduced,
    fit_model,
};
pub use runs::{Consistency, Run, RunValue};
pub(crate) use screen::{by_effect, drive_rows};
pub use to_model::{NotAModel, set_possible};

/// What `identify` has read, of which model, and what came out.
#[derive(Debug, Clone)]
pub struct Identified {
    /// The samples of all logs.
    pub recording: Recording,
    /// The model that was fitted: the one given, or [`plain`].
    pub model: Model,
    /// Its parameters.
    pub fitted: Fitted,
}

/// Identifies the parameters of `model`, or without one those of a [`plain`] Go2, from its `logs`, taken together; of several logs each is
/// also fitted on its own. Of each log the time counts in which the conditions `only` hold ([`Recording::only`]). `progress` receives the bytes read, and
/// how many there are in all.
///
/// # Errors
/// [`RecordingError`]; the first bad log stops the work.
pub fn identify(
    logs: &[PathBuf],
    model: Option<&Model>,
    (options, only): (FitOptions, &[String]),
    mut progress: impl FnMut(u64, u64),
) -> Result<Identified, RecordingError> {
    let cad = Model::default();
    let read_as = model.unwrap_or(&cad);
    let recording = read(logs, only, read_as, options, &mut progress)?;
    let model = model.map_or_else(|| plain(&recording), Model::clone);
    let fitted = identify_recording(&recording, &model, options, &mut progress)?;
    Ok(Identified {
        recording,
        model,
        fitted,
    })
}

/// The same of a recording that was read already.
///
/// # Errors
/// As [`identify`]'s.
pub fn identify_recording(
    recording: &Recording,
    model: &Model,
    options: FitOptions,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Fitted, RecordingError> {
    let mut fitted = fit_model(recording, model, options)?;
    if recording.logs.len() > 1 {
        let (mut each, mut fits) = (Vec::new(), Vec::new());
        for log in &recording.logs {
            let log = std::slice::from_ref(log);
            let own = read(log, &recording.only, model, options, progress)?;
            let fitted = fit_model(&own, model, options)?;
            each.push(Run::of(&own, fitted.rms, fitted.held_out_rms));
            fits.push(fitted);
        }
        fitted.compare_runs(each, &fits);
    }
    let is_go2 = *model.robot() == Robot::go2();
    let wrong = mismatches(recording, model);
    let wrong = wrong.iter().map(|wrong| {
        let may_walk = is_go2 && matches!(wrong.kind, MismatchKind::NoBetterThanNothing(_));
        let walks = match may_walk {
            true => "; of a Go2 that walks or stands: proprio identify --free-base",
            false => "",
        };
        format!("{wrong}{walks}")
    });
    fitted.warnings.extend(wrong);
    let other = fitted.other_bodies(model);
    fitted
        .warnings
        .extend(other.iter().map(ToString::to_string));
    Ok(fitted)
}

fn read(
    logs: &[PathBuf],
    only: &[String],
    model: &Model,
    options: FitOptions,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<Recording, RecordingError> {
    let mut recording = Recording::read_only(logs, only, model, progress)?;
    if options.bus {
        bus::round(&mut recording);
    }
    Ok(recording)
}

/// The Go2 with what every drive has at each joint of the legs that were recorded: viscous and Coulomb friction, armature, torque offset.
/// The order is that of `proprio add viscous coulomb armature bias`, so that both give the same numbers to the last digit.
pub fn plain(recording: &Recording) -> Model {
    let mut model = Model::default();
    let mut joints: Vec<usize> = (recording.limbs.iter())
        .flat_map(|(limb, _)| limb.bodies.clone())
        .collect();
    joints.sort_unstable();
    for effect in EffectKind::PLAIN {
        for &joint in &joints {
            model.add_effect(effect, joint);
        }
    }
    model
}

#[cfg(test)]
mod tests;
