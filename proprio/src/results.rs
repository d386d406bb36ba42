//! What the steps of the loop give.

use std::fmt;
use std::path::Path;

use proprio_host::command::result::{self, judged};
use proprio_host::compare::{self as room, ValuesFrom, own_rate};
use proprio_host::diagnose::{self as diagnosis, Scope, diagnose_by};
use proprio_host::estimate::{ParameterEstimate, Status};
use proprio_host::identify::{FitOptions, identify_recording};
use proprio_host::model::Provenance;
use proprio_host::report::pages;
use proprio_host::spectrum::mismatches;
use proprio_host::{detect, identify as identification};

use crate::error::{self, Error};
use crate::model::Model;
use crate::recording::Recording;

/// A model fitted to a recording.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Fitted {
    /// The model with the values that were found, and with which logs gave them.
    pub model: Model,
    /// Every parameter of every limb in the logs: of bodies and of effects.
    pub parameters: Vec<Parameter>,
    /// Root mean square over all joints of measured − predicted mean torque over a window of 20 ms, N m.
    pub rms: f64,
    /// The same on stretches of time that the fit has not seen, N m; none if too little can be held out.
    pub held_out_rms: Option<f64>,
    /// The same of the URDF's rigid body without any effect, N m.
    pub cad_rms: f64,
    told: identification::Fitted,
}

/// A parameter with what the logs say of it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Parameter {
    /// `coulomb:FR_hip`; of a body `m:FR_hip`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
    /// Standard deviation.
    pub std: f64,
    /// Whether the logs tell it: else the value is mostly what was known before.
    pub identified: bool,
}

impl Fitted {
    /// What `proprio identify --json` prints: one object.
    pub fn json(&self) -> String {
        judged("identify", self.told.error(), &self.told)
    }

    /// The page of `proprio identify --html`: one HTML document. `recording` is what was fitted.
    ///
    /// # Errors
    /// As [`compare`]; [`Error::Log`] if a log is not there any more.
    pub fn page(&self, recording: &Recording) -> Result<String, Error> {
        let comparison = room::compare(&recording.room, &self.model.0, ValuesFrom::Given);
        let comparison = comparison.map_err(error::recording)?;
        let page = pages::fit(&self.told, &comparison, &self.model.0, [None, None])
            .map_err(error::unreadable)?;
        page.html().map_err(error::page)
    }

    /// The parameter of that name.
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }
}

impl Parameter {
    fn of(estimate: &ParameterEstimate) -> Self {
        Self {
            name: estimate.name.clone(),
            unit: estimate.unit,
            value: estimate.value,
            std: estimate.std,
            identified: estimate.status == Status::Identified,
        }
    }
}

impl fmt::Display for Fitted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.told.fmt(f)
    }
}

/// Fits bodies and effects of `model` to a recording. Its values do not count, its priors do; every body could exist, and friction and
/// rotor inertia are at least zero.
///
/// # Errors
/// [`Error::TooShort`] or [`Error::AtRest`] if nothing can be fitted, [`Error::Log`] if a log is not there any more.
pub fn identify(recording: &Recording, model: &Model) -> Result<Fitted, Error> {
    let options = FitOptions::PHYSICAL;
    let told = identify_recording(&recording.room, &model.0, options, &mut |_, _| ());
    let told = told.map_err(error::recording)?;
    let provenance = Provenance::of(recording.logs()).map_err(error::unreadable)?;
    let filled = told.to_model(&model.0, provenance);
    let mut filled = filled.map_err(error::not_a_model)?;
    filled.forget_last_added();
    let estimates = told.parameters.iter().map(|p| &p.estimate);
    Ok(Fitted {
        model: Model(filled),
        parameters: estimates.map(Parameter::of).collect(),
        rms: told.rms,
        held_out_rms: told.held_out_rms,
        cad_rms: told.yardsticks.cad_rms,
        told,
    })
}

/// Measured and predicted torque of a joint over time; all vectors are of one length, and each number is a mean over its stretch of time.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct JointSeries {
    /// Which joint.
    pub joint: String,
    /// Time since the recording's start, s.
    pub t: Vec<f64>,
    /// Position, rad.
    pub q: Vec<f64>,
    /// Velocity, rad/s.
    pub dq: Vec<f64>,
    /// Measured torque, N m.
    pub tau: Vec<f64>,
    /// The model's torque, N m.
    pub predicted: Vec<f64>,
}

