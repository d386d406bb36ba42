//! Rows of a live source or of a log as steps of motor buses, for the device in this process.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use proprio_core::go2::{LEGS, Leg};
use proprio_core::wire::Imu;

use super::error::FeedError;
use crate::device::replay::walk_step;
use crate::device::{BusStep, RowSteps, WalkStep};
use crate::live::{Counts, LiveError, Source, Until, gathered};
use crate::log::{LogError, LogReader, Selection};
use crate::model::Robot;

/// Steps that may wait: two seconds of a robot's.
const WAITING: usize = 1024;

/// What a source of rows gave.
#[derive(Debug)]
pub(super) enum Step {
    /// A row that the gate of all logs has let in; of a robot that walks, with what its IMU reads.
    Row(Option<Imu>, BusStep),
    /// Nothing new for now.
    Silence,
    /// Nothing more comes; what a user should know of all that came.
    End(Vec<String>),
}

/// A robot that is followed, live or in a log.
pub struct Live {
    steps: Receiver<Result<Step, FeedError>>,
    until: Until,
    counts: Counts,
}

impl Live {
    /// Follows `source`, a Go2's, called `name`, which `walks` or hangs.
    ///
    /// # Errors
    /// [`LiveError::Thread`].
    pub fn follow(
        name: PathBuf,
        source: Source,
        walks: bool,
        until: Until,
        counts: Counts,
    ) -> Result<Self, LiveError> {
        let called = name.clone();
        let open = move |selection, robot: &Robot| {
            LogReader::follow(&called, source.into_input(), selection, robot)
        };
        Self::read(name, open, walks, until, counts)
    }

    /// Follows the log at `path`, of any format, of a Go2 that `walks` or hangs.
    ///
    /// # Errors
    /// [`LiveError::Thread`].
    pub fn of_log(path: PathBuf, walks: bool) -> Result<Self, LiveError> {
        let file = path.clone();
        let open = move |selection, robot: &Robot| LogReader::open_of(&file, selection, robot);
        Self::read(path, open, walks, Until::default(), Counts::default())
    }

    /// Follows what `open` opens, in a thread of its own: a reader stays in the thread that opens it.
    fn read(
        name: PathBuf,
        open: impl FnOnce(Selection, &Robot) -> Result<LogReader, LogError> + Send + 'static,
        walks: bool,
        until: Until,
        counts: Counts,
    ) -> Result<Self, LiveError> {
        let (send, steps) = sync_channel(WAITING);
        let named = thread::Builder::new().name("rows".to_owned());
        named
            .spawn(move || {
                let robot = Robot::go2();
                let end = match walks {
                    true => open(Selection::Everything, &robot)
                        .map_err(FeedError::from)
                        .and_then(|reader| read_walk(&name, reader, &send)),
                    false => open(Selection::Motion, &robot)
                        .map_err(FeedError::from)
                        .and_then(|reader| read(reader, &send)),
                };
                // Nobody takes it if the monitor has ended.
                let _ = send.send(end.map(Step::End));
            })
            .map_err(LiveError::Thread)?;
        Ok(Self {
            steps,
            until,
            counts,
        })
    }

    /// What comes within `patience`.
    pub(super) fn next(&self, patience: Duration) -> Result<Step, FeedError> {
        match gathered(&self.steps, patience) {
            Ok(step) => step,
            Err(RecvTimeoutError::Timeout) => Ok(Step::Silence),
            Err(RecvTimeoutError::Disconnected) => Ok(Step::End(Vec::new())),
        }
    }

    /// Messages that never came, and those of other writers.
    pub(super) fn losses(&self) -> (u64, u64) {
        self.counts.with(|tally| (tally.lost, tally.other_writers))
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        self.until.stop();
    }
}

/// Sends each row as a step; what the reader noticed at the end.
fn read(
    mut reader: LogReader,
    send: &SyncSender<Result<Step, FeedError>>,
) -> Result<Vec<String>, FeedError> {
    let legs: Vec<Leg> = reader.columns().legs().collect();
    let mut steps = RowSteps::new(&legs);
    while let Some(row) = reader.next_row()? {
        let Some(step) = steps.step(row)? else {
            continue;
        };
        if send.send(Ok(Step::Row(None, step))).is_err() {
            return Ok(Vec::new());
        }
    }
    Ok(noticed(&reader))
}

/// The same of a robot that walks.
fn read_walk(
    name: &Path,
    mut reader: LogReader,
    send: &SyncSender<Result<Step, FeedError>>,
) -> Result<Vec<String>, FeedError> {
    let columns = reader.columns();
    let lacks = match () {
        () if columns.legs().count() < LEGS => Some("not all legs"),
        () if !columns.has_gyro() => Some("no gyro"),
        () if !columns.has_acc() => Some("no accelerometer"),
        () => None,
    };
    if let Some(lacks) = lacks {
        let source_name = name.display().to_string();
        return Err(FeedError::NoWalk { source_name, lacks });
    }
    while let Some(row) = reader.next_row()? {
        let WalkStep { imu, bus } = walk_step(&row.walk_sample())?;
        if send.send(Ok(Step::Row(Some(imu), bus))).is_err() {
            return Ok(Vec::new());
        }
    }
    Ok(noticed(&reader))
}

/// Too short a look is no error of a view.
fn noticed(reader: &LogReader) -> Vec<String> {
    let warnings = reader.finish().unwrap_or_default();
    warnings.iter().map(ToString::to_string).collect()
}
