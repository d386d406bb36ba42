//! What a search over walks found, as a diagnosis.

use std::path::{Path, PathBuf};

use proprio_core::effect::EffectKind;
use proprio_core::go2::{self, JOINT_NAMES, JOINTS};

use super::search::{Found, Value};
use super::{FreeBaseDiagnosis, is_load};
use crate::diagnose::{
    Alternative, CandidateReport, Diagnosis, JointError, NEW_MODEL, ParameterReport, PathStep,
    Verdict,
};
use crate::equation::values::Place;
use crate::free_base::Walks;
use crate::free_base::columns::body_of;
use crate::free_base::data::Left;
use crate::free_base::fit::rms;
use crate::free_base::structure::ModelStructure;
use crate::model::Robot;
use crate::select::criteria::{LEAST_Z, RESOLUTION, STRUCTURE};
use crate::select::ranking::Judged;
use crate::summary::{Summary, joints_in_words, torque, typed, word};
use crate::table::with_std;

/// A load's parameters as they are told.
const LOAD: [(&str, &str); 4] = [("m", "kg"), ("x", "m"), ("y", "m"), ("z", "m")];

/// The diagnosis; none if numbers overflow.
pub(super) fn diagnosis(
    logs: &[PathBuf],
    walks: &Walks,
    given: &ModelStructure,
    found: &Found,
) -> Option<Diagnosis> {
    let data = &found.data;
    let [before, after] = [given, &found.structure].map(|structure| data.held_out(structure));
    let (before, after) = (before?, after?);
    let (_, floor) = data.with_all(given)?;
    let thetas = |parts: &[crate::free_base::fit::HeldOut]| -> Vec<_> {
        parts.iter().map(|part| part.theta.clone()).collect()
    };
    let all = [thetas(&before), thetas(&after), floor];
    let floor_rms = data.rms_of_parts(&all[2]);
    let borrowed: Vec<Vec<_>> = all.iter().map(|own| own.iter().collect()).collect();
    let left = data.by_coordinate(walks, &borrowed);
    let outside_catalogue = outside(&left[1], &walks.torque_rms());
    let candidates: Vec<CandidateReport> = (found.first.iter())
        .map(|(judged, load)| report(judged, load.as_deref(), found.start))
        .collect();
    let missing = !found.path.is_empty() || !outside_catalogue.is_empty();
    let (reason, next) = reason(found, &candidates, missing, logs);
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
                effect: step.places[0].0.name(),
                joints: names(step.places.iter().copied()),
                held_out_rms: step.rms,
                log_rms: Vec::new(),
                removed: step.removed,
            })
            .collect(),
        held_out_rms: found.start_rms,
        log_rms: Vec::new(),
        // A model of everything learns some of the noise by heart.
        noise_floor_rms: floor_rms.min(rms(&after)),
        joints: joints(&left, data.windows.used),
        second_encoder: Vec::new(),
        bodies: Vec::new(),
        outside_catalogue,
        logs: logs.to_vec(),
        warnings: [walks.warnings.clone(), data.warnings()].concat(),
    })
}

/// Joints, or the bodies that they move; `base` is the trunk.
fn names(places: impl Iterator<Item = Place>) -> Vec<String> {
    let name = |(_, joint): Place| JOINT_NAMES.get(joint).map_or("base", |name| *name);
    places.map(|place| name(place).to_owned()).collect()
}

