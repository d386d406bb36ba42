//! What a search over walks found, as a diagnosis.

use std::path::{Path, PathBuf};

use proprio_core::go2::{JOINT_NAMES, JOINTS};

use super::FreeBaseDiagnosis;
use super::search::{Found, Tried, Value};
use crate::diagnose::{
    Alternative, CandidateReport, Diagnosis, JointError, ParameterReport, PathStep, Verdict,
};
use crate::free_base::Walks;
use crate::free_base::data::{Data, Left};
use crate::free_base::fit::rms;
use crate::free_base::rows::EFFECTS;
use crate::free_base::structure::ModelStructure;
use crate::model::Robot;
use crate::select::criteria::{LEAST_Z, RESOLUTION, STRUCTURE};
use crate::summary::{Summary, joints_in_words, torque, typed, word};
use crate::table::with_std;

use super::candidate::Candidate;
use crate::diagnose::NEW_MODEL;

/// A load's parameters as they are told.
const LOAD: [(&str, &str); 4] = [("m", "kg"), ("x", "m"), ("y", "m"), ("z", "m")];

/// The diagnosis; none if numbers overflow.
pub(super) fn diagnosis(
    logs: &[PathBuf],
    walks: &Walks,
    data: &Data,
    given: &ModelStructure,
    found: &Found,
) -> Option<Diagnosis> {
    let [before, after, floor] = [given, &found.structure, &given.with_everything()]
        .map(|structure| data.held_out(structure));
    let (before, after, floor) = (before?, after?, floor?);
    let thetas: Vec<Vec<_>> = [&before, &after, &floor]
        .iter()
        .map(|parts| parts.iter().map(|part| &part.theta).collect())
        .collect();
    let left = data.by_coordinate(walks, &thetas);
    let outside_catalogue = outside(&left[1], &walks.torque_rms());
    let first: Vec<&Tried> = found.first.iter().collect();
    let candidates: Vec<CandidateReport> = first.iter().map(|t| report(t, &first)).collect();
    let missing = !found.path.is_empty() || !outside_catalogue.is_empty();
    let (reason, next) = reason(found, missing, logs);
    Some(Diagnosis {
        verdict: if missing {
            Verdict::Missing
        } else {
            Verdict::Complete
        },
        reason,
        next,
        candidates,
        path: found
            .path
            .iter()
            .map(|step| PathStep {
                effect: step.candidate.effect(),
                joints: step.candidate.places(),
                held_out_rms: step.rms,
                log_rms: Vec::new(),
                removed: step.removed,
            })
            .collect(),
        held_out_rms: found.start_rms,
        log_rms: Vec::new(),
        // A model of everything learns some of the noise by heart.
        noise_floor_rms: rms(&floor).min(rms(&after)),
        joints: joints(&left, data.windows.used),
        second_encoder: Vec::new(),
        outside_catalogue,
        logs: logs.to_vec(),
        warnings: [walks.warnings.clone(), data.warnings()].concat(),
    })
}

/// Why the verdict, and what to do next.
fn reason(found: &Found, missing: bool, logs: &[PathBuf]) -> (String, String) {
    let Some(step) = found.path.first() else {
        return if missing {
            (
                "something is missing that is neither friction, a rotor, an offset nor a load".to_owned(),
                "look at where the error lives: `proprio compare --free-base` tells it joint by joint".to_owned(),
            )
        } else {
            (
                "no friction, rotor, offset or load makes the error on unseen time smaller beyond its own error".to_owned(),
                "nothing: of what a walk can tell the model explains all".to_owned(),
            )
        };
    };
    let all = JOINT_NAMES.map(str::to_owned);
    let places = joints_in_words(&step.candidate.places(), &all);
    let of = found.first.iter().find(|t| t.candidate == step.candidate);
    let told = of.map_or(String::new(), |t| format!(": {}", values(t)));
    (
        format!("{}, {places}, is missing{told}", step.candidate.effect()),
        format!(
            "proprio diagnose --free-base {} -m MODEL --apply, then compare --free-base",
            typed(logs, None)
        ),
    )
}

/// Each joint's held-out errors.
fn joints(left: &[Left], windows: u64) -> Vec<JointError> {
    let error = |(j, name): (usize, &str)| JointError {
        joint: name.to_owned(),
        n: usize::try_from(windows).unwrap_or(usize::MAX),
        before: left[0].rms[6 + j],
        after: left[1].rms[6 + j],
        floor: left[2].rms[6 + j],
    };
    JOINT_NAMES.into_iter().enumerate().map(error).collect()
}

