//! Where a model is wrong, and which physical effect it lacks (`design.md` §6).
//!
//! 1. [`recording`]: logs in memory, limb by limb; [`gate`] says what is wrong with the data before a model is blamed.
//! 2. `motion` (with `speed`, `play`), `column`, `rows`, `windows`: the momentum equation over windows, with a column for
//!    every effect of the catalogue.
//! 3. `whitening`, `folds`, `blocks`: rows made independent of their neighbours, time cut into what is held out in turn, one
//!    square-root factor per block of time; from here on the data are not needed.
//! 4. `triangle`, `limb`: the weighted least squares of a limb, its held-out error, and what each effect would add.
//! 5. `scan`, `selection`, [`diagnosis`]: shapes, forward-backward selection, look-alikes, verdict; `contact` comes before, and
//!    `drift` and `bursts` look at what is left.
//! 6. [`residual`], [`comparison`]: where and when a model fails, against baselines.

pub(crate) mod blocks;
mod bursts;
pub(crate) mod column;
pub mod comparison;
mod contact;
pub mod diagnosis;
mod dot;
mod drift;
pub(crate) mod folds;
mod foot;
pub mod gate;
pub(crate) mod limb;
mod limbs;
pub(crate) mod motion;
mod play;
pub mod recording;
pub mod residual;
pub(crate) mod rigid_body;
pub(crate) mod rows;
mod scan;
mod selection;
mod series;
mod speed;
pub(crate) mod triangle;
pub(crate) mod velocity;
pub(crate) mod whitening;
pub(crate) mod windows;

pub use comparison::{Comparison, compare};
pub use diagnosis::{Diagnosis, diagnose};
pub use recording::{Recording, gate_words};

use std::path::PathBuf;

use crate::log::LogError;
use crate::model::Limb;

/// Why a model cannot be criticised.
#[derive(Debug, thiserror::Error)]
pub enum CriticismError {
    /// A log is bad.
    #[error(transparent)]
    Log(#[from] LogError),
    /// There is too little to hold anything out.
    #[error(
        "{duration:.1} s of samples are too short to be cut into blocks that are held out in turn"
    )]
    TooShort {
        /// Length of the logs together, s.
        duration: f64,
    },
    /// No joint moves: rows of one at rest say nothing.
    #[error("{}: no joint moves", names(.logs))]
    AtRest {
        /// The logs.
        logs: Vec<PathBuf>,
    },
    /// Every limb recorded has more joints than can be judged.
    #[error(
        "{}: limb {}; limbs of at most {} can be judged",
        names(.logs), in_words(.limbs), rigid_body::MAX_JOINTS
    )]
    LimbTooLarge {
        /// The logs.
        logs: Vec<PathBuf>,
        /// The limbs recorded.
        limbs: Vec<Limb>,
    },
}

impl CriticismError {
    pub(crate) fn at_rest(recording: &Recording) -> Self {
        Self::AtRest {
            logs: recording.logs.clone(),
        }
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
