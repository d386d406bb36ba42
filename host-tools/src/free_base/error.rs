//! Why no parameters come out of a walk.

use std::path::PathBuf;

use super::windows::Windows;
use crate::log::LogError;
use crate::name::UnknownName;

/// Why no parameters come out of a walk.
#[derive(Debug, thiserror::Error)]
pub enum FreeBaseError {
    /// A log is bad.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A log lacks what a moving base needs.
    #[error("{}: a free base needs {what}, and the log does not have it", .path.display())]
    Missing {
        /// The log.
        path: PathBuf,
        /// What it lacks.
        what: &'static str,
    },
    /// The gyro or the accelerometer does not read what such a sensor reads.
    #[error("{}: {cause}", .path.display())]
    Imu {
        /// The log.
        path: PathBuf,
        /// Which columns, why, and the remedy.
        cause: String,
    },
    /// Nothing is left between gaps, touch-downs and faults.
    #[error(
        "no window is left: {} were cut by touch-downs and lift-offs, {} lost to impacts, {} to gaps, {} left out because the robot \
         stands still; {} samples cannot be true",
        .0.cut, .0.impact, .0.gap, .0.still, .0.rejected
    )]
    NoWindows(Box<Windows>),
    /// Nothing is said of what touches the ground.
    #[error(
        "no foot of {robot} is known: its description has no link of that name at the end of a limb, and the model states no [[foot]]"
    )]
    NoFeet {
        /// The robot.
        robot: String,
    },
    /// What hangs on the base does not walk.
    #[error("the foot {foot} is on a link that is fixed to the base: no joint moves it")]
    FootOnBase {
        /// Its name.
        foot: String,
    },
    /// A foot or an IMU is on a link that is none.
    #[error("{0}")]
    Facts(UnknownName),
    /// An effect that walks are not judged with.
    #[error(
        "a walk does not identify {effect} at {place}: that needs the transmitted torque, which contact forces change, or another sensor; \
         `proprio remove {effect}:{place}` takes it out"
    )]
    Effect {
        /// Which.
        effect: &'static str,
        /// Its joint, or the base.
        place: String,
    },
    /// A log too short to be told apart from itself.
    #[error("too short to hold a part of the time out: walk for ten seconds at least")]
    TooShort,
    /// The linear algebra refused; the data passed every check before it.
    #[error("the parameters cannot be solved for: the logs' numbers overflow")]
    Unsolvable,
}
