//! Which physical effect is missing: the verdict, the ranked effects and the way to a model that lacks none.

mod path;
mod report;
mod walk;
mod words;

use std::path::PathBuf;

use serde::Serialize;

use super::CriticismError;
use super::limbs::of_each_limb;
use super::recording::Recording;
use crate::model::Model;
use report::report;
use walk::{Walked, walk};

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
    /// Forward-backward selection: the error after each step.
    pub path: Vec<PathStep>,
    /// Held-out error of the model as it was given, root mean square over all joints, N m.
    pub held_out_rms: f64,
    /// The same of each log, predicted by the others; empty where logs are not held out as a whole.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub log_rms: Vec<f64>,
    /// Error that no model can go below, N m.
    pub noise_floor_rms: f64,
    /// Each joint's error.
    pub joints: Vec<JointError>,
    /// What is left when the catalogue is exhausted, if it is more than noise.
    pub outside_catalogue: Vec<String>,
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
    /// Estimated value of its first parameter.
    pub value: f64,
    /// Standard deviation: the larger of what independent residuals give and of the spread over blocks.
    pub std: f64,
    /// All parameters.
    pub parameters: Vec<ParameterReport>,
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

/// An effect that cannot be told from another one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Alternative {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
}

/// One step of the selection.
#[derive(Debug, Clone, Serialize)]
pub struct PathStep {
    /// The effect.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
    /// Held-out error after this step, root mean square over all joints, N m.
    pub held_out_rms: f64,
    /// The same of each log, predicted by the others; empty where logs are not held out as a whole.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub log_rms: Vec<f64>,
    /// Whether the effect was taken out again.
    pub removed: bool,
}

/// A joint's held-out errors, root mean square, N m.
#[derive(Debug, Clone, Serialize)]
pub struct JointError {
    /// Which joint.
    pub joint: String,
    /// Windows.
    pub n: usize,
    /// Of the model as it was given.
    pub before: f64,
    /// At the end of the path.
    pub after: f64,
    /// That no model can go below.
    pub floor: f64,
}

/// Diagnoses what `model` lacks on a recording.
///
/// # Errors
/// [`CriticismError`] if no limb can be judged.
pub fn diagnose(recording: &Recording, model: &Model) -> Result<Diagnosis, CriticismError> {
    let walks = of_each_limb(recording, |limb| walk(recording, model, limb));
    let walked: Vec<Walked> = walks.into_iter().flatten().collect();
    if walked.is_empty() {
        return Err(CriticismError::TooShort {
            duration: recording.duration,
        });
    }
    let rests = |w: &Walked| w.contact.is_none() && w.windows().iter().all(|n| *n == 0.0);
    if walked.iter().all(rests) {
        return Err(CriticismError::at_rest(recording));
    }
    Ok(report(recording, model, &walked))
}
