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
#[cfg(feature = "mcap")]
mod mcap;
mod models;
mod nested;
mod own_rate;
mod ranking;
mod rollout;
mod save;
mod summary;
mod text;
mod values;

use std::path::PathBuf;

use serde::Serialize;

use asked::{Asked, names};
use feet::Feet;
pub use feet::FootForce;
pub use free_base::{
    CoordinateError, FreeBaseComparison, compare_free_base, compare_free_base_without,
};
pub use models::{ModelError, ModelJoint, ModelsComparison};
pub use nested::{Choice, ChoiceLimb, Choices, choices};
pub use own_rate::own_rate;
pub use ranking::{RankedEpisode, RankedPattern};
pub use rollout::{Gains, HorizonError, JointRollout, RolledJoint, Rollout, Under, rollout};
pub use save::save;
pub use values::EffectValue;

pub use crate::detect::JointSeries;
use crate::detect::black_box::BlackBox;
use crate::detect::bodies;
use crate::detect::contact::leave_out_contact;
use crate::detect::every_window::EveryWindow;
pub use crate::detect::ladder::Yardsticks;
use crate::detect::ladder::{self, JointLadder};
use crate::detect::regime::{self, Regime};
use crate::detect::residual::{self, Criticism, Input, Scores};
use crate::equation::folds::LEAST_HELD_OUT;
use crate::equation::values::{Values, is_shared};
use crate::estimate::Constraint;
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::LimbData;
use crate::estimate::robot;
use crate::identify::model_fit::places_of;
use crate::model::{Model, ModelEffect};
use crate::parallel::side_by_side;
use crate::recording::{LogGates, Recording, RecordingError};
use crate::select::criteria::STRUCTURE;
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
    /// The same rms of the model without the effects that were added last, if they have no value yet, N m.
    pub before_rms: Option<f64>,
    /// Share of the square error above the noise floor, %.
    pub above_noise_percent: Option<f64>,
    /// The effects that the model was given last and that have no value yet, `coulomb:FR_calf`.
    pub added: Vec<String>,
    /// The effects that were left out of the model as it was given, where it is compared with that.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// That the robot is elastic and excited beyond what is compared here, in words; among the warnings too.
    #[serde(skip)]
    pub elastic: Option<String>,
    /// Whether values were fitted to the other stretches of time rather than taken from the model file.
    pub fitted: bool,
    /// The values of the model's effects.
    pub effects: Vec<EffectValue>,
    /// Where the error is, over all joints, the largest share first.
    #[serde(rename = "where")]
    pub patterns: Vec<RankedPattern>,
    /// Where of its motion, or from when on, a joint's error lives, of joints with much structure in it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub regimes: Vec<Regime>,
    /// When it is worst, over all joints, the least usual first.
    #[serde(rename = "when")]
    pub episodes: Vec<RankedEpisode>,
    /// What a black box could still take away, blind to torque; absent where too little of the logs can be held out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub black_box: Option<BlackBox>,
    /// Where and when each joint's error is, and whether it is noise: nine tenths of an object, which is left out where it is empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub criticism: Vec<Criticism>,
    /// Of long logs, of which all the rest here is of a drawn part: the errors over every window; none where values are fitted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every_window: Option<EveryWindow>,
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
    /// As [`Comparison::before_rms`].
    pub before_rms: Option<f64>,
    /// As [`Comparison::above_noise_percent`].
    pub above_noise_percent: Option<f64>,
    /// Whether the error is white; none for too short a series.
    pub white: Option<bool>,
    /// What of the motion the error is not independent of.
    pub depends_on: Vec<Input>,
}

impl Comparison {
    /// The error over all joints: of the file as it is given, and of the model.
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
    let Asked {
        fitted,
        added,
        before,
        file,
    } = asked(recording, model, left_out, values);
    let from = if fitted { From::HeldOut } else { From::File };
    let rest = values == ValuesFrom::GivenAlsoAtRest;
    let (data, feet) = leave_out_contact(robot::data(recording, model));
    let data: Vec<LimbData> = data.into_iter().map(|data| with_rest(data, rest)).collect();
    check(recording, &data, &feet, fitted)?;
    let judged = Judged {
        recording,
        model,
        data: &data,
        feet: &feet,
        predictions: predictions(&data, from),
        ladder: side_by_side(&data, |limb| ladder::of(limb, &file)).concat(),
        baselines: Baselines::new(recording, from, before.as_ref(), &data),
        fitted,
    };
    Ok(judged.told(&added, left_out))
}

