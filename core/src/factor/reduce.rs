//! Row echelon form: which columns are independent, and how the others follow from them.

use super::{Factor, FactorError, row_start};
use crate::Real;
use crate::scalar::{real, sqrt};

impl<T: Real, S: AsRef<[T]> + AsMut<[T]>> Factor<T, S> {
    /// Turns the triangle into reduced row echelon form, columns from the left, and says how many are independent.
    ///
    /// Row r of the first so many has a one in the r-th independent column, zeros before it and in the other independent
    /// ones, and the r-th coefficient of each dependent column. A column whose part beyond the independent ones before it is
    /// at most `tolerance` of its length is dependent. It is a factor no more; the right-hand side is lost.
    pub(crate) fn reduce(&mut self, tolerance: T) -> usize {
        let p = self.columns;
        let mut rank = 0;
        let square = |factor: &Self, c: usize| {
            (0..=c).fold(T::zero(), |sum, k| sum + factor.at(k, c) * factor.at(k, c))
        };
        let largest = (0..p).fold(T::zero(), |most, c| most.max(square(self, c)));
        // What is this faint is zero but for rounding.
        let faint = sqrt(largest) * T::default_epsilon() * real(100.0);
        for c in 0..p {
            let square = square(self, c);
            for k in rank + 1..=c {
                self.rotate_rows(rank, k, c);
            }
            let norm = sqrt(square);
            if self.at(rank, c).abs() > (tolerance * norm).max(faint) {
                rank += 1;
            } else {
                self.set(rank, c, T::zero());
            }
            // The place of the right-hand side keeps the column's length, which the substitution below needs.
            self.set(c, p, norm);
        }
        for r in (0..rank).rev() {
            let pivot = self.pivot_column(r);
            let scale = T::one() / self.at(r, pivot);
            for c in pivot..p {
                self.set(r, c, self.at(r, c) * scale);
            }
            for above in 0..r {
                let multiple = self.at(above, pivot);
                for c in pivot..p {
                    self.set(above, c, self.at(above, c) - multiple * self.at(r, c));
                }
                self.set(above, pivot, T::zero());
            }
        }
        for r in 0..rank {
            self.clean(r, tolerance);
        }
        rank
    }

    /// Copies `row` to row k of the triangle.
    ///
    /// # Errors
    /// [`FactorError::Length`] if it is not as long.
    pub(crate) fn set_row(&mut self, k: usize, row: &[T]) -> Result<(), FactorError> {
        let start = row_start(self.columns, k);
        let target = self.storage.as_mut().get_mut(start..start + row.len());
        match target {
            Some(target) if row.len() + k == self.columns + 1 => {
                target.copy_from_slice(row);
                Ok(())
            }
            _ => Err(FactorError::Length(row.len())),
        }
    }

    /// Writes the numbers of row k of the triangle, from the diagonal to the right-hand side.
    ///
    /// # Errors
    /// [`FactorError::Length`] for a row beyond the triangle.
    pub(crate) fn write_row(
        &mut self,
        k: usize,
        numbers: impl Iterator<Item = T>,
    ) -> Result<(), FactorError> {
        let start = row_start(self.columns, k);
        let end = start + (self.columns + 1).saturating_sub(k);
        let target = self.storage.as_mut().get_mut(start..end);
        let target = target.ok_or(FactorError::Length(k))?;
        target
            .iter_mut()
            .zip(numbers)
            .for_each(|(to, from)| *to = from);
        Ok(())
    }

    /// Rounds coefficients of row r that are zero but for rounding: shares of a column below `tolerance` of its length.
    fn clean(&mut self, r: usize, tolerance: T) {
        let pivot = self.pivot_column(r);
        let length = self.at(pivot, self.columns);
        for c in pivot + 1..self.columns {
            if self.at(r, c).abs() * length <= tolerance * self.at(c, self.columns) {
                self.set(r, c, T::zero());
            }
        }
    }

    /// The first column of row r that is not zero.
    fn pivot_column(&self, r: usize) -> usize {
        let zeros = self.row(r).iter().take_while(|x| **x == T::zero()).count();
        (r + zeros).min(self.columns)
    }

    /// Rotates rows r < k so that row k has a zero in column c ≥ k; entries before c are not looked at.
    fn rotate_rows(&mut self, r: usize, k: usize, c: usize) {
        let (a, b) = (self.at(r, c), self.at(k, c));
        let square = a * a + b * b;
        if square <= T::zero() {
            return;
        }
        let inverse = square.inverse_sqrt();
        let (cos, sin) = (a * inverse, b * inverse);
        for n in c..self.columns {
            let (a, b) = (self.at(r, n), self.at(k, n));
            self.set(r, n, cos * a + sin * b);
            self.set(k, n, cos * b - sin * a);
        }
        self.set(k, c, T::zero());
    }

    fn at(&self, k: usize, c: usize) -> T {
        let entry = c.checked_sub(k).and_then(|n| self.row(k).get(n));
        entry.copied().unwrap_or(T::zero())
    }

    fn set(&mut self, k: usize, c: usize, value: T) {
        if let Some(n) = c.checked_sub(k)
            && c <= self.columns
            && let Some(entry) = self
                .storage
                .as_mut()
                .get_mut(row_start(self.columns, k) + n)
        {
            *entry = value;
        }
    }
}
