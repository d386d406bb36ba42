//! Whether logs are of an elastic robot that is excited beyond its springs' antiresonances: what rigid bodies, and a spring at one joint after the
//! other, do not predict. Only logs that record their excitation are asked, for they alone can be judged line by line.

use std::path::PathBuf;

use super::result::{Frf, frf};
use crate::detect::mismatch::{self, Mismatch, MismatchKind};
use crate::log::file_columns;
use crate::model::{JointQuantity, Model};
use crate::recording::Recording;

/// Responses of a robot without springs miss by this at least, in natural logarithms of magnitude: 40 %. Simulated arms excited to 55 Hz miss by 0.50 to
/// 0.93 with antiresonances from 14 to 46 Hz, and stiff ones, of which `diagnose` names what is missing, by 0.13 to 0.15.
const RIGID_MISSES: f64 = 0.35;
/// Springs leave no more than this share of that: of the same soft arms 0.08 to 0.35, with friction in the model or without.
const SPRINGS_LEAVE: f64 = 0.5;

/// What is wrong between a recording and `model`: an elastic robot, or what the motion itself shows.
pub fn mismatches(recording: &Recording, model: &Model) -> Vec<Mismatch> {
    let found = mismatch::mismatches(recording, model);
    let Some(joints) = elastic(&recording.logs, model) else {
        return found;
    };
    let has_spring = |(joint, _): &(String, f64)| {
        let joint = model.robot().joint(joint).ok();
        let k = joint.and_then(|joint| model.joint_quantity(joint, JointQuantity::Elasticity));
        k.is_some_and(|k| k.value > 0.0)
    };
    let has_springs = joints.iter().all(has_spring);
    instead(found, joints, has_springs)
}

/// What to report of an elastic robot instead of what its motion shows: a model that has its springs may predict it, one joint after the other, or not.
fn instead(found: Vec<Mismatch>, joints: Vec<(String, f64)>, has_springs: bool) -> Vec<Mismatch> {
    let fails = |wrong: &Mismatch| matches!(wrong.kind, MismatchKind::NoBetterThanNothing(_));
    if has_springs && !found.iter().any(fails) {
        return found;
    }
    let kind = MismatchKind::Elastic(joints);
    vec![Mismatch { log: None, kind }]
}

/// Joints on springs that the logs excite beyond their antiresonances, Hz; none where they show none.
fn elastic(logs: &[PathBuf], model: &Model) -> Option<Vec<(String, f64)>> {
    let is_excited = |log: &PathBuf| {
        let names = file_columns(log);
        names.iter().any(|name| name.starts_with("ref/"))
    };
    if logs.is_empty() || !logs.iter().all(is_excited) {
        return None;
    }
    let found = frf(logs, Some(model), None).ok()?;
    let error = found.error();
    let (before, after) = (error.before?, error.after?);
    if before < RIGID_MISSES || after > SPRINGS_LEAVE * before {
        return None;
    }
    Some(soft(&found)).filter(|joints| !joints.is_empty())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_elastic_robot_is_no_other_robot_and_springs_that_predict_are_none() {
        let of = |kind| Mismatch { log: None, kind };
        let other = || vec![of(MismatchKind::NoBetterThanNothing(1.4))];
        let late = || vec![of(MismatchKind::Late(0.004))];
        let soft = || vec![("elbow".to_owned(), 17.5)];
        let elastic = vec![of(MismatchKind::Elastic(soft()))];
        for (found, has_springs) in [(other(), false), (late(), false), (other(), true)] {
            assert_eq!(instead(found, soft(), has_springs), elastic);
        }
        assert_eq!(instead(late(), soft(), true), late());
        let words = elastic[0].to_string();
        for part in ["an elastic robot", "elbow 17.5 Hz", "use `proprio frf`"] {
            assert!(words.contains(part), "{part}: {words}");
        }
        assert!(elastic[0].kind.refuses());
    }
}
