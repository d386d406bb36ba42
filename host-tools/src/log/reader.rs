//! A log as a stream of rows, in memory that does not grow with its length.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use csv::ByteRecord;
use flate2::bufread::MultiGzDecoder;

use super::checks::{Checks, Warning};
use super::columns::{Channel, Columns, Selection};
use super::error::{LogError, Problem};
use super::slots::{Slots, TIME};
use crate::model::Robot;
use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use proprio_core::window::Sample;

/// One row of a log. Channels that the log does not have are NaN.
#[derive(Debug, Clone)]
pub struct Row {
    /// Line in the file.
    pub line: u64,
    /// Time since the first row, rounded to µs.
    pub time_us: u64,
    slots: Slots,
    values: Vec<f64>,
}

impl Row {
    fn new(slots: Slots) -> Self {
        Self {
            line: 0,
            time_us: 0,
            slots,
            values: vec![f64::NAN; slots.count()],
        }
    }

    fn part<const N: usize>(&self, first: usize) -> &[f64; N] {
        self.values[first..]
            .first_chunk()
            .expect("every group lies within the slots")
    }

    fn of_joints(&self, channel: Channel) -> &[f64] {
        &self.values[self.slots.all(channel)]
    }

    /// What the estimator of a Go2's leg takes, from a Go2's log; NaN for a leg that the log does not have. Time counts from
    /// the log's first row.
    pub fn sample(&self, leg: Leg) -> Sample<f64, JOINTS_PER_LEG> {
        let first = JOINTS_PER_LEG * leg.index();
        let of = |channel| {
            let own = self.of_joints(channel).get(first..);
            let own = own.and_then(|own| own.first_chunk());
            own.copied().unwrap_or([f64::NAN; JOINTS_PER_LEG])
        };
        Sample {
            time_us: self.time_us,
            q: of(Channel::Q),
            dq: of(Channel::Dq),
            tau: of(Channel::Tau),
        }
    }

    /// Time, s, as recorded.
    pub fn t(&self) -> f64 {
        self.values[TIME]
    }

    /// Joint positions, rad (m of a prismatic joint), in the order of the robot's joints.
    pub fn q(&self) -> &[f64] {
        self.of_joints(Channel::Q)
    }

    /// Joint velocities, rad/s (m/s).
    pub fn dq(&self) -> &[f64] {
        self.of_joints(Channel::Dq)
    }

    /// Joint torques, N m (forces, N).
    pub fn tau(&self) -> &[f64] {
        self.of_joints(Channel::Tau)
    }

    /// Motor temperatures, degrees Celsius.
    pub fn temp(&self) -> &[f64] {
        self.of_joints(Channel::Temp)
    }

    /// Commanded joint positions, rad (m).
    pub fn q_des(&self) -> &[f64] {
        self.of_joints(Channel::QDes)
    }

    /// Attitude quaternion, w x y z.
    pub fn quat(&self) -> &[f64; 4] {
        self.part(self.slots.quat())
    }

    /// Angular velocity of the base, rad/s.
    pub fn gyro(&self) -> &[f64; 3] {
        self.part(self.slots.gyro())
    }

    /// Specific force at the IMU, m/s².
    pub fn acc(&self) -> &[f64; 3] {
        self.part(self.slots.acc())
    }

    /// Foot sensors, uncalibrated, in the order of the robot's limbs.
    pub fn foot(&self) -> &[f64] {
        &self.values[self.slots.feet()]
    }
}

/// Reads a log row by row and checks each on the way.
///
/// ```no_run
/// use proprio::log::{LogReader, Selection};
///
/// let mut log = LogReader::open("walk.csv".as_ref(), Selection::Motion)?;
/// while let Some(row) = log.next_row()? {
///     println!("{} {}", row.t(), row.q()[0]);
/// }
/// for warning in log.finish()? {
///     eprintln!("{warning}");
/// }
/// # Ok::<(), proprio::log::LogError>(())
/// ```
pub struct LogReader {
    path: PathBuf,
    csv: csv::Reader<Box<dyn Read>>,
    columns: Columns,
    record: ByteRecord,
    row: Row,
    checks: Checks,
    read: Rc<Cell<u64>>,
    size: u64,
}

/// A file that counts what is read from it.
struct Counted {
    file: File,
    read: Rc<Cell<u64>>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

impl LogReader {
    /// Opens a Go2's log: [`open_of`](Self::open_of) with joints in SDK order.
    ///
    /// # Errors
    /// As [`open_of`](Self::open_of)'s.
    pub fn open(path: &Path, selection: Selection) -> Result<Self, LogError> {
        Self::open_of(path, selection, &Robot::go2())
    }

