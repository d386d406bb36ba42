//! Any file of rows as numbers by name: what is no log of samples, such as poses.

use std::path::Path;

use super::error::{LogError, Place, Unit};
use super::source::{self, Empty, Wanted};

/// Slots begin after the time's: rows of equal time are rows of their own.
const FIRST_SLOT: usize = 1;

/// Columns of a file, chosen by their names, and all its rows.
#[derive(Debug, Clone)]
pub struct NumberTable {
    /// What rows are counted in.
    pub unit: Unit,
    /// Where each row stands in the file.
    pub numbers: Vec<u64>,
    /// The values of each chosen column; not a number where an optional cell is empty. Side by side they take a third of the time of rows.
    pub columns: Vec<Vec<f64>>,
}

/// What a column is to be read for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// Every row has a number there.
    Always,
    /// A cell may be empty.
    Optional,
}

impl NumberTable {
    /// The place of a row in its file.
    pub fn place(&self, row: usize) -> Option<Place> {
        let number = *self.numbers.get(row)?;
        Some(Place {
            unit: self.unit,
            number,
        })
    }

    /// How many rows there are.
    pub fn count(&self) -> usize {
        self.numbers.len()
    }

    /// The chosen columns' values in a row.
    pub fn row(&self, row: usize) -> Vec<f64> {
        self.columns.iter().map(|column| column[row]).collect()
    }

    /// The same of each row.
    pub fn rows(&self) -> impl Iterator<Item = Vec<f64>> {
        (0..self.count()).map(|row| self.row(row))
    }
}

/// The columns of a file on disk; none of what cannot be read, and none of bags and streams: what was read of these is gone.
pub fn file_columns(path: &Path) -> Vec<String> {
    const BAGS: [&str; 2] = ["mcap", "db3"];
    let extension = path.extension();
    let is_bag = extension.is_some_and(|e| BAGS.iter().any(|bag| e == *bag));
    if is_bag || !path.is_file() {
        return Vec::new();
    }
    let source = source::open(path);
    source.map_or_else(|_| Vec::new(), |source| source.names().to_vec())
}

/// Reads the columns that `choose` picks of the file's names, by their indices.
///
/// # Errors
/// If the file cannot be read, or a cell that is needed holds no number: with its line and column.
pub fn read_numbers<E: From<LogError>>(
    path: &Path,
    choose: impl FnOnce(&[String]) -> Result<Vec<(usize, Need)>, E>,
) -> Result<NumberTable, E> {
    let mut source = source::open(path)?;
    let names = source.names().to_vec();
    let chosen = choose(&names)?;
    let wanted: Vec<Wanted> = chosen
        .iter()
        .enumerate()
        .map(|(n, &(cell, need))| Wanted {
            cell,
            slot: n + FIRST_SLOT,
            scale: 1.0,
            empty: match need {
                Need::Always => Empty::Refuse,
                Need::Optional => Empty::Nan,
            },
        })
        .collect();
    let mut table = NumberTable {
        unit: source.unit(),
        numbers: Vec::new(),
        columns: vec![Vec::new(); chosen.len()],
    };
    let mut values = vec![f64::NAN; chosen.len() + FIRST_SLOT];
    loop {
        match source.next(&wanted, &mut values) {
            Ok(Some(number)) => {
                table.numbers.push(number);
                let row = values[FIRST_SLOT..].iter();
                for (column, value) in table.columns.iter_mut().zip(row) {
                    column.push(*value);
                }
            }
            Ok(None) => return Ok(table),
            Err(fault) => return Err(fault.error(path, source.unit(), &names).into()),
        }
    }
}
