//! Why messages end.

use proprio_simulator::Diverged;

use super::journal::JournalError;
use crate::device::DeviceError;
use crate::device::replay::ReplayError;

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
    /// A recording of messages.
    #[error(transparent)]
    Journal(#[from] JournalError),
}