/// Why the verdict, and what to do next.
fn reason(
    found: &Found,
    candidates: &[CandidateReport],
    missing: bool,
    logs: &[PathBuf],
) -> (String, String) {
    let Some(step) = found.path.first() else {
        return if missing {
            (
                "something is missing that no effect of the catalogue explains".to_owned(),
                "look at where the error lives: `proprio compare --free-base` tells it joint by joint".to_owned(),
            )
        } else {
            (
                "no effect of the catalogue makes the error on unseen time smaller beyond its own error".to_owned(),
                "nothing: of what a walk can tell the model explains all".to_owned(),
            )
        };
    };
    let all = JOINT_NAMES.map(str::to_owned);
    let (effect, joints) = (step.places[0].0, names(step.places.iter().copied()));
    let of = candidates
        .first()
        .filter(|own| own.effect == effect.name() && own.joints == joints);
    let told = of.map_or(String::new(), |own| format!(": {}", values(effect, own)));
    let places = joints_in_words(&joints, &all);
    (
        format!("{}, {places}, is missing{told}", effect.name()),
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
            "{name}: of the {} N m that are left neighbouring windows share {:.0} %: no effect of the catalogue explains that",
            torque(left.rms[6 + j]),
            100.0 * left.correlation[6 + j]
        )
    });
    told.collect()
}

/// What a candidate would add; `load` is the mass and the place of one that was fitted.
fn report(judged: &Judged, load: Option<&[Value]>, start: f64) -> CandidateReport {
    let (c, effect) = (&judged.candidate, judged.candidate.effect);
    let (gain, error) = c.held_out_gain();
    let first = c.members[0].1;
    let described = effect.description().parameters.iter();
    let named: Vec<((&'static str, &'static str), Value)> = if is_load(effect) {
        let own = load.map_or_else(|| placed(first, &judged.parameters[0]), <[Value]>::to_vec);
        LOAD.into_iter().zip(own).collect()
    } else {
        let names = described.map(|p| (p.symbol, p.unit));
        names.zip(judged.parameters[0].iter().copied()).collect()
    };
    let parameters = named
        .iter()
        .map(|((symbol, unit), (value, std))| ParameterReport {
            symbol,
            unit,
            value: *value,
            std: *std,
        });
    let members = judged.parameters.len() as f64;
    let (value, std) = if members > 1.0 {
        let firsts = || judged.parameters.iter().map(|own| own[0]);
        let squares: f64 = firsts().map(|(_, std)| std * std).sum();
        (
            firsts().map(|(value, _)| value).sum::<f64>() / members,
            squares.sqrt() / members,
        )
    } else {
        named[0].1
    };
    let alternative = |(effect, members): &(EffectKind, Vec<(usize, Place)>)| Alternative {
        effect: effect.name(),
        joints: names(members.iter().map(|(_, place)| *place)),
    };
    CandidateReport {
        effect: effect.name(),
        joints: names(c.members.iter().map(|(_, place)| *place)),
        held_out_gain: gain,
        held_out_gain_error: error,
        z: c.z(),
        value,
        std,
        parameters: parameters.collect(),
        torque_error_percent: 100.0 * c.torque_error_taken() / start.max(f64::MIN_POSITIVE),
        in_bounds: judged.possible,
        significant: judged.significant,
        alternatives: judged.alternatives.iter().map(alternative).collect(),
    }
}

/// A load's mass and place from its mass and its first moment about its body's centre of mass.
fn placed(place: Place, told: &[Value]) -> Vec<Value> {
    let cad = go2::free::<f64>();
    let inertia = &cad.bodies()[body_of(place.1)].inertia;
    let com = inertia.first_moment() / inertia.mass();
    let (mass, std) = told[0];
    let at = |axis: usize| {
        let (moment, moment_std) = told[1 + axis];
        let away = moment / mass;
        let unsure = (moment_std / mass).hypot(away * std / mass);
        (com[axis] + away, unsure)
    };
    std::iter::once((mass, std)).chain((0..3).map(at)).collect()
}

/// A candidate's values in words.
fn values(effect: EffectKind, report: &CandidateReport) -> String {
    let told: Vec<String> = (report.parameters.iter())
        .map(|own| with_std(own.value, own.std))
        .collect();
    match told.as_slice() {
        [mass, x, y, z] if is_load(effect) => {
            format!("{mass} kg at x {x}, y {y}, z {z} m from the body's origin")
        }
        [value, ..] => {
            let unit = report.parameters[0].unit;
            match report.joints.len() {
                1 => format!("{value} {unit}"),
                _ => format!("{value} {unit} at {}", report.joints[0]),
            }
        }
        [] => String::new(),
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
