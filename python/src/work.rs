//! Long work without the interpreter's lock, until Ctrl-C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::exception;

/// How often Ctrl-C is looked for.
const LOOK: Duration = Duration::from_millis(50);

/// Does `work` on a thread of its own while other threads of Python run. On Ctrl-C `KeyboardInterrupt` is raised within [`LOOK`]: `work` sees
/// its argument turn true, and what does not ask for it ends by itself, unseen.
pub(crate) fn run<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> Result<T, proprio::Error> + Send + 'static,
) -> PyResult<T> {
    let (send, receive) = channel();
    let stop = Arc::new(AtomicBool::new(false));
    let seen = Arc::clone(&stop);
    thread::Builder::new()
        .name("proprio".to_owned())
        .spawn(move || {
            // Nobody listens any more after Ctrl-C.
            let _ = send.send(work(&seen));
        })?;
    py.detach(move || {
        loop {
            match receive.recv_timeout(LOOK) {
                Ok(done) => return done.map_err(|error| exception(&error)),
                Err(RecvTimeoutError::Timeout) => {
                    if let Err(interrupt) = Python::attach(|py| py.check_signals()) {
                        stop.store(true, Ordering::Relaxed);
                        return Err(interrupt);
                    }
                }
                Err(RecvTimeoutError::Disconnected) => {
                    let text =
                        "proprio failed within; please report it, with the log and the model";
                    return Err(PyRuntimeError::new_err(text));
                }
            }
        }
    })
}
