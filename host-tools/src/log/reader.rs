//! A log as a stream of rows, in memory that does not grow with its length.

use std::path::{Path, PathBuf};

use super::checks::Checks;
use super::columns::{Columns, Selection};
use super::error::{LogError, Place, Problem};
use super::row::Row;
use super::slots::TIME;
use super::source::{self, Source};
use super::warning::Warning;
use crate::model::Robot;

/// Reads a log row by row and checks each on the way.
///
/// ```no_run
/// use proprio_host::log::{LogReader, Selection};
///
/// let mut log = LogReader::open("walk.csv".as_ref(), Selection::Motion)?;
/// while let Some(row) = log.next_row()? {
///     println!("{} {}", row.t(), row.q()[0]);
/// }
/// for warning in log.finish()? {
///     eprintln!("{warning}");
/// }
/// # Ok::<(), proprio_host::log::LogError>(())
/// ```
pub struct LogReader {
    path: PathBuf,
    source: Box<dyn Source>,
    columns: Columns,
    row: Row,
    checks: Checks,
}

impl LogReader {
    /// Opens a Go2's log: [`open_of`](Self::open_of) with joints in SDK order.
    ///
    /// # Errors
    /// As [`open_of`](Self::open_of)'s.
    pub fn open(path: &Path, selection: Selection) -> Result<Self, LogError> {
        Self::open_of(path, selection, &Robot::go2())
    }

    /// Opens the log of `robot` at `path`, of any format that is known (told by content, not by name), `-` for standard
    /// input, and finds its channels. Joints are found by the robot's names, limbs recorded whole or not at all.
    ///
    /// # Errors
    /// [`Problem::Open`] to [`Problem::IncompleteLimb`].
    pub fn open_of(path: &Path, selection: Selection, robot: &Robot) -> Result<Self, LogError> {
        let source = source::open(path)?;
        let names = source.names().to_vec();
        let columns = Columns::new(path, source.header(), names, selection, robot)?;
        Ok(Self {
            path: path.to_owned(),
            row: Row::new(columns.slots),
            checks: Checks::new(&columns, source.unit()),
            columns,
            source,
        })
    }

    /// What the log records.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// How much of the file has been read, and of how much: bytes, of a compressed file compressed ones; messages; rows.
    pub fn progress(&self) -> (u64, u64) {
        self.source.progress()
    }

    /// The next row, or none at the end.
    ///
    /// # Errors
    /// [`Problem::Read`], [`Problem::Ragged`] to [`Problem::TimeJump`].
    pub fn next_row(&mut self) -> Result<Option<&Row>, LogError> {
        let next = self.source.next(&self.columns.wanted, &mut self.row.values);
        let next =
            next.map_err(|fault| fault.error(&self.path, self.source.unit(), &self.columns.names))?;
        let Some(number) = next else {
            return Ok(None);
        };
        self.row.line = number;
        if let Some(motors) = &self.columns.motors {
            motors.apply(&mut self.row.values);
        }
        if let Err(problem) = self.checks.row(&self.row) {
            return Err(self.time_error(problem));
        }
        self.row.time_us = (self.checks.duration() * 1e6).round() as u64;
        Ok(Some(&self.row))
    }

    /// Judges the log as a whole; call it after the last row.
    ///
    /// # Errors
    /// [`Problem::TooShort`], [`Problem::TooSlow`], [`Problem::OutsideLimits`].
    pub fn finish(&self) -> Result<Vec<Warning>, LogError> {
        let mut warnings = self.source.warnings();
        warnings.extend(self.checks.finish(&self.path, &self.columns)?);
        Ok(warnings)
    }

    /// What was noticed so far.
    pub fn checks(&self) -> &Checks {
        &self.checks
    }

    fn time_error(&self, problem: Problem) -> LogError {
        let place = Place {
            unit: self.source.unit(),
            number: self.row.line,
        };
        let cell = self.columns.cell[TIME].unwrap_or_default();
        LogError::new(&self.path, problem)
            .at(Some(place))
            .at_column(cell, self.columns.column_name(cell))
    }
}
