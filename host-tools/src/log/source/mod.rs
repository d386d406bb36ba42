//! Files of many formats as one thing: named cells, row after row.
//!
//! Each format is a [`Source`]. It names its cells as the recorder did, in a spelling of [`super::names`]; which of them mean
//! what for a robot is decided in [`super::columns`], in one place for all formats.
//!
//! Files beside:
//!
//! - `arrays`: named arrays as a log: of a NumPy archive, of a program's memory
//! - `bag`: recordings of messages: which topic holds the joints' states, what its messages say, and when
//! - `bus`: captures of motor buses, whole or still being made: polling cycles, by the device's own listener
//! - `chain`: files of one recording, one after the other
//! - `decimal`: plain decimals, as nearly all numbers of a log are written
//! - `input`: bytes: of a file, of a folder's files, or of standard input
//! - `kind`: what a file is, told by its first bytes
//! - `lerobot`: what a LeRobot data set says of its tables: `meta/info.json`, two folders above them
//! - `memory`: logs that a program holds in memory
//! - `npz`: NumPy archives: `numpy.savez('log.npz', t=t, q=q, dq=dq, tau=tau, joint_names=[...])`, or an array per column
//! - `parquet`: Parquet tables: columns as of CSV, or lists of numbers whose elements a LeRobot data set names
//! - `records`: records of separated text
//! - `table`: arrays held in memory: formats that store a column in one piece
//! - `text`: columns of text: CSV of proprio's own, of PlotJuggler, of ROS 1's `rostopic echo -p`, of a spreadsheet

mod arrays;
#[cfg(any(feature = "mcap", feature = "db3"))]
pub(super) mod bag;
mod bus;
mod chain;
mod decimal;
mod input;
mod kind;
#[cfg(feature = "parquet")]
mod lerobot;
pub(super) mod memory;
#[cfg(feature = "npz")]
mod npz;
#[cfg(feature = "parquet")]
mod parquet;
mod records;
mod table;
mod text;

use std::path::{Path, PathBuf};

use super::LiveInput;
use super::error::{LogError, Place, Problem, Unit};
use super::warning::Warning;
pub use input::files;
pub(crate) use input::open as open_bytes;
use kind::Kind;

/// Rows of a file, whatever its format.
pub(super) trait Source {
    /// What the recorder calls the cells of a row.
    fn names(&self) -> &[String];

    /// What rows are counted in.
    fn unit(&self) -> Unit;

    /// Where the names are; none if they are nowhere in particular.
    fn header(&self) -> Option<Place> {
        None
    }

    /// Reads the next row's wanted cells into the slots of `values`: its number, counted from 1, or none at the end.
    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault>;

    /// Bytes (or rows) read so far, and in all.
    fn progress(&self) -> (u64, u64);

    /// What its time is counted from, ns of a clock that several files share; none if each starts its own.
    fn origin(&self) -> Option<i64> {
        None
    }

    /// Counts time from this moment of that clock on, ns.
    fn count_from(&mut self, _origin: i64) {}

    /// What a user should know of the file, once all of it is read.
    fn warnings(&self) -> Vec<Warning> {
        Vec::new()
    }
}

/// A cell that is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Wanted {
    /// Its place in a row of the file.
    pub(super) cell: usize,
    /// Its place in a row in memory.
    pub(super) slot: usize,
    /// What its number is multiplied by.
    pub(super) scale: f64,
    /// What to do where it is empty.
    pub(super) empty: Empty,
}

/// What to do with a cell that holds nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Empty {
    /// Refuse the log: every row of it is whole.
    Refuse,
    /// Skip the row: the file has rows of other messages too.
    Skip,
    /// Not a number.
    Nan,
}

/// What is wrong, and where in the file.
#[derive(Debug)]
pub(super) struct Fault {
    /// Number of the row.
    pub(super) number: Option<u64>,
    /// The cell at fault.
    pub(super) cell: Option<usize>,
    pub(super) problem: Box<Problem>,
}

