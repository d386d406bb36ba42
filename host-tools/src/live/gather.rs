//! How messages are taken from a queue.

use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError};
use std::thread;
use std::time::Duration;

/// How long a reader lets messages gather once it has taken all that waited. At a robot's 500 Hz, waking a thread for each message costs more
/// than the message; of what is watched, nobody sees a hundredth of a second.
pub(crate) const GATHER: Duration = Duration::from_millis(10);

/// What waits in `queue`, or what comes within `patience` and gathers meanwhile.
///
/// # Errors
/// [`RecvTimeoutError`], as [`Receiver::recv_timeout`]'s.
pub(crate) fn gathered<T>(queue: &Receiver<T>, patience: Duration) -> Result<T, RecvTimeoutError> {
    match queue.try_recv() {
        Ok(one) => Ok(one),
        Err(TryRecvError::Disconnected) => Err(RecvTimeoutError::Disconnected),
        Err(TryRecvError::Empty) => {
            let gather = GATHER.min(patience);
            thread::sleep(gather);
            queue.recv_timeout(patience - gather)
        }
    }
}
