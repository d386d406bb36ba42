//! Temperatures at the end of their scale, which are none.

use proprio_core::bus::Reply;

use super::channel::Channel;
use super::columns::Columns;
use super::error::{Place, Unit};
use super::warning::Warning;

/// The ends of the scale of a motor that says its temperature in a byte, as those of a Go2 do, °C: it is hotter or colder than it can say, or has
/// no sensor. A log keeps what the byte had, whatever its format.
const ENDS: [f64; 2] = [i8::MIN as f64, Reply::TOP_TEMPERATURE as f64];

/// Takes such temperatures out, and counts them.
#[derive(Debug, Clone)]
pub(super) struct Temperatures {
    unit: Unit,
    /// Each recorded joint's slot, and how many there were.
    slots: Vec<(usize, u64)>,
    rows: u64,
    /// The first: its row, its slot and what it was, °C.
    first: Option<(u64, usize, f64)>,
}

impl Temperatures {
    pub(super) fn new(columns: &Columns, unit: Unit) -> Self {
        let slots = columns.joints().map(|j| columns.slots.of(Channel::Temp, j));
        let recorded = slots.filter(|slot| columns.cell[*slot].is_some());
        Self {
            unit,
            slots: recorded.map(|slot| (slot, 0)).collect(),
            rows: 0,
            first: None,
        }
    }

    /// Leaves nothing of such temperatures in a row.
    pub(super) fn leave_out(&mut self, number: u64, values: &mut [f64]) {
        self.rows += 1;
        for (slot, count) in &mut self.slots {
            if ENDS.contains(&values[*slot]) {
                self.first.get_or_insert((number, *slot, values[*slot]));
                values[*slot] = f64::NAN;
                *count += 1;
            }
        }
    }

    /// What a user should know of them.
    pub(super) fn warning(&self, columns: &Columns) -> Option<Warning> {
        let (number, slot, value) = self.first?;
        let unit = self.unit;
        Some(Warning::NoTemperature {
            joints: self.slots.iter().filter(|(_, count)| *count > 0).count(),
            most: self.slots.iter().map(|(_, count)| *count).max()?,
            rows: self.rows,
            first: Place { unit, number },
            column: columns.column_name(columns.cell[slot]?).to_owned(),
            value,
        })
    }
}
