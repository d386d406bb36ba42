//! What can be wrong with a recording.

use std::path::PathBuf;

use super::{ConditionProblem, Recording};
use crate::log::LogError;
use crate::model::{Limb, significant};

/// Why a recording tells nothing of a model.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// A log is bad.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Most of a joint's torques are beyond what it can do.
    #[error(
        "{}: the torque of {joint} is more than the robot can do in {percent:.0} % of the samples: the limit is {effort} N m",
        .log.display()
    )]
    Impossible {
        /// The log.
        log: PathBuf,
        /// The joint.
        joint: String,
        /// Share of its samples, %.
        percent: f64,
        /// Its limit, N m.
        effort: f64,
    },
    /// There is too little to say anything, or to hold anything out.
    #[error("{}: too short: {samples} samples, {} s{}; at least {least} s are needed", names(.logs), significant(*.duration, 3), frozen(*.repeated, *.duration >= *.least))]
    TooShort {
        /// The logs.
        logs: Vec<PathBuf>,
        /// Samples of the logs together.
        samples: u64,
        /// How many of them repeat the one before, of the limb that has most.
        repeated: u64,
        /// Length of the logs together, s.
        duration: f64,
        /// What is needed, s.
        least: f64,
    },
    /// A condition does not say which part is meant.
    #[error("--only `{text}`: {problem}")]
    Condition {
        /// As written.
        text: String,
        /// What is wrong.
        problem: Box<ConditionProblem>,
    },
    /// No joint moves: rows of one at rest say nothing.
    #[error("{}: no joint moves", names(.logs))]
    AtRest {
        /// The logs.
        logs: Vec<PathBuf>,
    },
    /// A rollout under the commanded torque needs a command that no log has.
    #[error("{}: no column `{column}`: what {joint} was asked to do is not known", names(.logs))]
    NoCommand {
        /// The logs.
        logs: Vec<PathBuf>,
        /// The joint.
        joint: String,
        /// The column.
        column: String,
    },
    /// The drive follows a position, and nobody says how stiffly.
    #[error("{}: {joint} has a commanded position, and its drive's gains are not known", names(.logs))]
    NoGains {
        /// The logs.
        logs: Vec<PathBuf>,
        /// The joint.
        joint: String,
    },
    /// Every limb recorded has more joints than can be judged.
    #[error(
        "{}: limb {}; limbs of at most {} can be judged",
        names(.logs), in_words(.limbs), super::MAX_JOINTS
    )]
    LimbTooLarge {
        /// The logs.
        logs: Vec<PathBuf>,
        /// The limbs recorded.
        limbs: Vec<Limb>,
    },
}

impl RecordingError {
    /// Too short for what needs this time, s.
    pub(crate) fn too_short(recording: &Recording, least: f64) -> Self {
        Self::TooShort {
            logs: recording.logs.clone(),
            samples: recording
                .gates
                .iter()
                .map(|of| of.report.sampling.samples)
                .sum(),
            repeated: (recording.limbs.iter())
                .map(|(_, limb)| limb.repeated)
                .max()
                .unwrap_or(0),
            duration: recording.duration,
            least,
        }
    }

    pub(crate) fn at_rest(recording: &Recording) -> Self {
        Self::AtRest {
            logs: recording.logs.clone(),
        }
    }
}

/// What of samples that last long enough does not count.
fn frozen(repeated: u64, is_long: bool) -> String {
    match repeated {
        n if is_long && n > 0 => {
            format!(", but {n} samples repeat the one before and do not count")
        }
        _ => String::new(),
    }
}

/// `torso has 9 joints, tail has 12 joints`
fn in_words(limbs: &[Limb]) -> String {
    let words = limbs
        .iter()
        .map(|limb| format!("{} has {} joints", limb.name, limb.bodies.len()));
    words.collect::<Vec<_>>().join(", ")
}

fn names(logs: &[PathBuf]) -> String {
    let names: Vec<String> = logs.iter().map(|log| log.display().to_string()).collect();
    names.join(", ")
}
