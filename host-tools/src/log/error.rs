//! What can be wrong with a log, and where.

use std::fmt;
use std::path::{Path, PathBuf};

/// A log that cannot be used: the file, the place in it, and what is wrong there.
#[derive(Debug, thiserror::Error)]
pub struct LogError {
    /// The file as the user named it.
    pub path: PathBuf,
    /// Line in the file, counted from 1; none when the file could not be opened.
    pub line: Option<u64>,
    /// The column, where one is to blame.
    pub column: Option<Box<Column>>,
    /// What is wrong.
    #[source]
    pub problem: Box<Problem>,
}

/// A column of a log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Number, counted from 1.
    pub number: usize,
    /// Name in the header.
    pub name: String,
}

impl LogError {
    pub(super) fn new(path: &Path, problem: Problem) -> Self {
        Self {
            path: path.to_owned(),
            line: None,
            column: None,
            problem: Box::new(problem),
        }
    }

    pub(super) fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    pub(super) fn at_column(mut self, index: usize, name: &str) -> Self {
        self.column = Some(Box::new(Column {
            number: index + 1,
            name: name.to_owned(),
        }));
        self
    }
}

impl fmt::Display for LogError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())?;
        if let Some(line) = self.line {
            write!(f, ", line {line}")?;
        }
        if let Some(column) = &self.column {
            write!(f, ", column {} ({})", column.number, column.name)?;
        }
        write!(f, ": {}", self.problem)
    }
}

/// The rules a log must keep.
#[derive(Debug, thiserror::Error)]
pub enum Problem {
    /// The file cannot be opened.
    #[error("cannot open the log: {0}")]
    Open(#[source] std::io::Error),
    /// Reading failed part-way (a cut-off .gz, a disk error).
    #[error("cannot read on: {0}")]
    Read(#[source] std::io::Error),
    /// Nothing in the file.
    #[error("the log is empty")]
    Empty,
    /// The first line is numbers.
    #[error("the log has no header: its first line is numbers")]
    NoHeader,
    /// The first line has one column, with other separators in it.
    #[error("the header is not separated by commas but by `{0}`")]
    Separator(char),
    /// No column of this name.
    #[error("the header has no column `{name}`")]
    MissingColumn {
        /// The column that was looked for.
        name: String,
    },
    /// The header names a column twice.
    #[error("the column appears twice; the first is column {first}")]
    DuplicateColumn {
        /// Number of the first one, counted from 1.
        first: usize,
    },
    /// A channel of the format with a joint or limb that the robot does not have.
    #[error("the robot `{robot}` has no joint or limb `{name}`")]
    UnknownName {
        /// The name as written.
        name: String,
        /// The robot.
        robot: String,
        /// The full column name nearest in spelling.
        nearest: String,
    },
    /// Joints are recorded, but not one of the robot's.
    #[error("`{name}` is no joint of the robot `{robot}`, nor is any other that the header names")]
    OtherRobot {
        /// The first such name as written.
        name: String,
        /// The robot that was expected.
        robot: String,
        /// Its joints.
        joints: Vec<String>,
    },
    /// Not one joint is recorded.
    #[error("the header names no joint: there is no column `q/…`, `dq/…` or `tau/…`")]
    NoJoints {
        /// The robot's joints.
        joints: Vec<String>,
    },
    /// A joint has one of position, velocity and torque but not all.
    #[error("{joint} is recorded, but the header has no column `{missing}`")]
    MissingChannel {
        /// The joint.
        joint: String,
        /// The column it lacks.
        missing: String,
    },
    /// A limb has some of its joints.
    #[error("limb {limb} has {present} but not {missing}")]
    IncompleteLimb {
        /// The limb.
        limb: String,
        /// A joint of it that is recorded.
        present: String,
        /// A joint of it that is not.
        missing: String,
    },
    /// A row is longer or shorter than the header.
    #[error("the row has {found} cells, the header {expected}")]
    Ragged {
        /// Cells in this row.
        found: usize,
        /// Columns in the header.
        expected: usize,
    },
    /// Text where a number belongs.
    #[error("`{0}` is not a number")]
    NotANumber(String),
    /// A number that is not finite.
    #[error("the value is {0}; every value must be finite")]
    NotFinite(f64),
    /// A time stamp before that of the row above.
    #[error("time runs backwards: {now} s after {before} s on the line above")]
    TimeBackwards {
        /// Time stamp of the row above, s.
        before: f64,
        /// Time stamp of this row, s.
        now: f64,
    },
    /// A jump in time that is no lost message: two recordings in one file, or a clock that was set.
    #[error("time jumps by {} from the line above", duration(*.gap))]
    TimeJump {
        /// The jump, s.
        gap: f64,
        /// Line of the last row before it.
        before: u64,
    },
    /// A header and at most one row.
    #[error("the log has {rows} row{}; motion needs at least two", if *.rows == 1 { "" } else { "s" })]
    TooShort {
        /// Rows after the header.
        rows: u64,
    },
    /// Sampled more slowly than the dynamics.
    #[error("the log is sampled at {rate:.0} Hz; identification needs at least {least} Hz")]
    TooSlow {
        /// One over the median sampling period, Hz.
        rate: f64,
        /// The least rate accepted, Hz.
        least: f64,
    },
    /// Positions beyond the joint's limits nearly everywhere.
    #[error(
        "{joint} is outside its limits ({lower:.3} to {upper:.3} {unit}) in {percent:.0} % of the samples, \
         {value} on this line{}",
        if *.degrees { "; the values look like degrees" } else { "" }
    )]
    OutsideLimits {
        /// The joint.
        joint: String,
        /// Lower limit, rad or m.
        lower: f64,
        /// Upper limit, rad or m.
        upper: f64,
        /// `rad`, or `m` of a prismatic joint.
        unit: &'static str,
        /// Share of samples outside, %.
        percent: f64,
        /// The first such value, as recorded.
        value: f64,
        /// The values fall within the limits when read as degrees.
        degrees: bool,
    },
}

/// `4 h`, `12 min`, `8.5 s`: a span of time for a human.
fn duration(seconds: f64) -> String {
    match seconds {
        s if s >= 48.0 * 3600.0 => format!("{:.1} days", s / 86400.0),
        s if s >= 3600.0 => format!("{:.1} h", s / 3600.0),
        s if s >= 60.0 => format!("{:.1} min", s / 60.0),
        s => format!("{s:.1} s"),
    }
}
