//! Why messages end.

use proprio_simulator::Diverged;

use super::journal::JournalError;
use crate::device::DeviceError;
use crate::device::replay::ReplayError;
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
    /// A recording of messages.
    #[error(transparent)]
    Journal(#[from] JournalError),
}
