//! What changes a factor: rows, priors and other factors folded in by Givens rotations, nested models.

use super::{Factor, FactorError, row_start};
use crate::Real;

impl<T: Real, S: AsRef<[T]> + AsMut<[T]>> Factor<T, S> {
    /// Forgets everything.
    pub fn clear(&mut self) {
        self.rows = T::zero();
        self.storage.as_mut().fill(T::zero());
    }

    /// Folds in one row: its p entries of W, then its entry of b. The row is used up.
    ///
    /// # Errors
    /// [`FactorError::Length`], or [`FactorError::NotFinite`] with the factor unchanged.
    pub fn update(&mut self, row: &mut [T]) -> Result<(), FactorError> {
        self.check(row, self.columns + 1)?;
        self.rotate_in(0, row);
        self.rows += T::one();
        Ok(())
    }

    /// Writes `floor` on the diagonal of an empty triangle: each parameter is zero ± 1/`floor`.
    pub(crate) fn set_floor(&mut self, floor: T) {
        for k in 0..self.columns {
            if let Some(pivot) = self.storage.as_mut().get_mut(row_start(self.columns, k)) {
                *pivot = floor;
            }
        }
    }

    /// Adds the knowledge that parameter `column` is `mean` ± `std` (> 0), as one more row.
    ///
    /// `scratch` holds p + 1 numbers. The row does not count in [`rows`](Self::rows).
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn add_prior(
        &mut self,
        column: usize,
        mean: T,
        std: T,
        scratch: &mut [T],
    ) -> Result<(), FactorError> {
        if column >= self.columns || scratch.len() != self.columns + 1 {
            return Err(FactorError::Length(scratch.len()));
        }
        scratch.fill(T::zero());
        scratch[column] = T::one() / std;
        scratch[self.columns] = mean / std;
        self.check(scratch, self.columns + 1)?;
        self.rotate_in(column, scratch.get_mut(column..).unwrap_or(&mut []));
        Ok(())
    }

    /// Writes `block` as the diagonal block that starts at column `first`; only right where nothing was folded in yet.
    ///
    /// # Errors
    /// [`FactorError::Length`] if the block does not fit.
    pub fn place<B: AsRef<[T]>>(
        &mut self,
        first: usize,
        block: &Factor<T, B>,
    ) -> Result<(), FactorError> {
        if first + block.columns > self.columns {
            return Err(FactorError::Length(block.columns));
        }
        for k in 0..block.columns {
            let start = row_start(self.columns, first + k);
            let end = start + self.columns + 1 - first - k;
            let target = self.storage.as_mut().get_mut(start..end).unwrap_or(&mut []);
            if let (Some((z, r)), Some((z_to, r_to))) =
                (block.row(k).split_last(), target.split_last_mut())
            {
                r_to.iter_mut().zip(r).for_each(|(to, from)| *to = *from);
                *z_to = *z;
            }
        }
        Ok(())
    }

