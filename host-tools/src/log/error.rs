//! What can be wrong with a log, and where.

use std::fmt;
use std::path::{Path, PathBuf};

/// A log that cannot be used: the file, the place in it, and what is wrong there.
#[derive(Debug, thiserror::Error)]
pub struct LogError {
    /// The file as the user named it.
    pub path: PathBuf,
    /// Where in the file; none when all of it is meant.
    pub place: Option<Place>,
    /// The column, where one is to blame.
    pub column: Option<Box<Column>>,
    /// What is wrong.
    #[source]
    pub problem: Box<Problem>,
}

/// A row of a log, in what its file counts in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// What is counted.
    pub unit: Unit,
    /// Which, counted from 1.
    pub number: u64,
}

/// What the rows of a file are counted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Lines of text.
    Line,
    /// Messages of a topic.
    Message,
    /// Rows of a table.
    Row,
    /// Polling cycles of a motor bus.
    Cycle,
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = match self.unit {
            Unit::Line => "line",
            Unit::Message => "message",
            Unit::Row => "row",
            Unit::Cycle => "cycle",
        };
        write!(f, "{unit} {}", self.number)
    }
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
    /// Of a file that cannot be read to its end.
    pub(crate) fn reading(path: &Path, source: std::io::Error) -> Self {
        Self::new(path, Problem::Read(source))
    }

    pub(super) fn new(path: &Path, problem: Problem) -> Self {
        Self {
            path: path.to_owned(),
            place: None,
            column: None,
            problem: Box::new(problem),
        }
    }

    pub(super) fn at(mut self, place: Option<Place>) -> Self {
        self.place = place;
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
        if let Some(place) = self.place {
            write!(f, ", {place}")?;
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
    /// The file has the beginning of a format that is read, and is damaged.
    #[error("the file is damaged: {0}")]
    Damaged(String),
    /// The file is something else.
    #[error("this is {what}, not a log that can be read as it is")]
    NotALog {
        /// What it is.
        what: &'static str,
        /// How its data come in all the same.
        way: &'static str,
    },
    /// A format whose reader was left out of this build.
    #[error("this is {what}, which this build of proprio does not read")]
    NotBuilt {
        /// What it is.
        what: &'static str,
        /// The feature to build with.
        feature: &'static str,
    },
    /// A recording of messages, none of which tells of joints.
    #[error("the bag has no topic of joint states{}", listed(topics))]
    NoTopic {
        /// Its topics with their types.
        topics: Vec<String>,
    },
    /// A topic that is listed but has no message.
    #[error("topic {topic} has no message")]
    NoMessages {
        /// The topic.
        topic: String,
    },
    /// Messages in an encoding that is not read.
    #[error("the message is {0}; messages are read in plain, little-endian CDR")]
    Encoding(&'static str),
    /// A message of fixed length has another one.
    #[error("the message has {found} bytes; a {kind} has {expected}")]
    MessageLength {
        /// The message's type.
        kind: &'static str,
        /// Its length, bytes.
        found: usize,
        /// What it should be.
        expected: usize,
    },
    /// A message ends before what it announces.
    #[error("the message ends early, after {found} bytes: it is no {kind}")]
    MessageShort {
        /// The message's type.
        kind: &'static str,
        /// Its length, bytes.
        found: usize,
    },
    /// Motors are numbered, and nothing says which joints they move.
    #[error("motors are recorded by number, and nothing says which joint of `{robot}` has motor 0")]
    MotorOrder {
        /// The robot.
        robot: String,
    },
    /// A motor's signal, but not what gear it is behind.
    #[error("the motor of {joint} is recorded, but its gear ratio is not known")]
    NoGear {
        /// The joint.
        joint: String,
    },
    /// Of motors that are coupled only some are recorded.
    #[error(
        "the motors of {joint} and {other} are coupled, but only the first is recorded at the motor"
    )]
    CoupledInPart {
        /// A joint recorded at the motor.
        joint: String,
        /// One that is not.
        other: String,
    },
    /// No joints' motion follows from that of their motors.
    #[error("the transmission of the motors recorded cannot be inverted")]
    Transmission,
    /// An array with a column per joint, and no names for them.
    #[error(
        "the array has {columns} columns, and {} names them",
        match named {
            Some(n) => format!("a list of {n} joints"),
            None => "nothing".to_owned(),
        }
    )]
    NoJointNames {
        /// Columns of the array.
        columns: usize,
        /// Length of a list of names that does not fit.
        named: Option<usize>,
    },
    /// Arrays of different lengths.
    #[error("the array has {found} rows, `{other}` has {rows}")]
    OtherLength {
        /// Its rows.
        found: usize,
        /// Rows of the other.
        rows: usize,
        /// The other.
        other: String,
    },
    /// Files of one folder that do not belong together.
    #[error("part {part} of {parts} records other things than the first")]
    OtherCells {
        /// Which, counted from 1.
        part: usize,
        /// How many there are.
        parts: usize,
    },
    /// Nothing in the file.
    #[error("the log is empty")]
    Empty,
    /// The first line is numbers.
    #[error("the log has no header: its first line is numbers")]
    NoHeader,
    /// The first line is a message's values without their names.
    #[error("`ros2 topic echo --csv` prints values without their names")]
    EchoedCsv,
    /// The first line has one column, with other separators in it.
    #[error("the header is separated by `{0}`, not by commas")]
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
    #[error("no joint is recorded: there is no column `q/…`, `dq/…` or `tau/…`")]
    NoJoints {
        /// The robot's joints.
        joints: Vec<String>,
    },
    /// A joint has one of position, velocity and torque but not all.
    #[error(
        "{joint} is recorded without its {}: there is no `{missing}`",
        quantity(missing)
    )]
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
    /// A column that every message should fill has no number at all.
    #[error("the column holds no number in any of {rows} rows")]
    NoNumbers {
        /// How many rows.
        rows: u64,
    },
    /// A number that is not finite.
    #[error("the value is {0}; every value must be finite")]
    NotFinite(f64),
    /// A time stamp before that of the row above.
    #[error("time runs backwards: {now} s comes after {before} s")]
    TimeBackwards {
        /// Time stamp of the row above, s.
        before: f64,
        /// Time stamp of this row, s.
        now: f64,
    },
    /// A jump in time that is no lost message: two recordings in one file, or a clock that was set.
    #[error("time jumps by {}", duration(*.gap))]
    TimeJump {
        /// The jump, s.
        gap: f64,
        /// The last row before it.
        before: Place,
    },
    /// Stamps that give a robot's rate in another unit than the second.
    #[error("`t` is not in seconds: its unit looks like {unit}, in which the rate is {rate:.0} Hz")]
    TimeUnit {
        /// `ms`, `µs` or `ns`.
        unit: &'static str,
        /// How many of it are a second.
        per_second: f64,
        /// The sampling rate in that unit, Hz.
        rate: f64,
    },
    /// Too few rows to say anything.
    #[error("too short: {rows} sample{}; at least {least} s are needed", if *.rows == 1 { "" } else { "s" })]
    TooShort {
        /// Rows after the header.
        rows: u64,
        /// What is needed, s.
        least: f64,
    },
    /// All rows have one time stamp.
    #[error("all {rows} samples have the same time stamp, {stamp} s")]
    OneStamp {
        /// Rows.
        rows: u64,
        /// Their time, s.
        stamp: f64,
    },
    /// Rows of two publishers by turns, of which neither is known to be the robot's.
    #[error(
        "positions jump and come back in {count} of {rows} samples (column {column}): two publishers on one topic"
    )]
    TwoPublishers {
        /// Rows that jump.
        count: u64,
        /// Of how many.
        rows: u64,
        /// The column that shows it.
        column: String,
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
         {value} here{}",
        match (*.degrees, *.other_way) {
            (true, _) => "; the values look like degrees",
            (false, true) => "; counted the other way they are within",
            (false, false) => "",
        }
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
        /// The values fall within the limits with the other sign.
        other_way: bool,
    },
}

/// `: it has /tf (tf2_msgs/msg/TFMessage), …`.
fn listed(topics: &[String]) -> String {
    const MOST: usize = 6;
    let some = topics
        .iter()
        .take(MOST)
        .map(String::as_str)
        .collect::<Vec<_>>()
        .join(", ");
    match topics.len() {
        0 => "; it has none at all".to_owned(),
        n if n > MOST => format!("; it has {some} and {} more", n - MOST),
        _ => format!("; it has {some}"),
    }
}

/// What a column such as `tau/elbow` holds, in words.
fn quantity(column: &str) -> &'static str {
    match column.split('/').next() {
        Some("q") => "position",
        Some("dq") => "velocity",
        _ => "torque",
    }
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
