//! When to end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::output::asked_to_finish;

/// How long a source waits at a time before it looks whether it is to end.
pub(super) const LOOK: Duration = Duration::from_millis(20);

/// When a source ends: when it is told to, by a program or by Ctrl-C, or some time after its first message.
#[derive(Debug, Clone, Default)]
pub struct Until {
    stop: Arc<AtomicBool>,
    after: Option<Duration>,
}

impl Until {
    /// No later than so long after the first message.
    pub fn after(after: Option<Duration>) -> Self {
        Self {
            after,
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
        self.stop.load(Ordering::Relaxed) || asked_to_finish() || self.after.is_some_and(passed)
    }
}
