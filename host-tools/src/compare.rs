//! Model against measurement: how well, where and when, beside baselines, on data that no fit has seen.
//!
//! What a model file gives is taken as it is given. Where an effect of the model has no value yet (it was just added), all
//! parameters are fitted, within their priors, to every stretch of time but the one that is predicted.
//!
//! Time in which a foot carries a force that the detector of a diagnosis finds is left out, whatever predicts.

mod asked;
mod black_box;
pub mod csv;
mod feet;
mod free_base;
mod nested;
mod own_rate;
mod ranking;
mod summary;
mod values;
mod words;

use std::path::PathBuf;

use serde::Serialize;

use asked::{Asked, names};
use feet::Feet;
pub use feet::FootForce;
pub(crate) use free_base::given as given_of_walk;
pub use free_base::{
    CoordinateError, FreeBaseComparison, compare_free_base, compare_free_base_without,
};
pub use nested::{Choice, ChoiceLimb, Choices, choices};
pub use own_rate::own_rate;
pub use ranking::{RankedEpisode, RankedPattern};
pub use values::EffectValue;

pub use crate::detect::JointSeries;
use crate::detect::black_box::BlackBox;
use crate::detect::contact::{LeftOut, leave_out_contact};
use crate::detect::residual::{self, Criticism, Input, Scores};
use crate::equation::folds::LEAST_HELD_OUT;
use crate::equation::values::{Values, is_shared};
use crate::estimate::Constraint;
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::LimbData;
use crate::estimate::robot::{self, side_by_side};
use crate::identify::model_fit::places_of;
use crate::model::{Model, ModelEffect};
use crate::recording::{LogGates, Recording, RecordingError};
use crate::summary::ErrorRange;

/// What `proprio compare` says.
#[derive(Debug, Clone, Serialize)]
pub struct Comparison {
    /// What the samples of each log are worth.
    pub data: Vec<LogGates>,
    /// Forces at feet, whose windows are left out of everything else here; absent where there is none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contact: Vec<FootForce>,
    /// Each joint.
    pub joints: Vec<JointComparison>,
    /// Root mean square over all joints of measured − predicted mean torque over a window, N m.
    pub rms: f64,
    /// What that is to be measured against.
    #[serde(flatten)]
    pub yardsticks: Yardsticks,
    /// The effects that the model was given last and that have no value yet, `coulomb:FR_calf`.
    pub added: Vec<String>,
    /// The effects that were left out of the model as it was given, where it is compared with that.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// Whether values were fitted to the other stretches of time rather than taken from the model file.
    pub fitted: bool,
    /// The values of the model's effects.
    pub effects: Vec<EffectValue>,
    /// Where the error is, over all joints, the largest share first.
    #[serde(rename = "where")]
    pub patterns: Vec<RankedPattern>,
    /// When it is worst, over all joints, the least usual first.
    #[serde(rename = "when")]
    pub episodes: Vec<RankedEpisode>,
    /// What a black box could still take away, blind to torque; absent where too little of the logs can be held out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black_box: Option<BlackBox>,
    /// Where and when each joint's error is, and whether it is noise.
    pub criticism: Vec<Criticism>,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
    /// Measured and predicted torque; for plots.
    #[serde(skip)]
    pub series: Vec<JointSeries>,
    /// The same of the baselines that are models, by what to call them.
    #[serde(skip)]
    pub baselines: Vec<(&'static str, Vec<JointSeries>)>,
}

/// What a model's rms is to be measured against, of a joint or of all.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Yardsticks {
    /// The rms of predicting zero, N m.
    pub zero_rms: f64,
    /// The rms of the CAD's rigid body without any effect, N m.
    pub cad_rms: f64,
    /// The rms of the model without the effects that were added last, if they have no value yet, N m.
    pub before_rms: Option<f64>,
    /// Error that no model can take away, N m; none for fewer than 100 windows, or of all joints if one has none.
    pub noise_floor_rms: Option<f64>,
    /// Whether the true floor may be lower: what a poor model leaves looks like noise in part.
    pub noise_floor_is_upper_bound: bool,
    /// Share of the square error above that, %.
    pub above_noise_percent: Option<f64>,
}

