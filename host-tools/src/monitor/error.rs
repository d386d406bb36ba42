//! Why messages end.

use proprio_simulator::Diverged;

use super::journal::JournalError;
use crate::device::replay::ReplayError;
use crate::device::{DeviceError, RobotError};
use crate::live::LiveError;
use crate::log::LogError;

/// Why messages end.
#[derive(Debug, thiserror::Error)]
pub enum FeedError {
    /// The device.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A value of the simulated robot that does not fit a frame.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The simulated robot.
    #[error(transparent)]
    Diverged(#[from] Diverged),
    /// A live source.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// Rows of a live source that cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A live source that lacks what the estimates of a robot that walks need.
    #[error(
        "{source_name} has {lacks}: a robot that walks is estimated from all its joints, a gyro and an accelerometer"
    )]
    NoWalk {
        /// What the user calls it.
        source_name: String,
        /// What it lacks.
        lacks: &'static str,
    },
    /// A recording of messages.
    #[error(transparent)]
    Journal(#[from] JournalError),
}

impl From<RobotError> for FeedError {
    fn from(error: RobotError) -> Self {
        match error {
            RobotError::Replay(error) => Self::Replay(error),
            RobotError::Diverged(error) => Self::Diverged(error),
        }
    }
}
