//! Arrays held in memory: formats that store a column in one piece.

use super::{Empty, Fault, Source, Wanted};
use crate::log::error::{Problem, Unit};

/// Columns of one length.
pub(super) struct Table {
    pub(super) names: Vec<String>,
    pub(super) columns: Vec<Vec<f64>>,
    /// Rows given so far.
    pub(super) row: usize,
}

impl Source for Table {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn unit(&self) -> Unit {
        Unit::Row
    }

    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault> {
        loop {
            let row = self.row;
            if row >= self.columns.first().map_or(0, Vec::len) {
                return Ok(None);
            }
            self.row += 1;
            if take(wanted, values, self.row as u64, |cell| {
                self.columns[cell][row]
            })? {
                return Ok(Some(self.row as u64));
            }
        }
    }

    fn progress(&self) -> (u64, u64) {
        (
            self.row as u64,
            self.columns.first().map_or(0, Vec::len) as u64,
        )
    }
}

/// Puts a row's wanted numbers where they belong; false if the row is to be skipped.
pub(super) fn take(
    wanted: &[Wanted],
    values: &mut [f64],
    row: u64,
    number: impl Fn(usize) -> f64,
) -> Result<bool, Fault> {
    for w in wanted {
        let value = number(w.cell);
        values[w.slot] = match w.empty {
            _ if value.is_finite() => value * w.scale,
            Empty::Refuse => return Err(Fault::at(row, w.cell, Problem::NotFinite(value))),
            Empty::Skip => return Ok(false),
            Empty::Nan => f64::NAN,
        };
    }
    Ok(true)
}