/// One joint.
#[derive(Debug, Clone, Serialize)]
pub struct JointComparison {
    /// Which.
    pub joint: String,
    /// As [`Comparison::error`].
    #[serde(flatten)]
    pub error: ErrorRange,
    /// How well the model does.
    #[serde(flatten)]
    pub scores: Scores,
    /// What that is to be measured against.
    #[serde(flatten)]
    pub yardsticks: Yardsticks,
    /// Whether the error is white; none for too short a series.
    pub white: Option<bool>,
    /// What of the motion the error is not independent of.
    pub depends_on: Vec<Input>,
}

impl Yardsticks {
    /// Of a model that leaves `rms`, held against what it was before, or the CAD.
    fn error(&self, rms: f64) -> ErrorRange {
        let before = self.before_rms.unwrap_or(self.cad_rms);
        ErrorRange::torque(before, rms, self.noise_floor_rms)
    }
}

impl Comparison {
    /// The error over all joints: of what the model is held against, and of the model.
    pub fn error(&self) -> ErrorRange {
        self.yardsticks.error(self.rms)
    }
}

/// Whether values are fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ValuesFrom {
    /// Fitted if an effect has no value yet, or has had it from a diagnosis of these very logs;
    /// else as given.
    #[default]
    Auto,
    /// Fitted, whatever the model file gives.
    Fitted,
    /// As given: an effect without a value does nothing.
    Given,
    /// As given, and joints are judged also while they rest, when the torque is whatever friction holds.
    GivenAlsoAtRest,
}

/// Compares `model` with a recording.
///
/// # Errors
/// [`RecordingError`] if no limb can be judged.
pub fn compare(
    recording: &Recording,
    model: &Model,
    values: ValuesFrom,
) -> Result<Comparison, RecordingError> {
    compare_without(recording, model, &[], values)
}

/// The same of a model from which the effects `left_out` were removed: the model that had them is what it is held against.
///
/// # Errors
/// [`RecordingError`] if no limb can be judged.
pub fn compare_without(
    recording: &Recording,
    model: &Model,
    left_out: &[ModelEffect],
    values: ValuesFrom,
) -> Result<Comparison, RecordingError> {
    let recorded = |joint: usize| {
        let mut limbs = recording.limbs.iter();
        is_shared(joint) || limbs.any(|(limb, _)| limb.bodies.contains(&joint))
    };
    let Asked {
        fitted,
        added,
        before,
    } = Asked::of(&recording.logs, &recorded, model, left_out, values);
    let from = if fitted { From::HeldOut } else { From::File };
    let rest = values == ValuesFrom::GivenAlsoAtRest;
    let (data, feet) = swing(robot::data(recording, model));
    let data: Vec<LimbData> = data.into_iter().map(|data| with_rest(data, rest)).collect();
    check(recording, &data, &feet, fitted)?;
    let predictions = predictions(&data, from);
    let judged = Judged {
        recording,
        model,
        data: &data,
        feet: &feet,
        predictions,
        baselines: Baselines::new(recording, model, from, before.as_ref(), &feet, rest),
        fitted,
    };
    Ok(judged.told(&added, left_out))
}

/// A model and what it predicts.
struct Judged<'a> {
    recording: &'a Recording,
    model: &'a Model,
    data: &'a [LimbData<'a>],
    feet: &'a Feet,
    predictions: Vec<Prediction<'a>>,
    baselines: Baselines,
    fitted: bool,
}

