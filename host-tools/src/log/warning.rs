//! What a user should know about a log that can still be used.

use std::fmt;

use super::admission::{Cause, words};
use super::error::Place;
use crate::model::significant;

/// What a user should know about a log that can still be used.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// No samples for a while; windows do not bridge it.
    Gaps {
        /// How many gaps.
        count: u64,
        /// What is longer is one, s.
        limit: f64,
        /// The longest, s.
        longest: f64,
        /// The row before the longest.
        after: Place,
    },
    /// Rows with the time stamp of the row above.
    RepeatedStamps {
        /// How many.
        count: u64,
        /// Of how many rows.
        rows: u64,
    },
    /// The file was cut short; what is whole was read.
    Cut {
        /// The last message that is whole.
        last: u64,
    },
    /// Rows that no robot can have produced.
    LeftOut {
        /// Why.
        cause: Cause,
        /// How many.
        count: u64,
        /// How many more because they follow them closely.
        also: u64,
        /// Of how many rows.
        rows: u64,
        /// The first.
        first: Place,
        /// What shows it there: a column.
        column: String,
        /// What it holds there.
        value: f64,
    },
    /// A bag has more than one topic of joint states.
    OtherTopics {
        /// The one that was read.
        read: String,
        /// The others.
        left: Vec<String>,
    },
    /// Messages of the topic that do not tell of all joints.
    Skipped {
        /// How many.
        count: u64,
        /// Of how many.
        of: u64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gaps {
                count,
                limit,
                longest,
                after,
            } => write!(
                f,
                "{count} gap{} over {} ms, the longest {} ms after {after}; no window bridges a gap",
                if *count == 1 { "" } else { "s" },
                significant(limit * 1e3, 2),
                significant(longest * 1e3, 4),
            ),
            Self::RepeatedStamps { count, rows } => {
                write!(
                    f,
                    "{count} of {rows} rows repeat the time stamp of the row above and are skipped"
                )
            }
            Self::LeftOut {
                cause,
                count,
                also,
                rows,
                first,
                column,
                value,
            } => f.write_str(&words(
                *cause,
                [*count, *also, *rows],
                *first,
                column,
                *value,
            )),
            Self::Cut { last } => write!(
                f,
                "the file was cut short: its {last} whole messages are read"
            ),
            Self::OtherTopics { read, left } => write!(
                f,
                "topic {read} is read; {} too would tell of joints",
                left.join(", ")
            ),
            Self::Skipped { count, of } => write!(
                f,
                "{count} of {of} messages tell of other joints and are left out"
            ),
        }
    }
}
