//! When to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::output::asked_to_finish;

/// How long a source waits at a time before it looks whether it is to end.
pub(super) const LOOK: Duration = Duration::from_millis(20);

/// When a source ends: when it is told to, by a program or by Ctrl-C, at a time, or some time after its first message.
#[derive(Debug, Clone, Default)]
pub struct Until {
    stop: Arc<AtomicBool>,
    after: Option<Duration>,
    at: Option<Instant>,
}

impl Until {
    /// No later than so long after the first message.
    pub fn after(after: Option<Duration>) -> Self {
        Self {
            after,
            ..Self::default()
        }
    }

    /// No later than so long after now.
    pub fn within(time: Option<Duration>) -> Self {
        Self {
            at: time.and_then(|time| Instant::now().checked_add(time)),
            ..Self::default()
        }
    }

    /// Ends the source.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Whether it has ended, if its first message came at `first`.
    pub(super) fn is_over(&self, first: Option<Instant>) -> bool {
        let passed = |after: Duration| first.is_some_and(|first| first.elapsed() >= after);
        let is_late = self.at.is_some_and(|at| Instant::now() >= at);
        self.stop.load(Ordering::Relaxed)
            || asked_to_finish()
            || is_late
            || self.after.is_some_and(passed)
    }
}
