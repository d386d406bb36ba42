//! What was left out, and why.

use super::super::columns::Columns;
use super::super::error::{Place, Problem, Unit};
use super::super::slots::TIME;
use super::super::warning::Warning;
use super::Raw;
use crate::model::significant;

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

const CAUSES: [Cause; 6] = [
    Cause::Stamp,
    Cause::Impossible,
    Cause::ZerosFirst,
    Cause::Jump,
    Cause::Seam,
    Cause::AfterSeam,
];

/// Positions that jump and come back in so many rows are no damaged messages: another program publishes its own states.
const PUBLISHER: u64 = 3;
/// Where the foreign rows are more than this share, one of so many, nothing tells which of two publishers is the robot.
const TOO_MANY: u64 = 3;

/// Rows left out for one cause.
#[derive(Debug, Clone, Copy)]
struct Rows {
    count: u64,
    line: u64,
    slot: usize,
    value: f64,
}

/// Counts of rows left out.
#[derive(Debug)]
pub(super) struct LeftOut {
    unit: Unit,
    /// All rows.
    pub(super) rows: u64,
    of: [Option<Rows>; CAUSES.len()],
}

impl LeftOut {
    pub(super) fn new(unit: Unit) -> Self {
        Self {
            unit,
            rows: 0,
            of: [None; CAUSES.len()],
        }
    }

    pub(super) fn add(&mut self, cause: Cause, row: &Raw, slot: usize) {
        let own = self.of[cause as usize].get_or_insert(Rows {
            count: 0,
            line: row.line,
            slot,
            value: row.values[slot],
        });
        own.count += 1;
    }

    fn count(&self, cause: Cause) -> u64 {
        self.of[cause as usize].map_or(0, |rows| rows.count)
    }

    fn place(&self, number: u64) -> Place {
        Place {
            unit: self.unit,
            number,
        }
    }

    pub(super) fn problem(&self, columns: &Columns) -> Option<(Place, Problem)> {
        let rows = self.of[Cause::Jump as usize]?;
        (TOO_MANY * rows.count > self.rows && rows.count >= PUBLISHER).then(|| {
            let problem = Problem::TwoPublishers {
                count: rows.count,
                rows: self.rows,
                column: column(columns, rows.slot),
            };
            (self.place(rows.line), problem)
        })
    }

    pub(super) fn warnings(&self, columns: &Columns) -> Vec<Warning> {
        let warning = |cause: Cause| {
            let rows = self.of[cause as usize]?;
            Some(Warning::LeftOut {
                cause,
                count: rows.count,
                // What follows a seam is told with it.
                also: match cause {
                    Cause::Seam | Cause::ZerosFirst => self.count(Cause::AfterSeam),
                    _ => 0,
                },
                rows: self.rows,
                first: self.place(rows.line),
                column: column(columns, rows.slot),
                value: rows.value,
            })
        };
        let told = CAUSES
            .into_iter()
            .filter(|cause| *cause != Cause::AfterSeam);
        told.filter_map(warning).collect()
    }
}

/// What the file calls what lies at a slot, or else what proprio does.
fn column(columns: &Columns, slot: usize) -> String {
    let cell = columns.cell[slot];
    let name = cell.map(|cell| columns.column_name(cell).to_owned());
    match name {
        Some(name) => name,
        None if slot == TIME => "t".to_owned(),
        None => String::new(),
    }
}

/// What was left out, in words.
pub(in crate::log) fn words(
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
            "{samples}: {column} is {value} at {first}, many times any sample about it: a damaged message"
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
