//! `calibrate`: from poses to what is reported of them, and what that makes of the model.

use serde::Serialize;

use super::applied::applied;
use super::chain::{Chain, State, Target};
use super::columns::{numbers, rows};
use super::error::CalibrateError;
use super::fit::Problem;
use super::held_out::place_rms;
use super::identifiable;
use super::poses::{Carrier, Poses};
use super::reported::{name, report};
use super::search;
use super::witnesses::{self, Witnessed};
use super::{gates, moved, start};
use crate::model::{Model, Provenance};
use crate::summary::ErrorRange;

/// Fewest poses that anything is found from.
const LEAST_POSES: usize = 5;
/// With fewer numbers than so many for each combination, nothing that is found does not mean that nothing is missing.
const FEW: usize = 2;

/// A rung of the ladder.
#[derive(Debug, Clone, Serialize)]
pub struct Step {
    /// `as_given`, `mount` or `add`.
    pub step: &'static str,
    /// What was added.
    pub effect: Option<&'static str>,
    /// At which joints; empty for the whole robot.
    pub joints: Vec<String>,
    /// Held-out error, mm.
    pub error: f64,
}

/// A candidate as it was judged.
#[derive(Debug, Clone, Serialize)]
pub struct Candidate {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
    /// How much smaller the held-out error is with it, mm; negative where it is larger.
    pub held_out_gain: f64,
    /// The mean gain over poses in its standard errors.
    pub z: f64,
    /// Whether it is part of the result.
    pub taken: bool,
    /// What these poses cannot separate from it.
    pub alternatives: Vec<Alternative>,
}

/// What cannot be separated from another.
#[derive(Debug, Clone, Serialize)]
pub struct Alternative {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
}

/// A value.
#[derive(Debug, Clone, Serialize)]
pub struct Value {
    /// `dx:link_geometry:A2`, `1/k:elasticity:A2`, `x:mount`, `x:tool:ball`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Its value.
    pub value: f64,
    /// Its standard deviation, by the scatter over poses.
    pub std: f64,
    /// Standard deviation before the data.
    pub prior_std: f64,
    /// `identified`, `prior` (within two deviations of nothing, or hardly better known than before) or `unexcited`.
    pub status: &'static str,
}

/// The error at a pose.
#[derive(Debug, Clone, Serialize)]
pub struct PoseError {
    /// The pose: line, row.
    pub pose: String,
    /// The target.
    pub target: String,
    /// Held-out error with the mount and the targets alone placed, mm.
    pub before: f64,
    /// Held-out error of the result, mm.
    pub after: f64,
    /// Where the target was measured, in the base's frame, m.
    pub place: [f64; 3],
    /// The errors as vectors in the base's frame, mm.
    pub before_vector: [f64; 3],
    /// The same after.
    pub after_vector: [f64; 3],
}

/// How much a joint's corrections move the targets.
#[derive(Debug, Clone, Serialize)]
pub struct JointShare {
    /// The joint.
    pub joint: String,
    /// Root mean square over poses and targets, mm.
    pub moves: f64,
}

/// A pose that was left out.
#[derive(Debug, Clone, Serialize)]
pub struct Outlier {
    /// The pose.
    pub pose: String,
    /// Its error by the others, mm.
    pub error: f64,
}

