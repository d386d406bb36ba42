//! A log as a stream of rows, in memory that does not grow with its length.

use std::path::{Path, PathBuf};

use super::LiveInput;
use super::admission::{Admission, Step};
use super::checks::{Checks, LEAST_DURATION};
use super::columns::{Columns, Selection};
use super::error::{LogError, Place, Problem, Unit};
use super::row::Row;
use super::slots::TIME;
use super::source::{self, Source};
use super::stamps::Stamps;
use super::temperatures::Temperatures;
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
    /// The row that was read last, and the one that is given.
    read: Vec<f64>,
    row: Row,
    admission: Admission,
    stamps: Stamps,
    /// The file has no more rows, or what is wrong with the next one.
    end: Option<Option<LogError>>,
    checks: Checks,
    temperatures: Temperatures,
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
        Self::of(path, source::open(path)?, selection, robot, Stamps::new)
    }

    /// Follows a log of `robot` that is still being made, under the name `name`: its rows are let in once the next ones have come by
    /// which each is judged.
    ///
    /// # Errors
    /// As [`open_of`](Self::open_of)'s, once the first rows have come.
    pub fn follow(
        name: &Path,
        input: LiveInput,
        selection: Selection,
        robot: &Robot,
    ) -> Result<Self, LogError> {
        let source = source::open_live(name, input)?;
        Self::of(name, source, selection, robot, Stamps::live)
    }

    fn of(
        path: &Path,
        source: Box<dyn Source>,
        selection: Selection,
        robot: &Robot,
        stamps: fn(&Columns, Unit) -> Stamps,
    ) -> Result<Self, LogError> {
        let names = source.names().to_vec();
        let columns = Columns::new(path, source.header(), names, selection, robot)?;
        Ok(Self {
            path: path.to_owned(),
            read: vec![f64::NAN; columns.slots.count()],
            row: Row::new(columns.slots),
            admission: Admission::new(&columns, source.unit()),
            stamps: stamps(&columns, source.unit()),
            end: None,
            checks: Checks::new(&columns, source.unit()),
            temperatures: Temperatures::new(&columns, source.unit()),
            columns,
            source,
        })
    }

    /// What the log records.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Stamp of the first row let in, s, by the log's own clock; zero before one is.
    pub(crate) fn first(&self) -> f64 {
        self.checks.first()
    }

    /// How much of the file has been read, and of how much: bytes, of a compressed file compressed ones; messages; rows.
    pub fn progress(&self) -> (u64, u64) {
        self.source.progress()
    }

    /// The next row that a robot can have produced ([`super::Cause`] tells why others are left out), or none at the end. Its time is the row's
    /// stamp, or where a recorder fell behind ([`Warning::LateStamps`]) when it was measured.
    ///
    /// # Errors
    /// [`Problem::Read`], [`Problem::Ragged`] to [`Problem::TimeJump`].
    pub fn next_row(&mut self) -> Result<Option<&Row>, LogError> {
        while self.stamps.wants_more() {
            self.read_ahead();
            match self.admission.next(&mut self.row.values) {
                Step::Row(number) => self.stamps.push(number, &self.row.values),
                Step::LeftOut => {}
                Step::End => self.stamps.end(),
            }
        }
        let Some(number) = self.stamps.next(&mut self.row.values) else {
            return self.end.take().flatten().map_or(Ok(None), Err);
        };
        self.row.line = number;
        if let Err(problem) = self.checks.row(&self.row) {
            return Err(self.time_error(problem));
        }
        self.row.time_us = (self.checks.duration() * 1e6).round() as u64;
        Ok(Some(&self.row))
    }

    /// Reads what the next row is judged by. What is wrong with a row is told when it is its turn.
    fn read_ahead(&mut self) {
        while self.end.is_none() && self.admission.wants_more() {
            match self.source.next(&self.columns.wanted, &mut self.read) {
                Ok(Some(number)) => {
                    if let Some(motors) = &self.columns.motors {
                        motors.apply(&mut self.read);
                    }
                    self.temperatures.leave_out(number, &mut self.read);
                    self.admission.push(number, &self.read);
                }
                Ok(None) => self.end = Some(None),
                Err(fault) => {
                    let unit = self.source.unit();
                    let error = fault.error(&self.path, unit, &self.columns.names);
                    self.end = Some(Some(error));
                }
            }
        }
    }

    /// Judges the log as a whole; call it after the last row.
    ///
    /// # Errors
    /// [`Problem::TwoPublishers`], [`Problem::TooShort`], [`Problem::TooSlow`], [`Problem::OutsideLimits`].
    pub fn finish(&self) -> Result<Vec<Warning>, LogError> {
        let mut warnings = self.source.warnings();
        if let Some((place, problem)) = self.admission.problem(&self.columns) {
            return Err(LogError::new(&self.path, problem).at(Some(place)));
        }
        warnings.extend(self.admission.warnings(&self.columns));
        warnings.extend(self.temperatures.warning(&self.columns));
        warnings.extend(self.stamps.warning());
        warnings.extend(self.checks.finish(&self.path, &self.columns)?);
        Ok(warnings)
    }

    /// Whether it is long enough for any question of dynamics; call it after the last row.
    ///
    /// # Errors
    /// [`Problem::TooShort`].
    pub fn long_enough(&self) -> Result<(), LogError> {
        match self.checks.duration() < LEAST_DURATION {
            true => Err(self.checks.too_short(&self.path)),
            false => Ok(()),
        }
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
