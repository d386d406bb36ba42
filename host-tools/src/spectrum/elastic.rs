//! Whether logs are of an elastic robot that is excited beyond its springs' antiresonances: what rigid bodies, and a spring at one joint after the
//! other, do not predict. Only logs that record their excitation are asked, for they alone can be judged line by line.

use std::path::PathBuf;

use super::result::{Frf, frf};
use crate::detect::mismatch::{self, Mismatch, MismatchKind};
use crate::log::file_columns;
use crate::model::Model;
use crate::recording::Recording;

/// Responses of a robot without springs miss by this at least, in natural logarithms of magnitude: 40 %. Simulated arms excited to 55 Hz miss by 0.50 to
/// 0.93 with antiresonances from 12 to 46 Hz, and stiff ones, of which `diagnose` names what is missing, by 0.13 to 0.15.
const RIGID_MISSES: f64 = 0.35;
/// Springs leave no more than this share of that: of the same soft arms 0.08 to 0.35, with friction in the model or without.
const SPRINGS_LEAVE: f64 = 0.5;

/// What is wrong between a recording and `model`: an elastic robot, or what the motion itself says.
pub fn mismatches(recording: &Recording, model: &Model) -> Vec<Mismatch> {
    match elastic(&recording.logs, model) {
        // What rigid bodies make of such a motion says nothing.
        Some(kind) => vec![Mismatch { log: None, kind }],
        None => mismatch::mismatches(recording, model),
    }
}

fn elastic(logs: &[PathBuf], model: &Model) -> Option<MismatchKind> {
    let is_excited = |log: &PathBuf| {
        let names = file_columns(log);
        names.iter().any(|name| name.starts_with("ref/"))
    };
    if logs.is_empty() || !logs.iter().all(is_excited) {
        return None;
    }
    let found = frf(logs, Some(model)).ok()?;
    let error = found.error();
    let (before, after) = (error.before?, error.after?);
    if before < RIGID_MISSES || after > SPRINGS_LEAVE * before {
        return None;
    }
    let joints = soft(&found);
    (!joints.is_empty()).then_some(MismatchKind::Elastic(joints))
}

/// Joints whose springs are identified and have their antiresonance, Hz, among the fitted lines.
fn soft(found: &Frf) -> Vec<(String, f64)> {
    let identified = found.identified_springs();
    let of = |(joint, _): (usize, _)| {
        let mode = found.modes.get(joint)?;
        let f = mode.antiresonance.value;
        (f < found.fitted_to?).then(|| (mode.joint.clone(), f))
    };
    identified.filter_map(of).collect()
}