/// What was found.
#[derive(Debug, Clone, Serialize)]
pub struct Calibration {
    /// `missing` or `complete`.
    pub verdict: &'static str,
    /// Poses used.
    pub poses: usize,
    /// Numbers measured at them.
    pub numbers: usize,
    /// Parameters of the result.
    pub unknowns: usize,
    /// Combinations of them that poses of this robot can determine at all.
    pub identifiable: usize,
    /// Held-out error of orientations after, mrad.
    pub turn_error: Option<f64>,
    /// Noise of a place, one axis, that the residuals show, mm.
    pub noise: f64,
    /// The ladder.
    pub path: Vec<Step>,
    /// All candidates, best first.
    pub candidates: Vec<Candidate>,
    /// All values.
    pub parameters: Vec<Value>,
    /// Errors by pose and target.
    pub by_pose: Vec<PoseError>,
    /// By joint.
    pub by_joint: Vec<JointShare>,
    /// Poses left out.
    pub outliers: Vec<Outlier>,
    /// Springs and gaps that others than these poses have measured too.
    pub witnesses: Vec<crate::model::Witnessed>,
    /// What a user should know.
    pub warnings: Vec<String>,
    /// The model with the values.
    #[serde(skip)]
    pub(super) model: Model,
}

/// Finds what is wrong with the model's kinematics.
///
/// # Errors
/// [`CalibrateError`]: poses that are wrong or too few; nothing is found then.
pub fn calibrate(
    poses: &Poses,
    model: &Model,
    only_offsets: bool,
) -> Result<Calibration, CalibrateError> {
    let chain = Chain::new(model);
    let (nominal, links) = nominal(poses, model)?;
    let (once, repeated) = poses.once();
    if poses.count() >= LEAST_POSES {
        gates::different(poses, LEAST_POSES)?;
    }
    let poses = &once;
    let mut warnings = not_recorded(&chain, poses, model, &nominal);
    if repeated > 0 {
        warnings.push(format!(
            "{repeated} rows repeat all numbers of an earlier pose: each pose is counted once"
        ));
    }
    if poses.count() < LEAST_POSES {
        let used: Vec<_> = poses.poses.iter().enumerate().collect();
        let needed = start::columns(&nominal, &used).len();
        let open = format!("; {LEAST_POSES} poses are the least");
        return Err(too_few(poses, needed, open));
    }
    let (started, _) = gates::check(&chain, &nominal, poses, model)?;
    let problem = Problem {
        chain: &chain,
        poses,
        used: (0..poses.count()).collect(),
    };
    let needed = enough(&problem, model, &started, only_offsets)?;
    let given = given(&problem, model)?;
    let mut found = search::search(&chain, poses, &started, only_offsets)?;
    let problem = Problem {
        used: found.used.clone(),
        ..problem
    };
    moved::check(&problem, &found.fit)?;
    if found.path.len() == 1 && found.fit.rows.b.len() < FEW * needed {
        warnings.push(format!(
            "{} numbers for {needed} combinations of parameters: what is missing may not show; measure more poses (`proprio excite --poses 30`)",
            found.fit.rows.b.len()
        ));
    }
    let mut witnessed = Witnessed {
        fit: found.fit.clone(),
        own: Vec::new(),
    };
    if !only_offsets {
        witnessed = witnesses::witnessed(&problem, model, &found.fit);
        found.fit = witnessed.fit.clone();
        if let Some(last) = found.path.last_mut() {
            last.error = found.fit.error_mm();
        }
    }
    let mut calibration = report(&problem, model, &found, given, warnings);
    calibration.model = applied(&chain, poses, model, &witnessed, &links)?;
    calibration.witnesses = calibration.model.witnessed();
    let contradictions = calibration.model.contradictions();
    calibration.warnings.extend(contradictions);
    Ok(calibration)
}

/// The state before anything is known, and what carries each target.
pub(super) fn nominal(
    poses: &Poses,
    model: &Model,
) -> Result<(State, Vec<Carrier>), CalibrateError> {
    let carriers = (0..poses.targets.len())
        .map(|target| poses.carrier(model, target))
        .collect::<Result<Vec<_>, _>>()?;
    let targets = carriers.iter().map(|carrier| Target {
        body: carrier.body,
        placement: carrier.placement,
    });
    Ok((State::nominal(model, targets.collect()), carriers))
}