impl Fault {
    pub(super) fn new(number: u64, problem: Problem) -> Self {
        Self {
            number: Some(number),
            cell: None,
            problem: Box::new(problem),
        }
    }

    pub(super) fn at(number: u64, cell: usize, problem: Problem) -> Self {
        Self {
            cell: Some(cell),
            ..Self::new(number, problem)
        }
    }

    /// The fault as the error of a log.
    pub(super) fn error(self, path: &Path, unit: Unit, names: &[String]) -> LogError {
        let mut error = LogError::new(path, *self.problem);
        error.place = self.number.map(|number| Place { unit, number });
        match self.cell {
            Some(cell) => error.at_column(cell, names.get(cell).map_or("", String::as_str)),
            None => error,
        }
    }
}

/// Opens what lies at `path`: a log in memory, a file of any format that is known, a folder that holds a recording, or `-`, standard input.
pub(super) fn open(path: &Path) -> Result<Box<dyn Source>, LogError> {
    if let Some(kept) = memory::arrays(path) {
        return arrays::open(path, kept.to_vec());
    }
    let files = files(path).map_err(|error| LogError::new(path, Problem::Open(error)))?;
    let mut sources = Vec::with_capacity(files.len());
    for file in &files {
        sources.push(open_file(path, file)?);
    }
    chain::of(path, sources)
}

fn open_file(path: &Path, file: &PathBuf) -> Result<Box<dyn Source>, LogError> {
    // What is read in place of standard input is called by the user's name for it.
    let called = if path == Path::new("-") { path } else { file };
    let failed = |error| LogError::new(called, Problem::Open(error));
    let input = input::open(file).map_err(failed)?;
    let kind = kind::of(input.start(), file);
    match kind {
        Kind::Capture => bus::open(called, input),
        Kind::Text | Kind::Gzip => text::open(called, input, kind == Kind::Gzip),
        #[cfg(feature = "mcap")]
        Kind::Mcap => bag::mcap(called, input),
        #[cfg(feature = "db3")]
        Kind::Sqlite => bag::sqlite(called, input),
        #[cfg(feature = "npz")]
        Kind::Npz => npz::open(called, input),
        #[cfg(feature = "parquet")]
        Kind::Parquet => parquet::open(called, file, input),
        #[cfg(not(feature = "mcap"))]
        Kind::Mcap => Err(not_built(
            called,
            "an MCAP recording, as of a rosbag2",
            "mcap",
        )),
        #[cfg(not(feature = "db3"))]
        Kind::Sqlite => Err(not_built(
            called,
            "an SQLite database, as of a rosbag2",
            "db3",
        )),
        #[cfg(not(feature = "npz"))]
        Kind::Npz => Err(not_built(called, "a NumPy archive", "npz")),
        #[cfg(not(feature = "parquet"))]
        Kind::Parquet => Err(not_built(called, "a Parquet table", "parquet")),
        Kind::Empty => {
            let fault = Fault::new(1, Problem::Empty);
            Err(fault.error(called, Unit::Line, &[]))
        }
        Kind::Other { what, way } => Err(LogError::new(called, Problem::NotALog { what, way })),
    }
}

/// Opens what comes while it is read; `name` is what to call it.
pub(super) fn open_live(name: &Path, input: LiveInput) -> Result<Box<dyn Source>, LogError> {
    match input {
        LiveInput::Text(text) => text::open_live(name, text),
        LiveInput::Buses(captures) => bus::open_live(name, captures),
        #[cfg(feature = "mcap")]
        LiveInput::Messages {
            topic,
            kind,
            messages,
        } => bag::live(name, topic, kind, messages),
    }
}

/// A format whose reader was left out of this build.
#[cfg(not(all(
    feature = "mcap",
    feature = "db3",
    feature = "npz",
    feature = "parquet"
)))]
fn not_built(path: &Path, what: &'static str, feature: &'static str) -> LogError {
    LogError::new(path, Problem::NotBuilt { what, feature })
}
