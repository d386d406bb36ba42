//! Which physical effect is missing: the verdict, the ranked effects and the way to a model that lacks none.

mod bodies;
mod changed;
mod complete;
mod contact;
mod formulas;
mod free_base;
mod geometry;
mod outside;
mod path;
mod report;
mod summary;
mod text;

use std::path::PathBuf;

use proprio_core::effect::EffectKind;
use serde::{Serialize, Serializer};

use crate::detect::contact::{LeftOut, leave_out_contact};
use crate::detect::every_window::EveryWindow;
use crate::detect::frame::OtherFrame;
use crate::detect::ladder::{self, JointLadder, Yardsticks};
use crate::detect::load_change::LoadChange;
use crate::detect::mismatch::Mismatch;
use crate::detect::regime::Regime;
use crate::detect::twist::Twist;
use crate::equation::folds::LEAST_HELD_OUT;
use crate::equation::values::Place;
use crate::equation::velocity::VelocityGain;
use crate::estimate::fit::LimbFit;
use crate::estimate::limb_data::{LimbData, Squares};
use crate::estimate::robot;
use crate::identify::OtherBody;
use crate::identify::model_fit::places_of;
use crate::model::{JointQuantity, Model};
use crate::parallel::side_by_side;
use crate::recording::{Recording, RecordingError};
use crate::select::limbs::Limbs;
use crate::select::search::{Found, search};
use crate::select::state::how;
use crate::summary::ErrorRange;
use bodies::Instead;
pub use changed::ChangedValue;
pub use formulas::FoundFormula;
pub use free_base::{FreeBaseDiagnosis, diagnose_free_base};
use report::report;
pub(crate) use summary::NEW_MODEL;

/// What `proprio diagnose` says.
#[derive(Debug, Clone, Serialize)]
pub struct Diagnosis {
    /// Whether an effect is missing.
    pub verdict: Verdict,
    /// Why, in words.
    pub reason: String,
    /// What to do next, in words.
    pub next: String,
    /// What each effect would add to the model as it was given, best first.
    pub candidates: Vec<CandidateReport>,
    /// Forward-backward selection: the error after each step. As JSON it is [`rungs`](Self::rungs).
    #[serde(skip)]
    pub path: Vec<PathStep>,
    /// What an error is to be measured against.
    #[serde(flatten)]
    pub yardsticks: Yardsticks,
    /// Whether the model file gives values: else it is as given the CAD alone.
    #[serde(skip)]
    pub has_values: bool,
    /// Values of the model file that the logs contradict, the surest first.
    #[serde(rename = "moved")]
    pub changed: Vec<ChangedValue>,
    /// Held-out error of the effects that the model was given, their values fitted anew, root mean square over all joints, N m.
    pub held_out_rms: f64,
    /// The same of each log, predicted by the others; empty where logs are not held out as a whole.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub log_rms: Vec<f64>,
    /// Each joint's error.
    pub joints: Vec<JointError>,
    /// What second encoders show of gears that give way and the model does not know, in words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub second_encoder: Vec<String>,
    /// Bodies that are not the CAD's, in words.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bodies: Vec<String>,
    /// Whether these bodies and the drives' own effects predict as well as all effects that are named.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub bodies_instead: bool,
    /// Joints whose frames are not where the description has them; the path has them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub kinematics: Vec<FoundFrame>,
    /// Torques outside the catalogue that explain what it leaves; the path has them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub formulas: Vec<FoundFormula>,
    /// What is left when the catalogue is exhausted, if it is more than noise.
    pub outside_catalogue: Vec<String>,
    /// Where of a joint's motion, or from when on, what is left of it lives; each is in a sentence of that too.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub regimes: Vec<Regime>,
    /// Loads that come or go within the log, which are sentences of that too.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub load_changes: Vec<LoadChangeReport>,
    /// Of long logs, of which all the rest here is of a drawn part: the errors over every window.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every_window: Option<EveryWindow>,
    /// Whether a foot carries a force at times, which are left out.
    #[serde(skip)]
    pub stands: bool,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
}

/// Whether an effect is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The model lacks something.
    Missing,
    /// Nothing is missing that these data can tell.
    Complete,
    /// The data are too short or too poor to say.
    Insufficient,
}

/// A load that comes or goes within a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LoadChangeReport {
    /// The joint that moves the link that carries it.
    pub joint: String,
    /// When, s.
    pub from: f64,
    /// What comes, kg; negative: what goes.
    pub mass: f64,
    /// Its standard deviation, kg.
    pub std: f64,
}