/// What is to be compared with a recording.
fn asked(
    recording: &Recording,
    model: &Model,
    left_out: &[ModelEffect],
    values: ValuesFrom,
) -> Asked {
    let recorded = |joint: usize| {
        let mut limbs = recording.limbs.iter();
        is_shared(joint) || limbs.any(|(limb, _)| limb.bodies.contains(&joint))
    };
    Asked::of(
        (&recording.logs, &recording.only),
        &recorded,
        model,
        left_out,
        values,
    )
}

/// A model and what it predicts.
struct Judged<'a> {
    recording: &'a Recording,
    model: &'a Model,
    data: &'a [LimbData<'a>],
    feet: &'a Feet,
    predictions: Vec<Prediction<'a>>,
    /// Of each joint.
    ladder: Vec<JointLadder>,
    baselines: Baselines,
    fitted: bool,
}

impl Judged<'_> {
    /// How well, where and when; beside the model without what was `added` or with what was `left_out`.
    fn told(self, added: &[ModelEffect], left_out: &[ModelEffect]) -> Comparison {
        let (recording, model, feet) = (self.recording, self.model, self.feet);
        let torque = self.predictions.iter().map(|of| of.torque.as_slice());
        let mut series = all_series(self.data, torque);
        for (series, ladder) in series.iter_mut().zip(&self.ladder) {
            series.noise = ladder.noise;
        }
        // Where a model fails is told without what its smooth motion lacks; how large the error is, with it.
        let followed = self.followed();
        let predicted: Vec<&[f64]> = followed.iter().map(Vec::as_slice).collect();
        let black_box = BlackBox::of(self.data, &predicted);
        let limbs = self.predictions.iter().zip(self.data).zip(feet);
        let effects =
            limbs.flat_map(|((of, data), foot)| values::of(data, of.fit.as_ref(), foot.as_ref()));
        let effects: Vec<EffectValue> = values::once(effects);
        let (contact, words) = feet::told(feet, recording, model);
        let judged = series
            .iter()
            .zip(all_series(self.data, predicted.into_iter()));
        let judged: Vec<_> = judged
            .map(|(series, followed)| JointSeries {
                noise: series.noise,
                ..followed
            })
            .collect();
        let views: Vec<_> = judged.iter().map(JointSeries::view).collect();
        let mut criticism = residual::criticise(&views);
        feet::restrain(&mut criticism, &contact);
        for (criticism, series) in criticism.iter_mut().zip(&series) {
            criticism.scores = Scores::of(&series.view());
        }
        let joints = series.iter().zip(&criticism).zip(&self.ladder).enumerate();
        let joints: Vec<JointComparison> = joints
            .map(|(k, ((series, criticism), ladder))| {
                let before = self.baselines.before_rms(k);
                JointComparison::of(series, criticism, (ladder.errors, before))
            })
            .collect();
        let all: Vec<_> = (self.ladder.iter())
            .map(|own| (own.windows, own.errors))
            .collect();
        let yardsticks = Yardsticks::over_all(&all);
        let rms = over_all(&joints, &|j| Some(j.scores.rms)).unwrap_or(0.0);
        Comparison {
            data: recording.gates.clone(),
            rms,
            before_rms: over_all(&joints, &|j| j.before_rms),
            above_noise_percent: yardsticks.above_noise_percent(rms),
            yardsticks,
            added: names(model, added),
            left_out: names(model, left_out),
            effects,
            fitted: self.fitted,
            patterns: ranking::patterns(&criticism),
            regimes: self.regimes(&followed, &criticism),
            episodes: ranking::episodes(&criticism, |t| recording.moment(t)),
            black_box,
            elastic: None,
            criticism,
            every_window: None,
            logs: recording.logs.clone(),
            warnings: recording.warnings.iter().cloned().chain(words).collect(),
            contact,
            joints,
            series,
            baselines: self.baselines.named(),
        }
    }

    /// What each limb's model predicts, with what it lacks of the motion put back, N m.
    fn followed(&self) -> Vec<Vec<f64>> {
        let limbs: Vec<_> = self.predictions.iter().zip(self.data).collect();
        side_by_side(&limbs, |(of, data)| {
            data.with_unfollowed(&of.values(data), of.torque.clone())
        })
    }

    /// Where errors live, joint by joint, of what is `followed`; where a foot carries a force at times, none is reported of the rest.
    fn regimes(&self, followed: &[Vec<f64>], criticism: &[Criticism]) -> Vec<Regime> {
        if self.feet.iter().any(Option::is_some) {
            return Vec::new();
        }
        let limbs = self.data.iter().enumerate();
        let places = limbs.flat_map(|(limb, data)| (0..data.joints()).map(move |j| (limb, j)));
        let told = places
            .zip(criticism)
            .filter(|(_, own)| own.structure() > STRUCTURE);
        let told: Vec<_> = told.collect();
        let found = side_by_side(&told, |((limb, joint), own)| {
            let data = &self.data[*limb];
            let values = self.predictions[*limb].values(data);
            let noise = own.noise.map(|noise| noise.rms);
            regime::of(data, &values, &followed[*limb], (*joint, noise))
        });
        found.into_iter().flatten().collect()
    }
}