impl JointSeries {
    fn of(series: &detect::JointSeries) -> Self {
        Self {
            joint: series.joint.clone(),
            t: series.t.clone(),
            q: series.q.clone(),
            dq: series.dq.clone(),
            tau: series.tau.clone(),
            predicted: series.predicted.clone(),
        }
    }

    /// Measured − predicted torque, N m.
    pub fn residual(&self) -> Vec<f64> {
        let both = self.tau.iter().zip(&self.predicted);
        both.map(|(tau, predicted)| tau - predicted).collect()
    }

    /// Root mean square of measured − predicted torque, N m.
    pub fn rms(&self) -> f64 {
        let both = self.tau.iter().zip(&self.predicted);
        let squares: f64 = both.map(|(tau, predicted)| (tau - predicted).powi(2)).sum();
        (squares / self.t.len().max(1) as f64).sqrt()
    }
}

/// The torque that a model's drives would report, at the log's own samples: from the motion and the values that the model has, blind to
/// the torque that was measured. Each number is a mean over the two sample periods around its time. Samples that repeat the one before, or
/// lie beside a gap, have none; of a joint at rest the torque is whatever friction holds, and the prediction says little.
pub fn predict(recording: &Recording, model: &Model) -> Vec<JointSeries> {
    let series = own_rate(&recording.room, &model.0);
    series.iter().map(JointSeries::of).collect()
}

/// A model held against a recording.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Comparison {
    /// Root mean square over all joints of measured − predicted mean torque over a window of 20 ms, N m.
    pub rms: f64,
    /// The same of predicting zero, N m.
    pub zero_rms: f64,
    /// The same of the URDF's rigid body without any effect, N m.
    pub cad_rms: f64,
    /// Error that no model can take away, N m; none if the log is too short to tell.
    pub noise_floor_rms: Option<f64>,
    /// Whether values were fitted, to all stretches of time but the one that is predicted: the model has effects without a value.
    pub fitted: bool,
    /// Each joint's windows of 20 ms in which it moves and no foot touches anything; times are the windows' middles.
    pub joints: Vec<JointSeries>,
    /// What is to be known of the logs, a sentence each.
    pub warnings: Vec<String>,
    told: room::Comparison,
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.told.summary(None).fmt(f)
    }
}

impl Comparison {
    /// What `proprio compare --json --verbose` prints: one object.
    pub fn json(&self) -> String {
        judged("compare", self.told.error(), &self.told)
    }

    /// Writes measured and predicted torque as a file: by its name MCAP, at the log's own rate with residual, noise floor and events, for Foxglove,
    /// PlotJuggler and Rerun; else CSV, a row per window. `recording` and `model` are those that were compared.
    ///
    /// # Errors
    /// [`Error::Write`].
    pub fn save(
        &self,
        recording: &Recording,
        model: &Model,
        path: impl AsRef<Path>,
    ) -> Result<(), Error> {
        room::save(&self.told, &recording.room, &model.0, path.as_ref()).map_err(error::write)
    }

    /// The page that [`report`] writes, as one HTML document. `recording` and `model` are those that were compared.
    ///
    /// # Errors
    /// [`Error::Log`] if a log is not there any more.
    pub fn page(&self, recording: &Recording, model: &Model) -> Result<String, Error> {
        let page = pages::comparison(&self.told, &recording.room, &model.0, None);
        page.map_err(error::unreadable)?.html().map_err(error::page)
    }
}

/// Holds a model against a recording: how far its torque is from the measured one. Values are the model's own; if an effect of it has none,
/// all are fitted to every stretch of time but the one that is predicted.
///
/// # Errors
/// [`Error::TooShort`] or [`Error::AtRest`] if no limb can be judged.
pub fn compare(recording: &Recording, model: &Model) -> Result<Comparison, Error> {
    let told = room::compare(&recording.room, &model.0, ValuesFrom::Auto);
    let mut told = told.map_err(error::recording)?;
    let wrong = mismatches(&recording.room, &model.0);
    told.warnings.extend(wrong.iter().map(ToString::to_string));
    Ok(Comparison {
        rms: told.rms,
        zero_rms: told.yardsticks.zero_rms,
        cad_rms: told.yardsticks.cad_rms,
        noise_floor_rms: told.yardsticks.noise_floor_rms,
        fitted: told.fitted,
        joints: told.series.iter().map(JointSeries::of).collect(),
        warnings: told.warnings.clone(),
        told,
    })
}