/// What an effect would add.
#[derive(Debug, Clone, Serialize)]
pub struct CandidateReport {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
    /// 1 − RSS with / RSS without, on held-out blocks of the rows that feel it.
    pub held_out_gain: f64,
    /// Its error, from the spread over blocks.
    pub held_out_gain_error: f64,
    /// Size in units of its standard deviation.
    pub z: f64,
    /// Estimated value of its first parameter; of several joints, the mean of theirs.
    pub value: f64,
    /// Standard deviation: the larger of what independent residuals give and of the spread over blocks.
    pub std: f64,
    /// All parameters; of several joints, those of the first.
    pub parameters: Vec<ParameterReport>,
    /// Share of all joints' squared torque error that it takes away, held out, %.
    pub torque_error_percent: f64,
    /// Whether the value is physical.
    pub in_bounds: bool,
    /// Whether it is there beyond chance.
    pub significant: bool,
    /// What it cannot be told from on these data.
    pub alternatives: Vec<Alternative>,
}

/// A parameter of an effect.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterReport {
    /// Its symbol.
    pub symbol: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Estimated value.
    pub value: f64,
    /// Standard deviation; zero for one that was scanned.
    pub std: f64,
}

/// A joint's frame that is not where the description has it.
#[derive(Debug, Clone, Serialize)]
pub struct FoundFrame {
    /// Which joint.
    pub joint: String,
    /// How far it is off, in words.
    pub words: String,
    /// By how much it is displaced or turned along its own axes.
    pub corrections: Vec<FrameCorrection>,
}

/// What a joint's frame is displaced or turned by along one of its own axes.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct FrameCorrection {
    /// Along or about which axis.
    #[serde(serialize_with = "by_key")]
    pub quantity: JointQuantity,
    /// m or rad.
    pub value: f64,
    /// Standard deviation: the larger of what independent residuals give and of the spread over folds.
    pub std: f64,
}

/// As model files write it.
fn by_key<S: Serializer>(quantity: &JointQuantity, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(quantity.key())
}

/// An effect that cannot be told from another one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Alternative {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
}

/// One step of the selection.
#[derive(Debug, Clone)]
pub struct PathStep {
    /// The effect.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
    /// Held-out error after this step, root mean square over all joints, N m.
    pub held_out_rms: f64,
    /// The same of each log, predicted by the others; empty where logs are not held out as a whole.
    pub log_rms: Vec<f64>,
    /// Whether the effect was taken out again.
    pub removed: bool,
}

/// What a model is at one rung of the way to a complete one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RungKind {
    /// The model file with the values that it gives.
    AsGiven,
    /// The same effects, their values fitted anew.
    Refitted,
    /// With an effect more.
    Add,
    /// With an effect less.
    Remove,
}

/// A rung of the way, as JSON has it.
#[derive(Debug, Clone, Serialize)]
pub struct Rung<'a> {
    /// What is done.
    pub step: RungKind,
    /// The effect that comes or goes.
    pub effect: Option<&'static str>,
    /// Where.
    pub joints: &'a [String],
    /// Error of the model then, root mean square over all joints, N m; held out but for that of values as given.
    pub error: f64,
    /// The same of each log, predicted by the others; empty where logs are not held out as a whole.
    #[serde(skip_serializing_if = "<[f64]>::is_empty")]
    pub log_errors: &'a [f64],
}

impl Diagnosis {
    /// The way from the model file as it is given to what is complete, or the best that was found.
    pub fn rungs(&self) -> Vec<Rung<'_>> {
        let start = [
            (RungKind::AsGiven, self.yardsticks.given_rms, &[][..]),
            (RungKind::Refitted, self.held_out_rms, &self.log_rms[..]),
        ];
        let start = start.into_iter().map(|(step, error, log_errors)| Rung {
            step,
            effect: None,
            joints: &[],
            error,
            log_errors,
        });
        let steps = self.path.iter().map(|step| Rung {
            step: match step.removed {
                true => RungKind::Remove,
                false => RungKind::Add,
            },
            effect: Some(step.effect),
            joints: &step.joints,
            error: step.held_out_rms,
            log_errors: &step.log_rms,
        });
        start.chain(steps).collect()
    }

    /// The error at either end of the way.
    pub fn error(&self) -> ErrorRange {
        self.yardsticks.error(self.after_rms())
    }

    /// Held-out error at the end of the path, N m.
    pub fn after_rms(&self) -> f64 {
        let last = self.path.last();
        last.map_or(self.held_out_rms, |step| step.held_out_rms)
    }
}

/// A joint's errors, root mean square, N m.
#[derive(Debug, Clone, Serialize)]
pub struct JointError {
    /// Which joint.
    pub joint: String,
    /// Windows.
    pub n: usize,
    /// Of the model as given, at the end of the path, and that no model can go below.
    #[serde(flatten)]
    pub error: ErrorRange,
}

