//! What a user should know about a log that can still be used.

use std::fmt;

use proprio_core::go2::Leg;

use super::error::Place;
use crate::model::significant;

/// Positions that jump and come back in so many rows are no damaged messages: another program publishes its own states.
pub(super) const PUBLISHER: u64 = 3;

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
    /// Rows that a recorder stamped later than they were measured; they have the times at which they were, by the rows after them.
    LateStamps {
        /// How many.
        count: u64,
        /// Of how many rows.
        rows: u64,
        /// How late at most, s.
        latest: f64,
        /// The first.
        first: Place,
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
    /// Temperatures at the end of a motor's scale: they are taken for none.
    NoTemperature {
        /// How many joints have such.
        joints: usize,
        /// How many the joint with most of them.
        most: u64,
        /// Of how many rows.
        rows: u64,
        /// The first.
        first: Place,
        /// Its column.
        column: String,
        /// What it is, °C.
        value: f64,
    },
    /// A bag has more than one topic of joint states.
    OtherTopics {
        /// The one that was read.
        read: String,
        /// The others.
        left: Vec<String>,
    },
    /// Polling cycles after a motor was silent or jumped: where its zero is since, nothing says.
    Unplaced {
        /// The leg.
        leg: Leg,
        /// How many.
        count: u64,
        /// Of how many.
        of: u64,
    },
    /// Polling cycles of the first of several buses about which another has none.
    Alone {
        /// How many.
        count: u64,
        /// Of how many.
        of: u64,
    },
    /// Messages of the topic that do not tell of all joints.
    Skipped {
        /// How many.
        count: u64,
        /// Of how many.
        of: u64,
    },
}

/// Why a row is left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// Its stamp is not between those of the rows about it.
    Stamp,
    /// A value that no robot reaches for a moment.
    Impossible,
    /// Zeros before the first state of a joint.
    ZerosFirst,
    /// Its positions are elsewhere, and those of the rows after it are not.
    Jump,
    /// Its positions are elsewhere for good: another recording begins.
    Seam,
    /// It follows a seam closely.
    AfterSeam,
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
            Self::LateStamps {
                count,
                rows,
                latest,
                first,
            } => write!(
                f,
                "{count} of {rows} time stamps are late, by up to {} ms (the first at {first}): the recorder fell behind; rows \
                 have the times at which they were measured, by their even pace and the motion",
                significant(latest * 1e3, 2)
            ),
            Self::LeftOut {
                cause,
                count,
                also,
                rows,
                first,
                column,
                value,
            } => f.write_str(&left_out(
                *cause,
                [*count, *also, *rows],
                *first,
                column,
                *value,
            )),
            Self::NoTemperature {
                joints,
                most,
                rows,
                first,
                column,
                value,
            } => write!(
                f,
                "{column} is {value} °C at {first}, the end of its scale: the motor is too hot, or has no sensor. The temperatures of {joints} joint{} \
                 are unknown in up to {most} of {rows} rows",
                if *joints == 1 { "" } else { "s" }
            ),
            Self::Cut { last } => write!(
                f,
                "the file was cut short: its {last} whole messages are read"
            ),
            Self::OtherTopics { read, left } => write!(
                f,
                "topic {read} is read; {} too would tell of joints",
                left.join(", ")
            ),
            Self::Unplaced { leg, count, of } => write!(
                f,
                "the last {count} of {of} polling cycles of {} are left out: a motor was silent for 0.1 s or its position jumped, and its zero is unknown since",
                leg.name()
            ),
            Self::Alone { count, of } => write!(
                f,
                "{count} of {of} polling cycles of the first bus are left out: another bus has none about them"
            ),
            Self::Skipped { count, of } => write!(
                f,
                "{count} of {of} messages tell of other joints and are left out"
            ),
        }
    }
}

/// What was left out, in words.
fn left_out(
    cause: Cause,
    [count, also, rows]: [u64; 3],
    first: Place,
    column: &str,
    value: f64,
) -> String {
    let value = match value.abs() {
        1e-3..1e6 => significant(value, 4).to_string(),
        0.0 => "0".to_owned(),
        _ => format!("{value:.2e}"),
    };
    let samples = match count {
        1 => format!("1 of {rows} samples is left out"),
        count => format!("{count} of {rows} samples are left out"),
    };
    match cause {
        Cause::Stamp => format!(
            "{samples}: the time stamp is not between those before and after it (the first at {first}: {value} s)"
        ),
        Cause::Impossible => format!(
            "{samples}: {column} is {value} at {first}, far from the samples about it: a damaged message"
        ),
        Cause::ZerosFirst => format!(
            "{}: zeros before the first state ({first} on, {column})",
            match count + also {
                1 => format!("1 of {rows} samples is left out"),
                count => format!("{count} of {rows} samples are left out"),
            }
        ),
        Cause::Jump if count >= PUBLISHER => format!(
            "{samples}: positions jump and come back (the first at {first}: {column} {value}): two publishers on one topic; \
             stop one, or record the other's topic alone"
        ),
        Cause::Jump => format!(
            "{samples}: positions jump and come back (the first at {first}: {column} {value})"
        ),
        Cause::Seam | Cause::AfterSeam => format!(
            "positions jump and stay at {count} place{} ({first}: {column} {value}): logs joined? No window bridges a seam, and \
             {also} of {rows} samples after it are left out",
            if count == 1 { "" } else { "s" }
        ),
    }
}