/// Which effect a model lacks.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Diagnosis {
    /// The effects that are missing, in the order in which they were found, as [`add`](crate::add()) takes them: `coulomb:FR_hip`.
    pub missing: Vec<String>,
    /// The model with these effects, which have no value yet: [`identify`] gives them theirs.
    pub model: Model,
    /// Error of the model with the values that it has, root mean square over all joints, N m; an effect without one does nothing.
    pub before: f64,
    /// Held-out error with what is missing, N m.
    pub after: f64,
    /// Error that no model can take away, N m; none if the log is too short to tell.
    pub noise_floor_rms: Option<f64>,
    /// What is left that no effect of the catalogue explains, a sentence each.
    pub outside_catalogue: Vec<String>,
    /// What is to be known of the logs, a sentence each.
    pub warnings: Vec<String>,
    told: diagnosis::Diagnosis,
    given: Model,
}

impl Diagnosis {
    /// What `proprio diagnose --json` prints of `recording`, which was diagnosed: one object.
    pub fn json(&self, recording: &Recording) -> String {
        result::diagnosis(&recording.room.gates, &self.told)
    }

    /// The page of `proprio diagnose --html`: one HTML document. `recording` is what was diagnosed.
    ///
    /// # Errors
    /// As [`compare`]; [`Error::Log`] if a log is not there any more.
    pub fn page(&self, recording: &Recording) -> Result<String, Error> {
        let after = room::compare(&recording.room, &self.model.0, ValuesFrom::Fitted);
        let page = pages::DiagnosisPage {
            diagnosis: &self.told,
            after: &after.map_err(error::recording)?,
            recording: &recording.room,
            given: &self.given.0,
            complete: &self.model.0,
            model: None,
            written: false,
        };
        let page = page.page().map_err(error::unreadable)?;
        page.html().map_err(error::page)
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.told.fmt(f)
    }
}

/// Looks for what a model lacks: every effect of the catalogue at every joint is judged by the error on stretches of time that its fit has
/// not seen, and the best are taken until none gains beyond its error. That nothing is missing is an answer.
///
/// # Errors
/// [`Error::Mismatch`] if the log is not what the model says; [`Error::TooShort`] or [`Error::AtRest`] if no limb can be judged.
pub fn diagnose(recording: &Recording, model: &Model) -> Result<Diagnosis, Error> {
    let wrong = mismatches(&recording.room, &model.0);
    let said = wrong.iter().map(ToString::to_string);
    if wrong.iter().any(|wrong| wrong.kind.refuses()) {
        return Err(Error::Mismatch(said.collect()));
    }
    let told = diagnose_by(&recording.room, &model.0, &wrong, Scope::default());
    let mut told = told.map_err(error::recording)?;
    told.warnings.extend(said);
    let mut with = model.0.clone();
    told.apply(&mut with);
    let with = Model(with);
    let missing = with
        .effects()
        .filter(|name| model.effects().all(|known| known != *name));
    Ok(Diagnosis {
        missing: missing.collect(),
        model: with.clone(),
        given: model.clone(),
        before: told.yardsticks.given_rms,
        after: told.after_rms(),
        noise_floor_rms: told.yardsticks.noise_floor_rms,
        outside_catalogue: told.outside_catalogue.clone(),
        warnings: told.warnings.clone(),
        told,
    })
}

/// Writes a comparison as a page: errors, torque, residuals, tick boxes that fit other choices of effects anew. One HTML file that needs no
/// network. `recording` and `model` are those that were compared.
///
/// # Errors
/// [`Error::Write`] if it cannot be written, [`Error::Log`] if a log is not there any more.
pub fn report(
    comparison: &Comparison,
    recording: &Recording,
    model: &Model,
    to: impl AsRef<Path>,
) -> Result<(), Error> {
    let page = pages::comparison(&comparison.told, &recording.room, &model.0, None);
    let page = page.map_err(error::unreadable)?;
    page.write(to.as_ref()).map_err(error::write)
}