/// The joints of which what is left goes on from window to window, as noise does not, and is more than a sampled log's errors.
fn outside(left: &Left, torque_rms: &[f64; JOINTS]) -> Vec<String> {
    let least = |j: usize| (LEAST_Z / (left.pairs[6 + j].max(1) as f64).sqrt()).max(STRUCTURE);
    let joints = JOINT_NAMES.into_iter().enumerate();
    let goes_on = joints.filter(|&(j, _)| {
        left.correlation[6 + j] > least(j) && left.rms[6 + j] > RESOLUTION * torque_rms[j]
    });
    let told = goes_on.map(|(j, name)| {
        format!(
            "{name}: of the {} N m that are left neighbouring windows share {:.0} %: neither friction, rotors and offsets nor a load explain that",
            torque(left.rms[6 + j]),
            100.0 * left.correlation[6 + j]
        )
    });
    told.collect()
}

fn report(tried: &Tried, all: &[&Tried]) -> CandidateReport {
    let values = &tried.values;
    let load = matches!(tried.candidate, Candidate::Load { .. });
    let value = match load {
        true => values[0].value,
        false => values.iter().map(|v| v.value).sum::<f64>() / values.len() as f64,
    };
    let std = match load {
        true => values[0].std,
        false => {
            let squares: f64 = values.iter().map(|v| v.std * v.std).sum();
            squares.sqrt() / values.len() as f64
        }
    };
    let parameter = |(symbol, unit), value: &Value| ParameterReport {
        symbol,
        unit,
        value: value.value,
        std: value.std,
    };
    let parameters = match &tried.candidate {
        Candidate::Load { .. } => LOAD
            .into_iter()
            .zip(values)
            .map(|(told, value)| parameter(told, value))
            .collect(),
        Candidate::Effect { effect, .. } => {
            let described = &EFFECTS[*effect].description().parameters[0];
            vec![parameter((described.symbol, described.unit), &values[0])]
        }
    };
    CandidateReport {
        effect: tried.candidate.effect(),
        joints: tried.candidate.places(),
        held_out_gain: tried.gain,
        held_out_gain_error: tried.gain_error,
        z: tried.z,
        value,
        std,
        parameters,
        torque_error_percent: 100.0 * tried.gain,
        in_bounds: tried.in_bounds,
        significant: tried.significant,
        alternatives: alternatives(tried, all),
    }
}

/// What gains as much within the errors, and is neither a part of it nor it a part of that.
fn alternatives(tried: &Tried, all: &[&Tried]) -> Vec<Alternative> {
    let alike = all.iter().filter(|other| {
        let (a, b) = (&tried.candidate, &other.candidate);
        let near = (tried.gain - other.gain).abs() < tried.gain_error.max(other.gain_error);
        tried.significant && other.significant && near && !a.is_part_of(b) && !b.is_part_of(a)
    });
    let named = alike.map(|other| Alternative {
        effect: other.candidate.effect(),
        joints: other.candidate.places(),
    });
    named.collect()
}

/// A candidate's values in words.
fn values(tried: &Tried) -> String {
    let told: Vec<String> = tried
        .values
        .iter()
        .map(|v| with_std(v.value, v.std))
        .collect();
    match (&tried.candidate, told.as_slice()) {
        (Candidate::Load { .. }, [mass, x, y, z]) => {
            format!("{mass} kg at x {x}, y {y}, z {z} m from the body's origin")
        }
        (Candidate::Effect { effect, joints }, [value, ..]) => {
            let unit = EFFECTS[*effect].description().parameters[0].unit;
            match joints.len() {
                1 => format!("{value} {unit}"),
                _ => format!("{value} {unit} at {}", JOINT_NAMES[joints[0]]),
            }
        }
        _ => String::new(),
    }
}

impl FreeBaseDiagnosis {
    /// The first screen: as [`Diagnosis::summary`], but what is missing is added with its value, by `--apply`. `written`: the model file has
    /// it.
    pub fn summary(&self, robot: &Robot, model: Option<&Path>, written: bool) -> Summary {
        let mut summary = self.diagnosis.summary(robot, model);
        if self.diagnosis.path.is_empty() {
            summary.next = vec![format!(
                "proprio compare --free-base {}",
                typed(&self.diagnosis.logs, model)
            )];
            return summary;
        }
        // What is missing, the step that takes most of it away, and what is left at the end.
        let left = summary.points.pop();
        summary.points.truncate(1);
        summary.points.insert(0, self.diagnosis.reason.clone());
        summary.points.extend(left);
        let logs = typed(&self.diagnosis.logs, None);
        let file = word(model.unwrap_or(Path::new(NEW_MODEL)));
        summary.next = vec![match written {
            true => format!("proprio compare --free-base {logs} -m {file}"),
            false => format!("proprio diagnose --free-base {logs} -m {file} --apply"),
        }];
        summary
    }
}
