//! What a search over walks found, as a diagnosis.

use std::path::{Path, PathBuf};

use super::model::{Value, WalkModel};
use super::search::WalkSource;
use super::{FreeBaseDiagnosis, centre, is_load};
use crate::detect::ladder::{WALK, Yardsticks};
use crate::diagnose::formulas::FoundFormula;
use crate::diagnose::{
    CandidateReport, Diagnosis, JointError, NEW_MODEL, ParameterReport, PathStep, Verdict,
};
use crate::equation::values::Place;
use crate::free_base::Walks;
use crate::free_base::data::Left;
use crate::free_base::doubtful;
use crate::free_base::fit::rms;
use crate::free_base::legged::Legged;
use crate::free_base::structure::ModelStructure;
use crate::model::Robot;
use crate::select::candidate::Member;
use crate::select::criteria::{LEAST_Z, RESOLUTION, STRUCTURE};
use crate::select::fitted::Fitted;
use crate::select::ranking::Judged;
use crate::select::search::Found;
use crate::summary::{ErrorRange, Summary, joints_in_words, torque, typed, word};
use crate::table::with_std;

/// A load's parameters as they are told.
const LOAD: [(&str, &str); 4] = [("m", "kg"), ("x", "m"), ("y", "m"), ("z", "m")];

/// The diagnosis, held against what the model leaves as it is given; none if numbers overflow.
pub(super) fn diagnosis(
    logs: &[PathBuf],
    walks: &Walks,
    given: &ModelStructure,
    (yardsticks, as_given): (Yardsticks, &Left),
    found: &Found<WalkSource<'_>>,
    formulas: Vec<FoundFormula>,
) -> Option<Diagnosis> {
    let data = &found.end.data;
    let left = left(&found.end, walks)?;
    let joints_outside = outside(&left, walks).into_iter();
    let outside_catalogue: Vec<String> =
        joints_outside.map(|j| in_words(j, &left, walks)).collect();
    let robot = &walks.robot;
    let candidates: Vec<CandidateReport> = (found.first.iter())
        .map(|judged| report(judged, found, robot))
        .collect();
    let missing = candidates.iter().any(|c| c.significant)
        || !outside_catalogue.is_empty()
        || !formulas.is_empty();
    let (reason, next) = match (candidates.iter().any(|c| c.significant), formulas.first()) {
        (false, Some(formula)) => (
            format!("{}, {}, is missing", formula.torque, formula.joint),
            apply(logs),
        ),
        _ => reason(&candidates, missing, logs, &robot.names),
    };
    Some(Diagnosis {
        kinematics: Vec::new(),
        verdict: if missing {
            Verdict::Missing
        } else {
            Verdict::Complete
        },
        reason,
        next,
        candidates,
        path: found
            .steps
            .iter()
            .map(|step| PathStep {
                effect: step.effect.name(),
                joints: names(&step.members, robot),
                held_out_rms: rms(&step.errors),
                log_rms: Vec::new(),
                removed: step.removed,
            })
            .collect(),
        yardsticks,
        has_values: false,
        changed: Vec::new(),
        held_out_rms: rms(&found.start),
        log_rms: Vec::new(),
        joints: joints([as_given, &left], data.windows.used, robot),
        second_encoder: Vec::new(),
        bodies: Vec::new(),
        bodies_instead: false,
        formulas,
        regimes: Vec::new(),
        load_changes: Vec::new(),
        outside_catalogue,
        every_window: None,
        stands: false,
        logs: logs.to_vec(),
        warnings: [
            walks.warnings.clone(),
            data.warnings(),
            doubtful::sensors(data.columns(), found.end.fit.theta()),
            doubtful::robot(given, found.end.fit.theta()),
        ]
        .concat(),
    })
}

/// Joints, or the bodies that they move; `base` is the trunk.
fn names(members: &[Member], robot: &Legged) -> Vec<String> {
    let members = members.iter();
    let names = members.map(|(_, place)| robot.name(place.1).to_owned());
    names.collect()
}

/// Why the verdict, and what to do next.
fn reason(
    candidates: &[CandidateReport],
    missing: bool,
    logs: &[PathBuf],
    joints: &[String],
) -> (String, String) {
    let Some(best) = candidates.iter().find(|c| c.significant) else {
        return if missing {
            (
                "something is missing that no effect of the catalogue explains".to_owned(),
                "look at where the error lives: `proprio compare --free-base` shows it joint by joint".to_owned(),
            )
        } else {
            (
                "no effect of the catalogue reduces the held-out error significantly".to_owned(),
                "nothing: the model explains what a walk can identify".to_owned(),
            )
        };
    };
    let places = joints_in_words(&best.joints, joints);
    (
        format!("{}, {places}, is missing: {}", best.effect, values(best)),
        apply(logs),
    )
}

/// The command that writes what was found.
fn apply(logs: &[PathBuf]) -> String {
    format!(
        "proprio diagnose --free-base {} -m MODEL --apply, then compare --free-base",
        typed(logs, None)
    )
}

/// What a model leaves of each coordinate's equation, part by part of the time by the fit to the others; none if there are no parts.
pub(super) fn left(model: &WalkModel, walks: &Walks) -> Option<Left> {
    let thetas = model.errors().iter().map(|part| &part.theta).collect();
    model.data.by_coordinate(walks, &[thetas]).pop()
}

