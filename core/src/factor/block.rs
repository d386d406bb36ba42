//! Several rows at a time: one reflection per column in place of a rotation for each row and column.
//!
//! A Householder reflection takes a column of the triangle's row and of all new rows to (−μ, 0, …, 0) (Golub & Van Loan
//! §5.1); the triangle's row then changes its sign, so that its diagonal stays positive as with rotations. Each number of the
//! triangle is read and written once for [`ROWS`] rows, and there is one square root for all of them: 0.4 of what as many
//! rotations cost.

use super::{Factor, FactorError, row_start};
use crate::Real;

/// Rows of a block: as many as a Cortex-M7's 16 registers of double precision hold beside the reflection that they go through.
pub const ROWS: usize = 6;

/// A block: for each column what the rows hold, side by side; the right-hand side last.
pub type Block<T> = [[T; ROWS]];

/// What folding in a block of so many columns costs, in numbers that a rotation changes: about ten instructions each.
pub(crate) const fn block_cost(columns: usize) -> usize {
    columns * (columns + 1) + 8 * columns
}

/// Columns of a factor side by side: the first one, and how many.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Run {
    pub(crate) first: usize,
    pub(crate) length: usize,
}

impl<T: Real, S: AsRef<[T]> + AsMut<[T]>> Factor<T, S> {
    /// Folds in the rows of a block that are zero before column `first`, given from there on; [`rows`](Self::rows) is not
    /// changed. The block is used up. Rows of zeros do no harm.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub(crate) fn fold_block(
        &mut self,
        first: usize,
        block: &mut Block<T>,
    ) -> Result<(), FactorError> {
        check(block)?;
        self.reflect_in(first, block)
    }

    /// [`fold_block`](Self::fold_block) of numbers that are known to be finite.
    ///
    /// # Errors
    /// [`FactorError::Length`].
    pub(crate) fn reflect_in(
        &mut self,
        first: usize,
        block: &mut Block<T>,
    ) -> Result<(), FactorError> {
        if first + block.len() != self.columns + 1 {
            return Err(FactorError::Length(block.len()));
        }
        let start = row_start(self.columns, first);
        let mut triangle = self.storage.as_mut().get_mut(start..).unwrap_or(&mut []);
        let mut block = block;
        while let Some((new, rest)) = block.split_first_mut() {
            let row = triangle.split_off_mut(..=rest.len()).unwrap_or_default();
            let Some((pivot, row)) = row.split_first_mut() else {
                return Err(FactorError::Length(rest.len()));
            };
            Reflection::of(pivot, new).apply(row, rest);
            block = rest;
        }
        Ok(())
    }

    /// The first column's part of [`reflect_in`](Self::reflect_in); the others follow another time.
    ///
    /// # Errors
    /// [`FactorError::Length`].
    pub(super) fn reflect_first(
        &mut self,
        first: usize,
        block: &mut Block<T>,
    ) -> Result<(), FactorError> {
        let start = row_start(self.columns, first);
        let row = self.storage.as_mut().get_mut(start..).unwrap_or(&mut []);
        match (row.split_first_mut(), block.split_first_mut()) {
            (Some((pivot, row)), Some((new, rest))) if first + rest.len() == self.columns => {
                Reflection::of(pivot, new).apply(row, rest);
                Ok(())
            }
            _ => Err(FactorError::Length(first)),
        }
    }

    /// [`fold_block`](Self::fold_block) for rows that are zero but for some runs of columns, in their order; the right-hand side
    /// is the last column of the last. The triangle must be zero between them as well, in the rows of their columns.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub(crate) fn fold_runs(
        &mut self,
        runs: &[Run],
        block: &mut Block<T>,
    ) -> Result<(), FactorError> {
        let length = block.len();
        let end = runs.last().map_or(0, |run| run.first + run.length);
        if runs.iter().map(|run| run.length).sum::<usize>() != length || end != self.columns + 1 {
            return Err(FactorError::Length(length));
        }
        check(block)?;
        let mut block = block;
        for (r, run) in runs.iter().enumerate() {
            let later = runs.get(r + 1..).unwrap_or(&[]);
            for n in 0..run.length {
                let column = run.first + n;
                let start = row_start(self.columns, column);
                let row = self.storage.as_mut().get_mut(start..).unwrap_or(&mut []);
                let (Some((pivot, row)), Some((new, rest))) =
                    (row.split_first_mut(), block.split_first_mut())
                else {
                    return Err(FactorError::Length(column));
                };
                let reflection = Reflection::of(pivot, new);
                let mut others = &mut *rest;
                let own = others.len().min(run.length - n - 1);
                reflection.apply(row, others.split_off_mut(..own).unwrap_or_default());
                for run in later {
                    let own = others.len().min(run.length);
                    let own = others.split_off_mut(..own).unwrap_or_default();
                    let far = run.first.saturating_sub(column + 1);
                    reflection.apply(row.get_mut(far..).unwrap_or(&mut []), own);
                }
                block = rest;
            }
        }
        Ok(())
    }
}

/// Whether all numbers are finite.
pub(super) fn check<T: Real>(block: &Block<T>) -> Result<(), FactorError> {
    // x·0 is NaN exactly for the numbers that must not enter.
    let numbers = block.as_flattened().iter();
    let probe = numbers.fold(T::zero(), |sum, x| sum + *x * T::zero());
    if probe == T::zero() {
        Ok(())
    } else {
        Err(FactorError::NotFinite)
    }
}

/// 1 − τ (1, v)(1, v)ᵀ, and a change of sign of the first entry: turns (r, x) into (√(r² + |x|²), 0).
struct Reflection<T> {
    v: [T; ROWS],
    tau: T,
}

impl<T: Real> Reflection<T> {
    /// The reflection for a column's numbers, the triangle's and the rows'; the triangle's becomes what is left of them. The rows' are used
    /// up: nobody looks at the zeros that they become.
    #[inline(always)]
    fn of(pivot: &mut T, x: &[T; ROWS]) -> Self {
        let r = *pivot;
        let square = x.iter().fold(r * r, |sum, x| sum + *x * *x);
        let inverse = square.inverse_sqrt();
        let norm = square * inverse;
        let lead = r + norm;
        // A selection rather than a branch: the cost must not tell the data. No length, no reflection.
        let is_zero = if lead > T::zero() {
            T::zero()
        } else {
            T::one()
        };
        let scale = T::one() / (lead + is_zero);
        *pivot = norm;
        Self {
            v: x.map(|x| x * scale),
            tau: lead * inverse,
        }
    }

    /// Reflects numbers of one row of the triangle and those of the block below them, as many as the block has.
    #[inline]
    fn apply(&self, row: &mut [T], block: &mut Block<T>) {
        for (r, x) in row.iter_mut().zip(block) {
            let products = x.iter().zip(&self.v);
            let sum = products.fold(*r, |sum, (x, v)| sum + *v * *x);
            let share = self.tau * sum;
            *r = share - *r;
            for (x, v) in x.iter_mut().zip(&self.v) {
                *x -= *v * share;
            }
        }
    }
}