    /// Folds in all rows of `other`, each times `weight`; column j of `other` is column `place(j)` here.
    ///
    /// `place` is strictly increasing. Entries of this factor outside the places in the rows of the places must be zero,
    /// or the rows of `other` would have to reach them: true when both have the same columns, and when `other` covers a
    /// column here together with all that column is linked to. `scratch` holds p + 1 numbers of `other`, or more.
    ///
    /// Merging two data sets is this with `|c| c` and weight 1, in any order.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn merge<O: AsRef<[T]>>(
        &mut self,
        other: &Factor<T, O>,
        place: impl Fn(usize) -> usize,
        weight: T,
        scratch: &mut [T],
    ) -> Result<(), FactorError> {
        let rows = self.rows + other.rows;
        for k in 0..=other.columns {
            self.merge_row(other, k, &place, weight, scratch)?;
        }
        self.rows = rows;
        Ok(())
    }

    /// Row k of [`merge`](Self::merge); [`rows`](Self::rows) is not changed.
    fn merge_row<O: AsRef<[T]>>(
        &mut self,
        other: &Factor<T, O>,
        k: usize,
        place: impl Fn(usize) -> usize,
        weight: T,
        scratch: &mut [T],
    ) -> Result<(), FactorError> {
        let from = other.row(k);
        let row = scratch
            .get_mut(..from.len())
            .ok_or(FactorError::Length(from.len()))?;
        row.iter_mut()
            .zip(from)
            .for_each(|(to, from)| *to = *from * weight);
        self.check(row, from.len())?;
        let rhs = self.columns;
        let place = |j| if j < other.columns { place(j) } else { rhs };
        for i in k..=other.columns {
            let pivot = place(i);
            let start = row_start(self.columns, pivot);
            let end = start + (rhs + 1).saturating_sub(pivot);
            let Some(target) = self.storage.as_mut().get_mut(start..end) else {
                return Err(FactorError::Length(pivot));
            };
            let (Some(r), Some(x)) = (target.first(), row.get(i - k)) else {
                return Err(FactorError::Length(pivot));
            };
            let rotation = Rotation::new(*r, *x);
            let row = row.get_mut(i - k..).unwrap_or(&mut []);
            if row.len() == target.len() {
                // From here on the columns lie side by side.
                target
                    .iter_mut()
                    .zip(row)
                    .for_each(|(r, x)| rotation.apply(r, x));
                continue;
            }
            for (j, x) in row.iter_mut().enumerate() {
                if let Some(r) = target.get_mut(place(i + j).wrapping_sub(pivot)) {
                    rotation.apply(r, x);
                }
            }
        }
        Ok(())
    }

    /// Becomes the factor of the model with only `columns` of `other`, in that order: as if refitted without the rest.
    ///
    /// `scratch` holds p + 1 numbers of this factor, whose p is `columns.len()`.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn select_from<O: AsRef<[T]>>(
        &mut self,
        other: &Factor<T, O>,
        columns: &[usize],
        scratch: &mut [T],
    ) -> Result<(), FactorError> {
        if columns.len() != self.columns || columns.iter().any(|c| *c >= other.columns) {
            return Err(FactorError::Length(columns.len()));
        }
        self.clear();
        for k in 0..=other.columns {
            let from = other.row(k);
            self.check(scratch, self.columns + 1)?;
            let whole = columns.iter().chain(core::iter::once(&other.columns));
            for (to, c) in scratch.iter_mut().zip(whole) {
                let entry = c.checked_sub(k).and_then(|n| from.get(n));
                *to = entry.copied().unwrap_or(T::zero());
            }
            self.rotate_in(0, scratch);
        }
        self.rows = other.rows;
        Ok(())
    }

    fn check(&self, row: &[T], len: usize) -> Result<(), FactorError> {
        if row.len() != len {
            return Err(FactorError::Length(row.len()));
        }
        // x·0 is NaN exactly for the numbers that must not enter; a sum has no branch per number.
        let probe = row.iter().fold(T::zero(), |sum, x| sum + *x * T::zero());
        if probe == T::zero() {
            Ok(())
        } else {
            Err(FactorError::NotFinite)
        }
    }

    /// Rotates a row whose first entry belongs to column `first` into the triangle.
    fn rotate_in(&mut self, first: usize, row: &mut [T]) {
        let start = row_start(self.columns, first);
        let mut triangle = self.storage.as_mut().get_mut(start..).unwrap_or(&mut []);
        let mut row = row;
        while !row.is_empty() && triangle.len() >= row.len() {
            let (target, below) = triangle.split_at_mut(row.len());
            let rotation = Rotation::new(target[0], row[0]);
            for (r, x) in target.iter_mut().zip(row.iter_mut()) {
                rotation.apply(r, x);
            }
            triangle = below;
            row = &mut row[1..];
        }
    }
}

/// A Givens rotation that turns (r, x) into (√(r² + x²), 0).
struct Rotation<T> {
    cos: T,
    sin: T,
}

impl<T: Real> Rotation<T> {
    fn new(r: T, x: T) -> Self {
        let square = r * r + x * x;
        // Selections rather than branches: the cost must not tell the data. No length, no rotation.
        let is_zero = if square > T::zero() {
            T::zero()
        } else {
            T::one()
        };
        let inverse = square.inverse_sqrt();
        Self {
            cos: r * inverse + is_zero,
            sin: x * inverse,
        }
    }

    fn apply(&self, r: &mut T, x: &mut T) {
        let (a, b) = (*r, *x);
        *r = self.cos * a + self.sin * b;
        *x = self.cos * b - self.sin * a;
    }
}
