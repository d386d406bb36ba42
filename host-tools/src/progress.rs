//! A progress bar, or where nobody knows how much is left a turning sign, for what takes longer than a second.

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

    /// Says more of what is being done, once the bar is shown.
    pub(crate) fn say(&self, words: String) {
        if let Some(bar) = &self.bar {
            bar.set_message(words);
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// Shows on standard error that something is under way of which nobody knows how long it takes; only on a terminal.
pub(crate) struct Underway(Option<ProgressBar>);

impl Underway {
    /// Begins `task`, a phrase such as `Trying the catalogue`.
    pub(crate) fn new(task: &'static str) -> Self {
        let bar = || {
            let bar = ProgressBar::new_spinner().with_message(task);
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        };
        Self(std::io::stderr().is_terminal().then(bar))
    }
}

impl Underway {
    /// Says more of what is being done.
    pub(crate) fn say(&self, words: String) {
        if let Some(bar) = &self.0 {
            bar.set_message(words);
        }
    }
}

impl Drop for Underway {
    fn drop(&mut self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