/// Diagnoses what `model` lacks on a recording. Where more than one foot carries a force, the base moves, which the model takes as
/// pinned: then that is told, and no leg judged.
///
/// # Errors
/// [`RecordingError`] if no limb can be judged.
pub fn diagnose(recording: &Recording, model: &Model) -> Result<Diagnosis, RecordingError> {
    judge(recording, model, Scope::default(), &[])
}

/// How far a diagnosis goes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Scope {
    /// Legs are judged by their swing also where the base may move.
    pub swing: bool,
    /// No formula is sought where the catalogue leaves structure.
    pub catalogue_only: bool,
}

/// The same where readings of the logs ([`crate::detect::mismatch`]) have shown causes that all joints share: they are tried before any
/// effect of one joint, and taken where they do as well as what is found without them.
///
/// # Errors
/// As [`diagnose`].
pub fn diagnose_by(
    recording: &Recording,
    model: &Model,
    readings: &[Mismatch],
    scope: Scope,
) -> Result<Diagnosis, RecordingError> {
    let causes: Vec<EffectKind> = readings.iter().filter_map(|r| r.kind.cause()).collect();
    let mut diagnosis = judge(recording, model, scope, &causes)?;
    let bodies = readings.iter().filter(|r| r.kind.is_a_body());
    let bodies = bodies.map(ToString::to_string);
    diagnosis.bodies.splice(0..0, bodies);
    Ok(diagnosis)
}

fn judge(
    recording: &Recording,
    model: &Model,
    scope: Scope,
    causes: &[EffectKind],
) -> Result<Diagnosis, RecordingError> {
    let too_short = || RecordingError::too_short(recording, LEAST_HELD_OUT);
    let data = robot::data(recording, model);
    let data: Vec<LimbData> = data
        .into_iter()
        .filter(|d| d.blocks.can_hold_out())
        .collect();
    if data.is_empty() {
        return Err(too_short());
    }
    // Contact first: a force at a foot is no effect of a joint.
    let (all, feet) = leave_out_contact(data);
    let rests = |limb: &LimbData| limb.windows().iter().all(|n| *n == 0.0);
    if feet.iter().all(Option::is_none) && all.iter().all(rests) {
        return Err(RecordingError::at_rest(recording));
    }
    let stands = |foot: &Option<LeftOut>| foot.as_ref().is_some_and(|foot| foot.too_little_swing);
    let base_moves = !scope.swing && feet.iter().flatten().count() > 1;
    let hangs = |&n: &usize| !base_moves && !stands(&feet[n]);
    let judged: Vec<usize> = (0..all.len()).filter(hangs).collect();
    // Then velocities: what positions tell comes before what torques do.
    let velocity: Vec<Vec<(usize, VelocityGain)>> =
        judged.iter().map(|&n| wrong_velocities(&all[n])).collect();
    let mended: Vec<LimbData> = judged
        .iter()
        .zip(&velocity)
        .map(|(&n, wrong)| with_velocities(&all[n], wrong))
        .collect();
    let given: Vec<Vec<Place>> = mended.iter().map(places_of).collect();
    // What everything is held against is of the velocities as the file has them.
    let ladder = side_by_side(&judged, |&n| ladder::of(&all[n], model));
    let noise: Vec<Vec<Option<f64>>> = (ladder.iter())
        .map(|joints| joints.iter().map(JointLadder::noise_squares).collect())
        .collect();
    let found = search(Limbs::new(&mended, &given, &noise), causes).ok_or_else(too_short)?;
    let instead = bodies::instead(&mended, &found, model);
    // A body is looked for first: a wrong one is likelier than a wrong frame, and the bodies take most of what a frame does.
    let moved = match instead {
        None => geometry::instead(&mended, &found, model),
        Some(_) => None,
    };
    let placed = moved.as_ref().map(|moved| moved.data(&mended));
    let placed = placed.flatten();
    let before_moved = placed.is_some().then(|| found.start.clone());
    let (data, found) = match (&instead, &placed) {
        (
            Some(Instead {
                data,
                as_well: None,
                ..
            }),
            _,
        )
        | (None, Some(data)) => {
            let found = search(Limbs::new(data, &given, &noise), causes);
            (data, found.ok_or_else(too_short)?)
        }
        _ => (&mended, found),
    };
    let as_well = instead.as_ref().and_then(|instead| instead.as_well.clone());
    // Where no body is far from the CAD's the search has begun with that very fit.
    let is_far = instead.is_some()
        || placed.is_some()
        || found.end.fits.iter().any(|fit| bodies::is_held(fit));
    let refitted = is_far.then(|| bodies::refitted(&mended)).flatten();
    let refitted = refitted.map(|(_, squares)| squares);
    let before = velocity.iter().any(|wrong| !wrong.is_empty()).then(|| {
        let of = |&n: &usize| start_squares(&all[n]);
        side_by_side(&judged, of)
            .into_iter()
            .collect::<Option<Vec<Squares>>>()
    });
    let twists = data.iter().zip(&found.end.fits);
    let twists = twists.map(|(data, fit)| unknown_twists(data, fit));
    let mut diagnosed = Diagnosed {
        bodies: Vec::new(),
        freed: instead.is_some(),
        as_well,
        load_changes: Vec::new(),
        twists: twists.collect(),
        model,
        recording,
        feet: &feet,
        all: &all,
        base_moves,
        judged: &judged,
        velocity: &velocity,
        ladder: ladder.concat(),
        before: before.flatten(),
        refitted: (refitted.or(before_moved)).unwrap_or_else(|| found.start.clone()),
        frames: (placed.as_ref().and(moved.as_ref())).map_or(&[], |moved| &moved.frames),
        found,
    };
    diagnosed.load_changes = diagnosed.load_changes();
    let outside = diagnosed.outside();
    let joints = match scope.catalogue_only {
        true => Vec::new(),
        false => diagnosed.unresolved(&outside),
    };
    let formulas = formulas::find(&mut diagnosed, data, &joints);
    let mut outside = match formulas.is_empty() {
        true => outside,
        false => diagnosed.outside(),
    };
    diagnosed.add_regimes(&mut outside);
    bodies::let_go(data, &mut diagnosed.found);
    diagnosed.bodies = bodies::beside(data, &diagnosed.found, model);
    Ok(report(&diagnosed, &outside, formulas))
}

