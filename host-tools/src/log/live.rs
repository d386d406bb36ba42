//! What comes while it is read: messages, text, bytes of motor buses; as rows, before any is judged.

use std::io::Read;
use std::path::{Path, PathBuf};

use super::columns::{Columns, Selection};
use super::error::LogError;
use super::row::Row;
#[cfg(feature = "mcap")]
use super::source::bag;
use super::source::{self, Source};
use super::warning::Warning;
use crate::model::Robot;

/// Where rows come from that are still being made.
pub enum LiveInput {
    /// Text with a header, as a log's: whoever gives it waits for it, and ends it with a whole line.
    Text(Box<dyn Read>),
    /// Captures of a leg's bus each ([`crate::capture`]), all on one clock.
    Buses(Vec<Box<dyn Read>>),
    /// Messages of one topic.
    #[cfg(feature = "mcap")]
    Messages {
        /// The topic's name.
        topic: String,
        /// Their type, one of [`MESSAGE_KINDS`].
        kind: &'static str,
        /// The messages.
        messages: Box<dyn LiveMessages>,
    },
}

/// A message as it came.
#[cfg(feature = "mcap")]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LiveMessage {
    /// When it came, ns since 1970.
    pub received_ns: i64,
    /// When its sender sent it, ns of the sender's clock; none if it does not say.
    pub sent_ns: Option<i64>,
    /// Encapsulation header and CDR.
    pub data: Vec<u8>,
}

/// Messages of one topic as they come.
#[cfg(feature = "mcap")]
pub trait LiveMessages {
    /// Waits for the next message; none once there will be no other.
    fn next(&mut self) -> Option<LiveMessage>;
}

/// Types of messages that are read, as ROS 2 calls them.
#[cfg(feature = "mcap")]
pub const MESSAGE_KINDS: [&str; 3] = bag::KINDS;

/// Whether bytes can be a message of this type of [`MESSAGE_KINDS`]: little-endian CDR, of its length or with whole arrays.
#[cfg(feature = "mcap")]
pub fn can_be(kind: &str, data: &[u8]) -> bool {
    bag::can_be(kind, data)
}

/// All that comes as rows of a robot's log. Nothing is left out and nothing judged: that is done when the log is read.
pub struct LiveRows {
    name: PathBuf,
    source: Box<dyn Source>,
    columns: Columns,
    row: Row,
}

impl LiveRows {
    /// Follows `input`, called `name` in messages: waits for its first rows and finds the channels of `robot` there.
    ///
    /// # Errors
    /// As [`super::LogReader::open_of`]'s.
    pub fn follow(name: &Path, input: LiveInput, robot: &Robot) -> Result<Self, LogError> {
        let source = source::open_live(name, input)?;
        let names = source.names().to_vec();
        let place = source.header();
        let columns = Columns::new(name, place, names, Selection::Everything, robot)?;
        Ok(Self {
            name: name.to_owned(),
            row: Row::new(columns.slots),
            columns,
            source,
        })
    }

    /// What is recorded.
    pub fn columns(&self) -> &Columns {
        &self.columns
    }

    /// Waits for the next row; none once there will be no other. Of its time only [`Row::t`] is set.
    ///
    /// # Errors
    /// [`super::Problem`] of a row that cannot be read.
    pub fn next_row(&mut self) -> Result<Option<&Row>, LogError> {
        let next = self.source.next(&self.columns.wanted, &mut self.row.values);
        let unit = self.source.unit();
        let next = next.map_err(|fault| fault.error(&self.name, unit, &self.columns.names))?;
        let Some(number) = next else {
            return Ok(None);
        };
        self.row.line = number;
        if let Some(motors) = &self.columns.motors {
            motors.apply(&mut self.row.values);
        }
        Ok(Some(&self.row))
    }

    /// What a user should know of all that came.
    pub fn warnings(&self) -> Vec<Warning> {
        self.source.warnings()
    }
}
