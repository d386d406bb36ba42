//! A progress bar for what takes longer than a second.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Nothing is shown before this has passed.
const PATIENCE: Duration = Duration::from_secs(1);

/// Shows on standard error how much of a task is done; only on a terminal and only after a second.
pub(crate) struct Progress {
    task: &'static str,
    start: Instant,
    on_terminal: bool,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Begins `task`, a phrase such as `Reading walk.csv`.
    pub(crate) fn new(task: &'static str) -> Self {
        let on_terminal = std::io::stderr().is_terminal();
        Self {
            task,
            start: Instant::now(),
            on_terminal,
            bar: None,
        }
    }

    /// `done` of `total` units are done; cheap enough for every hundredth row.
    pub(crate) fn set(&mut self, done: u64, total: u64) {
        if !self.on_terminal || self.start.elapsed() < PATIENCE {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{msg} {bar:30} {percent} % {eta} left");
            let style = style.unwrap_or_else(|_| ProgressStyle::default_bar());
            ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr())
                .with_style(style)
                .with_message(self.task)
        });
        bar.set_position(done);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