impl Judged<'_> {
    /// How well, where and when; beside the model without what was `added` or with what was `left_out`.
    fn told(self, added: &[ModelEffect], left_out: &[ModelEffect]) -> Comparison {
        let (recording, model, feet) = (self.recording, self.model, self.feet);
        let series = all_series(self.data, &self.predictions);
        let predicted: Vec<&[f64]> = (self.predictions.iter())
            .map(|of| of.torque.as_slice())
            .collect();
        let black_box = BlackBox::of(self.data, &predicted);
        let limbs = self.predictions.iter().zip(self.data).zip(feet);
        let effects =
            limbs.flat_map(|((of, data), foot)| values::of(data, of.fit.as_ref(), foot.as_ref()));
        let effects: Vec<EffectValue> = values::once(effects);
        let (contact, words) = feet::told(feet, recording, model);
        let views: Vec<_> = series.iter().map(JointSeries::view).collect();
        let mut criticism = residual::criticise(&views);
        feet::restrain(&mut criticism, &contact);
        let joints = series.iter().zip(&criticism).enumerate();
        let joints: Vec<JointComparison> = joints
            .map(|(k, (series, criticism))| {
                JointComparison::of(series, criticism, self.baselines.rms(k))
            })
            .collect();
        let rms = over_all(&joints, &|j| j.scores.rms);
        Comparison {
            data: recording.gates.clone(),
            rms,
            yardsticks: Yardsticks::over_all(&joints, rms),
            added: names(model, added),
            left_out: names(model, left_out),
            effects,
            fitted: self.fitted,
            patterns: ranking::patterns(&criticism),
            episodes: ranking::episodes(&criticism, |t| recording.moment(t)),
            black_box,
            criticism,
            logs: recording.logs.clone(),
            warnings: recording.warnings.iter().cloned().chain(words).collect(),
            contact,
            joints,
            series,
            baselines: self.baselines.named(),
        }
    }
}

/// What models that know less make of the same windows.
struct Baselines {
    cad: Vec<JointSeries>,
    /// Without what was added last, and with what was left out.
    before: Option<Vec<JointSeries>>,
}

impl Baselines {
    fn new(
        recording: &Recording,
        model: &Model,
        from: From,
        before: Option<&Model>,
        feet: &Feet,
        rest: bool,
    ) -> Self {
        let series = |model: &Model, from| {
            let data = robot::data(recording, model).into_iter().zip(feet);
            let data: Vec<LimbData> = data
                .map(|(data, foot)| with_rest(without_stance(data, foot), rest))
                .collect();
            all_series(&data, &predictions(&data, from))
        };
        Self {
            before: before.map(|before| series(before, from)),
            cad: series(
                &Model::new(model.robot().clone()).mounted_as(model),
                From::File,
            ),
        }
    }

    /// Of joint k: the CAD's rms and that of the model before, N m.
    fn rms(&self, k: usize) -> (f64, Option<f64>) {
        (self.cad[k].rms(), self.before.as_ref().map(|b| b[k].rms()))
    }

    fn named(self) -> Vec<(&'static str, Vec<JointSeries>)> {
        let before = self.before.map(|before| ("before", before));
        [("CAD", self.cad)].into_iter().chain(before).collect()
    }
}

/// Root mean square over the windows of all joints, N m, of what is a root mean square over each joint's.
fn over_all(joints: &[JointComparison], rms: &dyn Fn(&JointComparison) -> f64) -> f64 {
    let (sum, n) = joints.iter().fold((0.0, 0), |(sum, n), j| {
        (sum + rms(j).powi(2) * j.scores.n as f64, n + j.scores.n)
    });
    (sum / n.max(1) as f64).sqrt()
}

impl Yardsticks {
    /// Of all joints together, where the model's rms over all of them is `rms`.
    fn over_all(joints: &[JointComparison], rms: f64) -> Self {
        let all = |of: &dyn Fn(&Self) -> f64| over_all(joints, &|j| of(&j.yardsticks));
        let all_known = |of: &dyn Fn(&Self) -> Option<f64>| {
            let known = joints.iter().all(|j| of(&j.yardsticks).is_some());
            known.then(|| all(&|y| of(y).unwrap_or(0.0)))
        };
        let floor = all_known(&|y| y.noise_floor_rms);
        let above =
            |floor: f64| 100.0 * (1.0 - (floor / rms.max(f64::MIN_POSITIVE)).powi(2)).max(0.0);
        Self {
            zero_rms: all(&|y| y.zero_rms),
            cad_rms: all(&|y| y.cad_rms),
            before_rms: all_known(&|y| y.before_rms),
            noise_floor_rms: floor,
            noise_floor_is_upper_bound: joints
                .iter()
                .any(|j| j.yardsticks.noise_floor_is_upper_bound),
            above_noise_percent: floor.map(above),
        }
    }
}