/// The state that the file states, if it places the measuring system and every target.
pub(super) fn stated(poses: &Poses, model: &Model) -> Result<Option<State>, CalibrateError> {
    let (mut nominal, _) = nominal(poses, model)?;
    let known = model.kinematics();
    for (target, name) in nominal.targets.iter_mut().zip(&poses.targets) {
        let Some(tool) = known.tools.iter().find(|tool| tool.name == *name) else {
            return Ok(None);
        };
        target.placement = target.placement.compose(&tool.fixture.transform());
    }
    let stated = known.mount.is_some();
    Ok(stated.then(|| State::of_model(model, nominal.targets)))
}

/// The error of the file as given, m, if it states all that is needed.
fn given(problem: &Problem, model: &Model) -> Result<Option<f64>, CalibrateError> {
    let Some(state) = stated(problem.poses, model)? else {
        return Ok(None);
    };
    let used = problem.used();
    let rows = rows(problem.chain, &state, &used, &[], start::UNKNOWN_NOISE);
    Ok(Some(place_rms(&rows, &rows.b)))
}

/// Joints between the base and a target whose positions are not recorded.
fn not_recorded(chain: &Chain, poses: &Poses, model: &Model, state: &State) -> Vec<String> {
    let mut joints: Vec<usize> = (state.targets.iter())
        .flat_map(|target| chain.path(target.body))
        .filter(|joint| !poses.joints.contains(joint))
        .collect();
    joints.sort_unstable();
    joints.dedup();
    let names: Vec<&str> = joints
        .iter()
        .map(|&joint| model.joint_name(joint))
        .collect();
    if names.is_empty() {
        return Vec::new();
    }
    vec![format!("{}: no column q/…, taken as 0", names.join(", "))]
}

fn too_few(poses: &Poses, needed: usize, open: String) -> CalibrateError {
    CalibrateError::TooFew {
        poses: poses.count(),
        rows: poses.poses.iter().map(numbers).sum(),
        needed,
        open,
    }
}

/// How many combinations there are to find; refuses poses that give fewer numbers.
fn enough(
    problem: &Problem,
    model: &Model,
    state: &State,
    only_offsets: bool,
) -> Result<usize, CalibrateError> {
    let columns = search::frames_and_fixtures(problem, state, only_offsets);
    let needed = identifiable::rank(problem, model.robot(), state, &columns);
    let rows: usize = problem.poses.poses.iter().map(numbers).sum();
    if rows >= needed {
        return Ok(needed);
    }
    let fit = problem.fit(columns, state, start::UNKNOWN_NOISE);
    let names: Vec<String> = identifiable::open(&fit)
        .iter()
        .map(|column| name(problem, model, column.unknown))
        .collect();
    let open = match names.len() {
        0 => String::new(),
        n if n > 8 => format!("; {n} stay open, such as {}", names[..8].join(", ")),
        _ => format!("; open stay {}", names.join(", ")),
    };
    Err(too_few(problem.poses, needed, open))
}

impl Calibration {
    /// The model with the values ±, and where they come from; what motion logs gave it stays.
    ///
    /// # Errors
    /// The path of a file that cannot be read any more, and why.
    pub fn to_model(&self, poses: &Poses) -> Result<Model, (String, std::io::Error)> {
        let mut model = self.model.clone();
        let mut provenance = Provenance::of(&poses.files)?;
        if let Some(earlier) = model.provenance() {
            let mut logs = earlier.logs.clone();
            logs.retain(|log| provenance.logs.iter().all(|new| new.sha256 != log.sha256));
            logs.append(&mut provenance.logs);
            provenance.logs = logs;
        }
        model.set_provenance(provenance);
        Ok(model)
    }

    /// The errors, as JSON has them.
    pub fn error(&self) -> ErrorRange {
        ErrorRange {
            before: self.path.first().map(|step| step.error),
            after: self.path.last().map(|step| step.error),
            floor: None,
            floor_unknown: Some("no pose was measured twice"),
            unit: "mm",
        }
    }
}