/// What models that know less make of the same windows.
struct Baselines {
    cad: Vec<JointSeries>,
    /// Without what was added last, and with what was left out.
    before: Option<Vec<JointSeries>>,
}

impl Baselines {
    fn new(recording: &Recording, from: From, before: Option<&Model>, data: &[LimbData]) -> Self {
        let cad = side_by_side(data, LimbData::predicted_by_cad);
        let before = before.map(|model| {
            let before = robot::data(recording, model).into_iter().zip(data);
            let before: Vec<LimbData> = before.map(|(own, data)| own.judged_as(data)).collect();
            let predictions = predictions(&before, from);
            let torque = predictions.iter().map(|of| of.torque.as_slice());
            all_series(&before, torque)
        });
        Self {
            before,
            cad: all_series(data, cad.iter().map(Vec::as_slice)),
        }
    }

    /// Of joint k, N m.
    fn before_rms(&self, k: usize) -> Option<f64> {
        Some(self.before.as_ref()?[k].rms())
    }

    fn named(self) -> Vec<(&'static str, Vec<JointSeries>)> {
        let before = self.before.map(|before| ("before", before));
        [("CAD", self.cad)].into_iter().chain(before).collect()
    }
}

/// Root mean square over the windows of all joints, N m, of what is a root mean square over each joint's; none if one has none.
fn over_all(
    joints: &[JointComparison],
    rms: &dyn Fn(&JointComparison) -> Option<f64>,
) -> Option<f64> {
    let all: Option<Vec<_>> = (joints.iter())
        .map(|j| Some((j.scores.n as f64, rms(j)?)))
        .collect();
    Some(ladder::over_all(all?))
}

impl JointComparison {
    /// One joint, beside its yardsticks and the rms of the model before.
    fn of(
        series: &JointSeries,
        criticism: &Criticism,
        (yardsticks, before_rms): (Yardsticks, Option<f64>),
    ) -> Self {
        let scores = Scores::of(&series.view());
        let dependent = criticism.independence.iter().filter(|i| !i.independent);
        Self {
            joint: series.joint.clone(),
            error: yardsticks.error(scores.rms),
            scores,
            yardsticks,
            before_rms,
            above_noise_percent: yardsticks.above_noise_percent(scores.rms),
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

impl Prediction<'_> {
    /// The values that predict so: of the fit to all data, else the file's.
    fn values(&self, data: &LimbData) -> Values {
        let given = || Values::given(data.model, data.limb);
        self.fit
            .as_ref()
            .map_or_else(given, |fit| fit.values.clone())
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
    let given = |data: &LimbData<'_>| data.predicted_as_given(data.model);
    let Some(fits) = fits(data, from) else {
        let torque = side_by_side(data, given);
        return torque
            .into_iter()
            .map(|torque| Prediction { torque, fit: None })
            .collect();
    };
    let of = |fit: &LimbFit| fit.predicted_held_out().unwrap_or_else(|| fit.predicted());
    let torque = side_by_side(&fits, of);
    let both = torque.into_iter().zip(fits);
    both.map(|(torque, fit)| Prediction {
        torque,
        fit: Some(fit),
    })
    .collect()
}

/// The limbs' fits, where values do not come from the file; a fit that is not finite says nothing, and the file's values stand for it.
fn fits<'a>(data: &'a [LimbData<'a>], from: From) -> Option<Vec<LimbFit<'a>>> {
    if from == From::File {
        return None;
    }
    let how = How {
        constraint: Constraint::Physical,
        ..How::default()
    };
    let places: Vec<_> = data.iter().map(places_of).collect();
    let (fits, _) = bodies::fit(data, &places, &how);
    (fits.len() == data.len()).then_some(fits)
}

/// The series of all joints, of which each limb's torque is predicted so.
fn all_series<'t>(
    data: &[LimbData],
    predicted: impl Iterator<Item = &'t [f64]>,
) -> Vec<JointSeries> {
    let limbs = data.iter().zip(predicted);
    limbs
        .flat_map(|(data, torque)| JointSeries::of(data, torque))
        .collect()
}
