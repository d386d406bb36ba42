//! What `record` says: while it records, and at the end.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::live::{Source, Tally};
use serde::Serialize;

use super::Recording;

/// What was recorded.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    source: String,
    output: PathBuf,
    /// The topic, and its type.
    #[serde(skip_serializing_if = "Option::is_none")]
    topic: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    kind: Option<&'static str>,
    /// Messages or rows in the file.
    recorded: u64,
    /// From the first to the last, s.
    seconds: f64,
    /// Of them a second.
    rate: f64,
    #[serde(flatten)]
    tally: Tally,
    /// What a user should know of what came.
    pub(super) warnings: Vec<String>,
}

impl Report {
    pub(super) fn new(source: &str, output: &Path) -> Self {
        Self {
            source: source.to_owned(),
            output: output.to_owned(),
            topic: None,
            kind: None,
            recorded: 0,
            seconds: 0.0,
            rate: 0.0,
            tally: Tally::default(),
            warnings: Vec::new(),
        }
    }

    /// Takes note of what the source is.
    pub(super) fn follows(&mut self, source: &Source) {
        match source {
            Source::Text(_) | Source::Buses(_) => {}
            #[cfg(feature = "mcap")]
            Source::Messages { topic, kind, .. } => {
                self.topic = Some(topic.clone());
                self.kind = Some(kind);
            }
        }
    }

    pub(super) fn ends(&mut self, recording: &Recording) {
        self.recorded = recording.recorded;
        self.seconds = recording.seconds();
        if self.seconds > 0.0 {
            self.rate = recording.recorded.saturating_sub(1) as f64 / self.seconds;
        }
        self.tally = recording.counts.now();
        self.warnings = self.of_tally();
        self.warnings.extend_from_slice(&recording.warnings);
    }

    /// What the counts say.
    fn of_tally(&self) -> Vec<String> {
        let tally = &self.tally;
        let all = [
            (
                tally.lost,
                "never came: the network or this machine was too slow",
            ),
            (tally.repeated, "came twice or late, and are left out"),
            (
                tally.other_writers,
                "are of another writer, and are left out: stop it, or choose another topic",
            ),
            (
                tally.wrong_type,
                "are of a writer with another type, and are left out",
            ),
            (
                tally.unreadable,
                "are not as long as their type says, and are left out",
            ),
            (tally.overrun, "came faster than they could be written"),
        ];
        let mut warnings: Vec<String> = all
            .into_iter()
            .filter(|(count, _)| *count > 0)
            .map(|(count, what)| format!("messages that {what}: {count}"))
            .collect();
        if tally.other_type_writers > 0 {
            warnings.push(format!(
                "writers that give the topic another type: {}",
                tally.other_type_writers
            ));
        }
        if tally.restarts > 0 {
            warnings.push(format!(
                "the writer was started again: {} times",
                tally.restarts
            ));
        }
        if tally.gaps > 0 {
            warnings.push(format!(
                "gaps: {}, the longest {:.3} s; no window bridges them",
                tally.gaps, tally.longest_silence
            ));
        }
        warnings
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = match (&self.topic, self.kind) {
            (Some(topic), Some(kind)) => format!("messages of {topic} ({kind})"),
            _ => "rows".to_owned(),
        };
        writeln!(
            f,
            "Recorded {} {what}, {:.1} s, {:.1} a second, in {}",
            self.recorded,
            self.seconds,
            self.rate,
            self.output.display()
        )?;
        writeln!(f, "Next: proprio diagnose {}", self.output.display())
    }
}

/// One line of what came so far, and in the last second.
pub(super) fn progress(tally: &Tally, in_last_second: u64) -> String {
    format!(
        "{} messages, {in_last_second} a second, {} lost, {} gaps; Ctrl-C ends",
        tally.messages, tally.lost, tally.gaps
    )
}
