//! How good a model is, by the feedback torque that is left when it feeds forward.
//!
//! A controller that gives a model's torque for the motion asked for, and feedback besides, needs the less feedback the better
//! the model is. On the simulator ([`tracked`]) the loop is closed with each model in turn. Of a recording ([`recorded`]) the loop
//! is what it was: there it is the torque that the motors gave less what the model asks for the motion that was made, which is
//! what feedback would have been left with on that motion.

mod recorded;
mod tracked;

use serde::Serialize;

pub use recorded::recorded;
pub use tracked::tracked;

use crate::model::Model;
use proprio_simulator::Diverged;

/// A model with the name that a report calls it.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The name.
    pub name: String,
    /// The model; `None` feeds nothing forward.
    pub model: Option<Model>,
    /// Whether it is another candidate's friction alone.
    pub friction_only: bool,
}

/// The URDF, and of each model its friction on the URDF's bodies (where its bodies are its own) and itself.
pub fn candidates(urdf: &Model, models: Vec<(String, Model)>) -> Vec<Candidate> {
    let candidate = |name: String, model| Candidate {
        name,
        model: Some(model),
        friction_only: false,
    };
    let mut all = vec![candidate("URDF".to_owned(), urdf.clone())];
    for (name, model) in models {
        let bodies = model.robot().bodies();
        if (0..bodies.len()).any(|b| model.is_identified(b)) {
            let mut friction = model.clone();
            let placed =
                (0..bodies.len()).try_for_each(|b| friction.set_body(b, &bodies[b].inertia, None));
            if placed.is_ok() {
                all.push(Candidate {
                    friction_only: true,
                    ..candidate(format!("{name}, friction only"), friction)
                });
            }
        }
        all.push(candidate(name, model));
    }
    all
}

/// What feedback had to give at one joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointFeedback {
    /// Its name.
    pub joint: String,
    /// Root mean square of the feedback torque, N m.
    pub rms: f64,
    /// The same of the whole torque, N m.
    pub torque_rms: f64,
    /// Share of the torque's mean square, in percent.
    pub share_percent: f64,
}

/// What feedback had to give with one model.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Feedback {
    /// The model's name.
    pub model: String,
    /// Whether it is another one's friction alone, which a page does not draw.
    #[serde(skip)]
    pub friction_only: bool,
    /// Over all joints, N m.
    pub rms: f64,
    /// Share of the torques' mean square, in percent.
    pub share_percent: f64,
    /// Root mean square of the reference's distance, rad, where there is a reference.
    pub tracking_rms: Option<f64>,
    /// Joint by joint.
    pub joints: Vec<JointFeedback>,
    /// Feedback torque over time for a report, joint by joint: seconds and N m.
    #[serde(skip)]
    pub series: Vec<Vec<[f64; 2]>>,
}

/// Sums of one joint.
#[derive(Debug, Clone, Default)]
struct Sums {
    count: f64,
    feedback: f64,
    torque: f64,
    error: f64,
    series: Vec<[f64; 2]>,
}

impl Sums {
    fn add(&mut self, t: f64, feedback: f64, torque: f64, error: f64) {
        self.count += 1.0;
        self.feedback += feedback * feedback;
        self.torque += torque * torque;
        self.error += error * error;
        self.series.push([t, feedback]);
    }
}

fn feedback(model: &Candidate, joints: &[(String, Sums)]) -> Feedback {
    let share = |part: f64, whole: f64| {
        if whole > 0.0 {
            100.0 * part / whole
        } else {
            0.0
        }
    };
    let sum = |of: fn(&Sums) -> f64| joints.iter().map(|(_, sums)| of(sums)).sum::<f64>();
    let count = sum(|s| s.count).max(1.0);
    let error = (sum(|s| s.error) / count).sqrt();
    Feedback {
        model: model.name.clone(),
        friction_only: model.friction_only,
        rms: (sum(|s| s.feedback) / count).sqrt(),
        share_percent: share(sum(|s| s.feedback), sum(|s| s.torque)),
        tracking_rms: error.is_finite().then_some(error),
        joints: joints
            .iter()
            .map(|(joint, sums)| JointFeedback {
                joint: joint.clone(),
                rms: (sums.feedback / sums.count.max(1.0)).sqrt(),
                torque_rms: (sums.torque / sums.count.max(1.0)).sqrt(),
                share_percent: share(sums.feedback, sums.torque),
            })
            .collect(),
        series: joints.iter().map(|(_, sums)| sums.series.clone()).collect(),
    }
}

/// Why a model cannot be validated.
#[derive(Debug, thiserror::Error)]
pub enum ValidateError {
    /// A log that cannot be read.
    #[error(transparent)]
    Log(#[from] crate::log::LogError),
    /// A simulation that left the real numbers.
    #[error(transparent)]
    Diverged(#[from] Diverged),
    /// A limb of too many joints.
    #[error("limb {0} has too many joints")]
    TooLarge(String),
    /// No stretch of a log from which accelerations could be taken.
    #[error("{0}: no stretch of 40 ms without a gap")]
    NoStretch(String),
}