/// Each joint's errors of the file as given and at the end.
fn joints(left: [&Left; 2], windows: u64, robot: &Legged) -> Vec<JointError> {
    let error = |(j, name): (usize, &String)| JointError {
        joint: name.clone(),
        n: usize::try_from(windows).unwrap_or(usize::MAX),
        error: ErrorRange {
            floor_unknown: Some(WALK),
            ..ErrorRange::torque(left[0].rms[6 + j], left[1].rms[6 + j], None)
        },
    };
    robot.names.iter().enumerate().map(error).collect()
}

/// The joints of which what is left goes on from window to window, as noise does not, and is more than a sampled log's errors.
pub(super) fn outside(left: &Left, walks: &Walks) -> Vec<usize> {
    let torque_rms = walks.torque_rms();
    let least = |j: usize| (LEAST_Z / (left.pairs[6 + j].max(1) as f64).sqrt()).max(STRUCTURE);
    let goes_on = (0..walks.robot.joints()).filter(|&j| {
        left.correlation[6 + j] > least(j) && left.rms[6 + j] > RESOLUTION * torque_rms[j]
    });
    goes_on.collect()
}

/// What is left of such a joint.
fn in_words(j: usize, left: &Left, walks: &Walks) -> String {
    format!(
        "{}: of the {} N m that are left neighbouring windows share {:.0} %: no effect of the catalogue explains that",
        walks.robot.names[j],
        torque(left.rms[6 + j]),
        100.0 * left.correlation[6 + j]
    )
}

/// What a candidate would add; a load as its mass and its place.
fn report(judged: &Judged, found: &Found<WalkSource<'_>>, robot: &Legged) -> CandidateReport {
    let total = WalkModel::total(&found.start);
    let told =
        crate::diagnose::report::candidate(judged, total, &|members| names(members, robot), &|n| {
            judged.candidate.effect.description().parameters[n].unit
        });
    let (member, effect) = (judged.candidate.members[0], judged.candidate.effect);
    if !is_load(effect) {
        return told;
    }
    let own = match found.end.has(&member) {
        true => found.end.load(member.1.1),
        false => placed(robot, member.1, &judged.parameters[0]),
    };
    let parameters = LOAD.into_iter().zip(own);
    let parameters = parameters.map(|((symbol, unit), (value, std))| ParameterReport {
        symbol,
        unit,
        value,
        std,
    });
    CandidateReport {
        parameters: parameters.collect(),
        ..told
    }
}

/// A load's mass and place from its mass and its first moment about its body's centre of mass.
fn placed(robot: &Legged, place: Place, told: &[Value]) -> Vec<Value> {
    let com = centre(robot, place.1);
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
fn values(report: &CandidateReport) -> String {
    let told: Vec<String> = (report.parameters.iter())
        .map(|own| with_std(own.value, own.std))
        .collect();
    let [first, ..] = &report.parameters[..] else {
        return String::new();
    };
    match (told.as_slice(), report.joints.len()) {
        ([mass, x, y, z], _) if report.parameters[1].symbol == LOAD[1].0 => {
            format!("{mass} kg at x {x}, y {y}, z {z} m from the body's origin")
        }
        (_, 1) => format!("{} {}", told[0], first.unit),
        _ => format!("{} {} at {}", told[0], first.unit, report.joints[0]),
    }
}

impl FreeBaseDiagnosis {
    /// The loads that were found: the body, and mass and place in words.
    fn loads(&self) -> Vec<(String, String)> {
        let path = &self.diagnosis.path;
        let found = |c: &&CandidateReport| {
            let is_step = |step: &PathStep| step.effect == c.effect && step.joints == c.joints;
            path.iter()
                .rev()
                .find(|step| is_step(step))
                .is_some_and(|step| !step.removed)
        };
        let candidates = self.diagnosis.candidates.iter();
        let loads =
            candidates.filter(|c| c.parameters.first().is_some_and(|p| p.symbol == LOAD[0].0));
        let told = loads
            .filter(found)
            .map(|c| (c.joints.join(", "), values(c)));
        told.collect()
    }

    /// The first screen: as [`Diagnosis::summary`], but what is missing is added with its value, by `--apply`. `written`: the model file has
    /// it.
    pub fn summary(&self, robot: &Robot, model: Option<&Path>, written: bool) -> Summary {
        let mut summary = self.diagnosis.summary(robot, model);
        if self.diagnosis.path.is_empty() {
            let logs = &self.diagnosis.logs;
            summary.next = vec![match self.diagnosis.changed.is_empty() {
                true => format!("proprio compare --free-base {}", typed(logs, model)),
                false => {
                    let logs = typed(logs, None);
                    format!("proprio identify --free-base --physical {logs} -o refitted.toml")
                }
            }];
            return summary;
        }
        // How heavy a load is, and where, is what its finder asks first.
        for (place, load) in self.loads() {
            let at = [format!("({place})"), format!(", {place}:")];
            let of_it = |point: &&mut String| at.iter().any(|at| point.contains(at));
            match summary.points.iter_mut().find(of_it) {
                Some(point) => *point += &format!("; {load}"),
                None => summary.points.insert(0, format!("{place}: {load}")),
            }
        }
        let logs = typed(&self.diagnosis.logs, None);
        let file = word(model.unwrap_or(Path::new(NEW_MODEL)));
        summary.next = vec![match written {
            true => format!("proprio compare --free-base {logs} -m {file}"),
            false => format!("proprio diagnose --free-base {logs} -m {file} --apply"),
        }];
        summary
    }
}
