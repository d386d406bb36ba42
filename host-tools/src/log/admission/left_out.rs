//! What was left out, and why.

use super::super::columns::Columns;
use super::super::error::{Place, Problem, Unit};
use super::super::slots::TIME;
use super::super::warning::{Cause, PUBLISHER, Warning};
use super::Raw;

const CAUSES: [Cause; 6] = [
    Cause::Stamp,
    Cause::Impossible,
    Cause::ZerosFirst,
    Cause::Jump,
    Cause::Seam,
    Cause::AfterSeam,
];

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
