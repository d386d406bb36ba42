//! Where a model is wrong, and which physical effect it lacks.

mod blocks;
mod column;
mod diagnosis;
mod limb;
mod motion;
mod recording;
mod rigid_body;
mod rows;
mod triangle;
mod velocity;

pub use diagnosis::{
    Alternative, CandidateReport, Diagnosis, JointError, ParameterReport, PathStep, Verdict,
    diagnose,
};
pub use recording::Recording;

use crate::log::LogError;
mod selection;

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
}
