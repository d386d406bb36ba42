//! Tables for humans.

use std::fmt;

/// A table whose first column is text, set left, and whose others are numbers, set right.
#[derive(Debug, Clone, Default)]
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Adds a row; missing cells at its end stay blank.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(column));
            cells.map(|cell| cell.chars().count()).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..columns).map(width).collect();
        for row in &self.rows {
            let mut line = String::new();
            for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
                match column {
                    0 => line += &format!("{cell:<width$}"),
                    _ => line += &format!("  {cell:>width$}"),
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// A value and its standard deviation, such as `0.146 ±0.003`: as many decimals as the deviation deserves.
pub fn with_std(value: f64, std: f64) -> String {
    let decimals = if std > 0.0 {
        (1.0 - std.log10().floor()).clamp(0.0, 6.0) as usize
    } else {
        4
    };
    format!("{value:.decimals$} ±{std:.decimals$}")
}

/// A value of a range.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RangeValue {
    /// The value.
    pub(crate) value: f64,
    /// Its standard deviation, where that is known.
    pub(crate) std: Option<f64>,
    /// Whether it is held at its bound.
    pub(crate) at_bound: bool,
}

/// Decimals of values whose standard deviation is not known.
const DECIMALS: usize = 4;

/// Most decimals of a value in a range.
pub(crate) const MOST_DECIMALS: usize = 5;

/// `0.08–0.21`, of a single value `0.142`, to the second digit of the smallest standard deviation and in at most so many decimals; with a `*` at its bound.
/// None of no value.
pub(crate) fn range(values: &[RangeValue], most: usize) -> Option<String> {
    let stds = values.iter().filter_map(|of| of.std);
    let decimals = stds
        .filter(|std| *std > 0.0)
        .map(|std| (1.0 - std.log10().floor()).max(0.0) as usize);
    let decimals = decimals.max().unwrap_or(DECIMALS).min(most);
    let one = |of: &RangeValue| match (of.at_bound, of.value == 0.0) {
        (true, true) => "0*".to_owned(),
        (true, false) => format!("{:.decimals$}*", of.value),
        (false, _) => format!("{:.decimals$}", of.value),
    };
    let by_value = |a: &&RangeValue, b: &&RangeValue| a.value.total_cmp(&b.value);
    let low = one(values.iter().min_by(by_value)?);
    let high = one(values.iter().max_by(by_value)?);
    Some(match low == high {
        true => low,
        // A dash before a minus is hard to read.
        false if high.starts_with('-') => format!("{low} to {high}"),
        false => format!("{low}–{high}"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_set_right_and_text_left() {
        let mut table = Table::default();
        table.row(["joint".to_owned(), "rms".to_owned()]);
        table.row(["FR_hip".to_owned(), "0.1".to_owned()]);
        table.row(["all".to_owned(), "12.25".to_owned()]);
        assert_eq!(
            table.to_string(),
            "joint     rms\nFR_hip    0.1\nall     12.25\n"
        );
    }

    #[test]
    fn two_digits_of_the_deviation_are_told() {
        assert_eq!(with_std(0.14609, 0.00313), "0.1461 ±0.0031");
        assert_eq!(with_std(-1.5, 0.25), "-1.50 ±0.25");
        assert_eq!(with_std(12.0, 30.0), "12 ±30");
        assert_eq!(with_std(1.0, 0.0), "1.0000 ±0.0000");
    }

    #[test]
    fn a_range_has_the_digits_of_its_smallest_deviation() {
        let of = |value: f64, std: Option<f64>, at_bound: bool| RangeValue {
            value,
            std,
            at_bound,
        };
        let [known, sure] = [of(0.2109, Some(0.02), false), of(0.0431, Some(0.3), false)];
        let all = |values: &[RangeValue]| range(values, MOST_DECIMALS);
        assert_eq!(all(&[known, sure]).as_deref(), Some("0.043–0.211"));
        let few = range(&[known, sure], 2);
        assert_eq!(few.as_deref(), Some("0.04–0.21"));
        assert_eq!(all(&[known]).as_deref(), Some("0.211"));
        assert_eq!(
            all(&[of(0.0, Some(0.02), true), known]).as_deref(),
            Some("0*–0.211")
        );
        let unknown = [-0.25, -0.125].map(|value| of(value, None, false));
        assert_eq!(all(&unknown).as_deref(), Some("-0.2500 to -0.1250"));
        assert_eq!(all(&[]), None);
    }
}
