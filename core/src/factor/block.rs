//! Several rows at a time: one reflection per column in place of a rotation for each row and column.
//!
//! A Householder reflection takes a column of the triangle's row and of all new rows to (−μ, 0, …, 0) (Golub & Van Loan
//! §5.1); the triangle's row then changes its sign, so that its diagonal stays positive as with rotations. Each number of the
//! triangle is read and written once for [`ROWS`] rows, and there is one square root for all of them: half of what as many
//! rotations cost.

use super::{Factor, FactorError, row_start};
use crate::Real;

/// Rows of a block.
pub(crate) const ROWS: usize = 4;

/// A block: for each column what the rows hold, side by side; the right-hand side last.
pub(crate) type Block<T> = [[T; ROWS]];

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
        let length = block.len();
        self.fold_runs(&[Run { first, length }], block)
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
        // x·0 is NaN exactly for the numbers that must not enter.
        let probe = block
            .as_flattened()
            .iter()
            .fold(T::zero(), |sum, x| sum + *x * T::zero());
        if probe != T::zero() {
            return Err(FactorError::NotFinite);
        }
        let mut block = block;
        for (r, run) in runs.iter().enumerate() {
            let later = runs.get(r + 1..).unwrap_or(&[]);
            for n in 0..run.length {
                let column = run.first + n;
                let start = row_start(self.columns, column);
                let row = self.storage.as_mut().get_mut(start..).unwrap_or(&mut []);
                let (Some(pivot), Some(new)) = (row.first(), block.first()) else {
                    return Err(FactorError::Length(column));
                };
                let reflection = Reflection::new(*pivot, new);
                let (own, mut rest) = block.split_at_mut(block.len().min(run.length - n));
                reflection.apply(row, own);
                for run in later {
                    let (own, others) = rest.split_at_mut(rest.len().min(run.length));
                    let far = run.first.saturating_sub(column);
                    reflection.apply(row.get_mut(far..).unwrap_or(&mut []), own);
                    rest = others;
                }
                block = block.get_mut(1..).unwrap_or(&mut []);
            }
        }
        Ok(())
    }
}

/// 1 − τ (1, v)(1, v)ᵀ, and a change of sign of the first entry: turns (r, x) into (√(r² + |x|²), 0).
struct Reflection<T> {
    v: [T; ROWS],
    tau: T,
}

impl<T: Real> Reflection<T> {
    #[inline(always)]
    fn new(r: T, x: &[T; ROWS]) -> Self {
        let square = x.iter().fold(r * r, |sum, x| sum + *x * *x);
        let inverse = square.inverse_sqrt();
        let lead = r + square * inverse;
        // A selection rather than a branch: the cost must not tell the data. No length, no reflection.
        let is_zero = if lead > T::zero() {
            T::zero()
        } else {
            T::one()
        };
        let scale = T::one() / (lead + is_zero);
        Self {
            v: x.map(|x| x * scale),
            tau: lead * inverse,
        }
    }

    /// Reflects numbers of one row of the triangle and those of the block below them, as many as the block has.
    #[inline]
    fn apply(&self, row: &mut [T], block: &mut Block<T>) {
        let [a, b, c, d] = self.v;
        for (r, x) in row.iter_mut().zip(block) {
            let [w, x, y, z] = x;
            let sum = *r + a * *w + b * *x + c * *y + d * *z;
            let share = self.tau * sum;
            *r = share - *r;
            *w -= a * share;
            *x -= b * share;
            *y -= c * share;
            *z -= d * share;
        }
    }
}
