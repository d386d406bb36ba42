//! What comes, into the view and the recording; and the files that are saved.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use crate::identify::set_possible;
use crate::model::{Model, Provenance};
use crate::monitor::{Ask, Entry, Feed, JournalWriter, Told, View};
use crate::output::WriteError;
use proprio_core::wire::Action;

use super::foxglove::Viewers;
use crate::command::Error;

/// How long one look takes at most, so that keys are heard.
const LOOK: Duration = Duration::from_millis(50);

/// A device that is watched.
pub(super) struct Session {
    pub(super) feed: Feed,
    pub(super) journal: Option<(JournalWriter, PathBuf)>,
    pub(super) view: View,
    /// Who else sees the view.
    pub(super) viewers: Option<Viewers>,
    /// Device time at which to end, µs.
    pub(super) limit_us: Option<u64>,
    /// Nothing more comes.
    pub(super) ended: bool,
    /// The source ends by itself when its user has seen enough.
    pub(super) is_live: bool,
}

impl Session {
    /// Takes what has come, and what comes within a moment; after each, `seen` looks at the view.
    pub(super) fn look(&mut self, seen: &mut dyn FnMut(&View)) -> Result<(), Error> {
        let until = Instant::now() + LOOK;
        loop {
            let patience = until.saturating_duration_since(Instant::now());
            let Some(told) = self.feed.next(patience) else {
                break;
            };
            self.hear(told)?;
            seen(&self.view);
            if self.ended || patience.is_zero() {
                break;
            }
        }
        if let Some(viewers) = &mut self.viewers {
            viewers.look(&self.view, self.ended);
        }
        self.kept(|(journal, _)| journal.flush())
    }

    fn hear(&mut self, told: Told) -> Result<(), Error> {
        match told {
            Told::Entry(at, entry) => {
                self.kept(|(journal, _)| journal.write(at, &entry))?;
                match *entry {
                    Entry::Message(message) => self.view.hear(&message),
                    Entry::Losses(bad, missed) => self.view.lose(bad, missed),
                    Entry::Request(request) => self.view.ask(request.id, request.action),
                }
            }
            Told::News(text) => self.view.happened(text),
            Told::Ended(None) => self.ended = true,
            Told::Ended(Some(error)) => return Err(error.into()),
        }
        let now_us = self.view.counters.map_or(0, |counters| counters.time_us);
        self.ended |= self.limit_us.is_some_and(|limit_us| now_us >= limit_us);
        Ok(())
    }

    fn kept(
        &mut self,
        write: impl FnOnce(&mut (JournalWriter, PathBuf)) -> std::io::Result<()>,
    ) -> Result<(), Error> {
        let Some(journal) = &mut self.journal else {
            return Ok(());
        };
        write(journal).map_err(|source| {
            Error::Write(WriteError {
                path: journal.1.clone(),
                source,
            })
        })
    }

    pub(super) fn ask(&self, action: Action) {
        self.feed.ask(Ask::Action(action));
    }

    /// Writes what was estimated as a model file; what cannot be stays as the CAD has it, and that is an event.
    pub(super) fn save(&mut self) {
        let parameters: Vec<_> = self
            .view
            .legs
            .iter()
            .flat_map(|leg| leg.parameters.iter().cloned())
            .collect();
        if parameters.is_empty() {
            self.view.happened("nothing to save yet".to_owned());
            return;
        }
        let mut model = Model::default();
        for impossible in set_possible(&parameters, &mut model) {
            self.view.happened(format!("not saved: {impossible}"));
        }
        if let Ok(provenance) = Provenance::of(&[] as &[PathBuf]) {
            model.set_provenance(provenance);
        }
        let path = free("toml");
        let saved = model.save(&path);
        self.view.happened(match saved {
            Ok(()) => format!("the model is in {}", path.display()),
            Err(error) => error.to_string(),
        });
    }

    /// Has the device's factors read and written.
    pub(super) fn save_factors(&mut self) {
        let path = free("bin");
        self.view.happened(format!("reading {}", path.display()));
        self.feed.ask(Ask::Factors(path));
    }
}

/// A name that no file has.
fn free(extension: &str) -> PathBuf {
    let names = (1..).map(|n| PathBuf::from(format!("monitor-{n}.{extension}")));
    let mut free = names.filter(|name| !name.exists());
    // Endless.
    free.next().unwrap_or_default()
}
