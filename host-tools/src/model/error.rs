//! Why a model file is refused.

use std::path::PathBuf;

use super::{Impossible, RobotError, UnknownName};

/// A model file is bad.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {problem}", .path.display(), .line.map(|line| format!(", line {line}")).unwrap_or_default())]
pub struct ModelError {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: Box<ModelProblem>,
}

/// What is wrong with a model file.
#[derive(Debug, thiserror::Error)]
pub enum ModelProblem {
    /// It cannot be read.
    #[error("cannot read the file: {0}")]
    Read(std::io::Error),
    /// It is no TOML, or a value has the wrong type.
    #[error("{0}")]
    Syntax(String),
    /// A key that does not exist.
    #[error(transparent)]
    UnknownKey(UnknownName),
    /// It does not say which version of the format it has.
    #[error("no `format`: this is not a model file")]
    NoFormat,
    /// A newer proprio wrote it.
    #[error("the file has format {found}; this proprio reads up to format {newest}")]
    Newer {
        /// Its format.
        found: i64,
        /// The newest that this version reads.
        newest: i64,
    },
    /// A joint, body or effect that does not exist.
    #[error(transparent)]
    UnknownName(UnknownName),
    /// The robot's description is bad.
    #[error(transparent)]
    Robot(RobotError),
    /// `[robot]` names no robot, or two.
    #[error("[robot] needs either `builtin` or `urdf`")]
    WhichRobot,
    /// `[base]` states two orientations, or one that is none.
    #[error("[base] needs either `rpy` in rad or a `quaternion` w, x, y, z of length 1")]
    Orientation,
    /// An effect is listed twice.
    #[error("{effect}:{joint} is listed twice")]
    Twice {
        /// The effect.
        effect: &'static str,
        /// The joint.
        joint: String,
    },
    /// A standard deviation without a value.
    #[error("{effect}:{joint} has a standard deviation but no value")]
    StdAlone {
        /// The effect.
        effect: &'static str,
        /// The joint.
        joint: String,
    },
    /// A value that nothing physical has.
    #[error("{what}: {fault}")]
    Impossible {
        /// What has it: "body FR_hip", "the prior of coulomb:FR_hip".
        what: String,
        /// What is wrong with it.
        fault: Impossible,
    },
}