/// A recording, walked to the end.
struct Diagnosed<'a> {
    /// Bodies that are not the CAD's, at the end.
    bodies: Vec<OtherBody>,
    /// Whether bodies were released from the CAD's.
    freed: bool,
    /// Bodies that do as well as the effects that were found, and whether those are loads.
    as_well: Option<(Vec<OtherBody>, bool)>,
    model: &'a Model,
    recording: &'a Recording,
    /// All limbs, their stance left out, and what was found at their feet.
    all: &'a [LimbData<'a>],
    feet: &'a [Option<LeftOut>],
    /// Whether no limb is judged because the base moves.
    base_moves: bool,
    /// The limbs that swing enough to be judged.
    judged: &'a [usize],
    /// Of those the joints whose velocity is reported wrong.
    velocity: &'a [Vec<(usize, VelocityGain)>],
    /// Of those what each joint's error is to be measured against.
    ladder: Vec<JointLadder>,
    /// Of those a load that comes or goes within the log.
    load_changes: Vec<Option<LoadChange>>,
    /// Of those the gears that second encoders show and the model does not have.
    twists: Vec<Vec<Twist>>,
    /// Of those the held-out sums of squares with the velocities as reported, where any is wrong.
    before: Option<Vec<Squares>>,
    /// Held-out sums of squares of the model as given, its values fitted anew.
    refitted: Vec<Squares>,
    /// Of those the frames that are not where the description has them, each with its limb; what was found is of the frames where the data have them.
    frames: &'a [(usize, OtherFrame)],
    found: Found<Limbs<'a>>,
}

/// The joints whose velocity positions say to be wrong and the model does not.
fn wrong_velocities(data: &LimbData) -> Vec<(usize, VelocityGain)> {
    let of = |joint: usize| {
        let gain = VelocityGain::of(data.recording, joint, &data.blocks)?;
        gain.is_significant().then_some((joint, gain))
    };
    let unknown = |joint: &usize| data.velocity_gain[*joint] == 1.0;
    (0..data.joints()).filter(unknown).filter_map(of).collect()
}

/// The gears that second encoders show to give way, where the model lacks that.
fn unknown_twists(data: &LimbData, fit: &LimbFit) -> Vec<Twist> {
    let is_unknown = |twist: &Twist| {
        let mut own = twist.effects().into_iter();
        own.any(|(place, _)| !data.has(place))
    };
    (0..data.joints())
        .filter_map(|joint| Twist::of(data, &fit.values, joint))
        .filter(is_unknown)
        .collect()
}

/// A limb's data with wrong velocities put right.
fn with_velocities<'a>(data: &LimbData<'a>, wrong: &[(usize, VelocityGain)]) -> LimbData<'a> {
    let mut gains = data.velocity_gain.clone();
    for (joint, gain) in wrong {
        gains[*joint] = gain.value;
    }
    data.with_gains(gains)
}

/// Held-out sums of squares of the model as it is given.
fn start_squares(data: &LimbData) -> Option<Squares> {
    let fit = LimbFit::of(data, &places_of(data), &how())?;
    Some(data.squares(&fit.predicted_held_out()?))
}