    /// Opens the log of `robot` at `path`, plain or compressed (told by content, not by name), and reads its header. Joints
    /// are found by the robot's names, limbs recorded whole or not at all.
    ///
    /// # Errors
    /// [`Problem::Open`] to [`Problem::IncompleteLimb`].
    pub fn open_of(path: &Path, selection: Selection, robot: &Robot) -> Result<Self, LogError> {
        let open = |error| LogError::new(path, Problem::Open(error));
        let file = File::open(path).map_err(open)?;
        let metadata = file.metadata().map_err(open)?;
        if metadata.is_dir() {
            return Err(open(io::ErrorKind::IsADirectory.into()));
        }
        let read = Rc::new(Cell::new(0));
        let counted = Counted {
            file,
            read: Rc::clone(&read),
        };
        let mut file = BufReader::with_capacity(1 << 16, counted);
        let gzip = file.fill_buf().map_err(open)?.starts_with(&[0x1f, 0x8b]);
        let bytes: Box<dyn Read> = if gzip {
            Box::new(MultiGzDecoder::new(file))
        } else {
            Box::new(file)
        };
        let mut csv = csv::ReaderBuilder::new()
            .has_headers(false)
            // Ragged rows are reported here, with the place.
            .flexible(true)
            .buffer_capacity(1 << 16)
            .from_reader(bytes);

        let mut record = ByteRecord::new();
        let found = csv
            .read_byte_record(&mut record)
            .map_err(|error| unreadable(path, 1, error))?;
        if !found {
            return Err(LogError::new(path, Problem::Empty).at_line(1));
        }
        let columns = Columns::new(path, line(&record), &record, selection, robot)?;
        Ok(Self {
            path: path.to_owned(),
            csv,
            row: Row::new(columns.slots),
            checks: Checks::new(&columns),
            columns,
            record,
            read,
            size: metadata.len(),
        })
    }

    /// What the log records.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Bytes of the file read so far, and in all; of a compressed file, compressed ones.
    pub fn progress(&self) -> (u64, u64) {
        (self.read.get(), self.size)
    }

    /// The next row, or none at the end.
    ///
    /// # Errors
    /// [`Problem::Read`], [`Problem::Ragged`] to [`Problem::TimeJump`].
    pub fn next_row(&mut self) -> Result<Option<&Row>, LogError> {
        let here = self.csv.position().line();
        let more = self.csv.read_byte_record(&mut self.record);
        if !more.map_err(|error| unreadable(&self.path, here, error))? {
            return Ok(None);
        }
        self.row.line = line(&self.record);
        let (found, expected) = (self.record.len(), self.columns.names.len());
        if found != expected {
            return Err(self.error(Problem::Ragged { found, expected }));
        }
        for &(cell, slot) in &self.columns.wanted {
            self.row.values[slot] =
                number(&self.record[cell]).map_err(|problem| self.cell_error(cell, problem))?;
        }
        if let Err(problem) = self.checks.row(&self.row) {
            let cell = self.columns.cell[TIME].unwrap_or_default();
            return Err(self.cell_error(cell, problem));
        }
        self.row.time_us = (self.checks.duration() * 1e6).round() as u64;
        Ok(Some(&self.row))
    }

    /// Judges the log as a whole; call it after the last row.
    ///
    /// # Errors
    /// [`Problem::TooShort`], [`Problem::TooSlow`], [`Problem::OutsideLimits`].
    pub fn finish(&self) -> Result<Vec<Warning>, LogError> {
        self.checks.finish(&self.path, &self.columns)
    }

    /// What was noticed so far.
    pub fn checks(&self) -> &Checks {
        &self.checks
    }

    fn error(&self, problem: Problem) -> LogError {
        LogError::new(&self.path, problem).at_line(self.row.line)
    }

    fn cell_error(&self, cell: usize, problem: Problem) -> LogError {
        self.error(problem)
            .at_column(cell, &self.columns.names[cell])
    }
}

fn line(record: &ByteRecord) -> u64 {
    record.position().map_or(1, csv::Position::line)
}

fn unreadable(path: &Path, line: u64, error: csv::Error) -> LogError {
    let error = match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    };
    LogError::new(path, Problem::Read(error)).at_line(line)
}

/// A finite number.
fn number(text: &[u8]) -> Result<f64, Problem> {
    let value = match fast_float2::parse(text) {
        Ok(value) => value,
        // The slow path: only here are blanks around the number worth a look.
        Err(_) => fast_float2::parse(text.trim_ascii())
            .map_err(|_| Problem::NotANumber(String::from_utf8_lossy(text).into_owned()))?,
    };
    if f64::is_finite(value) {
        Ok(value)
    } else {
        Err(Problem::NotFinite(value))
    }
}