impl JointComparison {
    /// One joint, beside the rms of the CAD and of the model before.
    fn of(series: &JointSeries, criticism: &Criticism, (cad, before): (f64, Option<f64>)) -> Self {
        let scores = Scores::of(&series.view());
        let zero: f64 = series.tau.iter().map(|tau| tau * tau).sum();
        let dependent = criticism.independence.iter().filter(|i| !i.independent);
        let yardsticks = Yardsticks {
            zero_rms: (zero / scores.n.max(1) as f64).sqrt(),
            cad_rms: cad,
            before_rms: before,
            noise_floor_rms: criticism.noise.map(|noise| noise.rms),
            noise_floor_is_upper_bound: criticism.noise.is_some_and(|noise| noise.upper_bound),
            above_noise_percent: criticism.above_noise_percent,
        };
        Self {
            joint: series.joint.clone(),
            error: yardsticks.error(scores.rms),
            scores,
            yardsticks,
            white: criticism.whiteness.as_ref().map(|w| w.white),
            depends_on: dependent.map(|i| i.input).collect(),
        }
    }
}

/// Where a model's values come from.
#[derive(Debug, Clone, Copy, PartialEq)]
enum From {
    /// The file.
    File,
    /// Of each window, the fit to all data but its fold's.
    HeldOut,
}

/// What a model makes of a limb.
struct Prediction<'a> {
    /// Mean torque of each window and joint, N m.
    torque: Vec<f64>,
    /// The fit to all data, where values were fitted.
    fit: Option<LimbFit<'a>>,
}

/// The limbs without what is in contact with the ground, and the forces that were found.
fn swing(data: Vec<LimbData>) -> (Vec<LimbData>, Feet) {
    let of = |data: &LimbData<'_>| leave_out_contact(data.clone()).1;
    let feet: Feet = side_by_side(&data, of);
    let data = data
        .into_iter()
        .zip(&feet)
        .map(|(data, foot)| without_stance(data, foot));
    (data.collect(), feet)
}

fn without_stance<'a>(data: LimbData<'a>, foot: &Option<LeftOut>) -> LimbData<'a> {
    match foot {
        Some(foot) => data.without(&foot.contact.samples),
        None => data,
    }
}

fn with_rest(data: LimbData<'_>, rest: bool) -> LimbData<'_> {
    if rest { data.also_at_rest() } else { data }
}

/// Whether anything can be said.
fn check(
    recording: &Recording,
    data: &[LimbData],
    feet: &Feet,
    fitted: bool,
) -> Result<(), RecordingError> {
    if data.is_empty() || fitted && data.iter().any(|limb| !limb.blocks.can_hold_out()) {
        return Err(RecordingError::too_short(recording, LEAST_HELD_OUT));
    }
    let rests = |limb: &LimbData| limb.windows().iter().all(|n| *n == 0.0);
    if feet.iter().all(Option::is_none) && data.iter().all(rests) {
        return Err(RecordingError::at_rest(recording));
    }
    Ok(())
}

/// What the limbs' model predicts, each limb's.
fn predictions<'a>(data: &'a [LimbData<'a>], from: From) -> Vec<Prediction<'a>> {
    let given =
        |data: &LimbData<'_>| data.predicted(&Values::given(data.model, data.limb), &|_| true);
    if from == From::File {
        let torque = side_by_side(data, given);
        return torque
            .into_iter()
            .map(|torque| Prediction { torque, fit: None })
            .collect();
    }
    let how = How {
        constraint: Constraint::Physical,
        ..How::default()
    };
    let places: Vec<_> = data.iter().map(places_of).collect();
    let (fits, _) = robot::fit(data, &places, &how);
    if fits.len() < data.len() {
        // A fit that is not finite has no prediction: that of the file stands for it.
        return predictions(data, From::File);
    }
    // Each window by the fit to the other folds.
    let of = |fit: &LimbFit| match fit.held_out() {
        Some(values) => fit.data.predicted_by_fold(&values),
        None => fit.data.predicted(&fit.values, &|_| true),
    };
    let torque = side_by_side(&fits, of);
    let both = torque.into_iter().zip(fits);
    both.map(|(torque, fit)| Prediction {
        torque,
        fit: Some(fit),
    })
    .collect()
}

fn all_series(data: &[LimbData], predictions: &[Prediction]) -> Vec<JointSeries> {
    let limbs = data.iter().zip(predictions);
    limbs
        .flat_map(|(data, of)| JointSeries::of(data, &of.torque))
        .collect()
}
