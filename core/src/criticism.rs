//! Which effects a model lacks, or could do without: nested models from factors, judged on data they were not fitted to.
//!
//! A factor whose columns are *nuisance* parameters (the rigid body's) first and effects behind them holds the fit of every
//! model with all the nuisance columns and any subset of the effects: the rows below the nuisance ones do not know the
//! nuisance parameters any more, so a subset's fit is a small least-squares problem there ([`Nested::fit`]), and the
//! nuisance parameters follow by substitution. Fitted to one fold and judged on another by
//! [`Factor::sum_of_squares`], two nested models give the held-out gain of what they differ in ([`HeldOut`]). Naive F-tests
//! would accept almost anything: residuals remember (`design.md` §6).

use crate::Real;
use crate::factor::{Factor, FactorError, ROWS, packed_len};
use crate::scalar::{real, sqrt};

/// Most effect columns of a [`Nested`] factor.
pub const MAX_EFFECTS: usize = 32;

/// How many numbers of work space a fit with so many effects takes.
pub const fn work_len(effects: usize) -> usize {
    packed_len(effects)
}

/// What a fit says of one effect: its value and how sharply (in units of the rows' noise) the data determine it.
///
/// Independent data sets add up: [`plus`](Self::plus).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Finding<T> {
    /// Inverse variance.
    pub information: T,
    /// Value times inverse variance.
    pub weighted: T,
}

impl<T: Real> Finding<T> {
    /// Nothing found.
    pub const NONE: Self = Self {
        information: T::ZERO,
        weighted: T::ZERO,
    };

    /// Both findings together.
    pub fn plus(self, other: Self) -> Self {
        Self {
            information: self.information + other.information,
            weighted: self.weighted + other.weighted,
        }
    }

    /// The value; not finite if nothing was found.
    pub fn value(&self) -> T {
        self.weighted / self.information
    }

    /// Its standard deviation.
    pub fn std(&self) -> T {
        self.information.inverse_sqrt()
    }
}

/// A factor whose first `nuisance` columns every model has; bit n of a subset means column `nuisance` + n.
#[derive(Clone, Copy, Debug)]
pub struct Nested<'a, T> {
    factor: Factor<T, &'a [T]>,
    nuisance: usize,
}

impl<'a, T: Real> Nested<'a, T> {
    /// The models within `factor`.
    pub fn new(factor: Factor<T, &'a [T]>, nuisance: usize) -> Self {
        Self { factor, nuisance }
    }

    /// Fits the model with the effects of `subset` into `theta`, one number per column, zero where the model has none, and
    /// says what the fit found of effect `of`.
    ///
    /// `work` holds [`work_len`] of the subset's size, or more.
    ///
    /// # Errors
    /// [`FactorError::Singular`] if nothing determines a parameter, [`FactorError::Length`] for a slice too short or more
    /// effects than [`MAX_EFFECTS`].
    pub fn fit(
        &self,
        subset: u32,
        of: usize,
        theta: &mut [T],
        work: &mut [T],
    ) -> Result<Finding<T>, FactorError> {
        let (p, nuisance) = (self.factor.columns(), self.nuisance);
        let effects = p.saturating_sub(nuisance);
        if theta.len() != p || effects > MAX_EFFECTS {
            return Err(FactorError::Length(theta.len()));
        }
        // `of` comes last: the last pivot is what the data say of it when all else is free.
        let chosen = |n: &usize| subset >> n & 1 == 1;
        let order = || {
            let rest = (0..effects).filter(|n| *n != of);
            rest.chain((of < effects).then_some(of)).filter(chosen)
        };
        let m = order().count();
        let short = FactorError::Length(work.len());
        let mut small = Factor::in_storage(m, work.get_mut(..packed_len(m)).ok_or(short)?)?;
        small.clear();
        let mut block = [[T::zero(); ROWS]; MAX_EFFECTS + 1];
        let block = block.get_mut(..=m).unwrap_or(&mut []);
        for first in (nuisance..=p).step_by(ROWS) {
            let columns = order().map(|n| nuisance + n).chain([p]);
            for (to, c) in block.iter_mut().zip(columns) {
                *to = core::array::from_fn(|slot| {
                    let entry = c
                        .checked_sub(first + slot)
                        .and_then(|n| self.factor.row(first + slot).get(n));
                    entry.copied().unwrap_or(T::zero())
                });
            }
            small.fold_block(0, block)?;
        }
        let mut values = [T::zero(); MAX_EFFECTS];
        small.solve(values.get_mut(..m).unwrap_or(&mut []))?;
        theta.fill(T::zero());
        for (n, value) in order().zip(values) {
            if let Some(to) = theta.get_mut(nuisance + n) {
                *to = value;
            }
        }
        self.substitute(theta)?;
        Ok(match (chosen(&of), m.checked_sub(1)) {
            (true, Some(last)) => {
                let pivot = small.row(last).first().copied().unwrap_or(T::zero());
                Finding {
                    information: pivot * pivot,
                    weighted: pivot * pivot * values.get(last).copied().unwrap_or(T::zero()),
                }
            }
            _ => Finding::NONE,
        })
    }

    /// The nuisance parameters that fit best beside the effects in `theta`.
    fn substitute(&self, theta: &mut [T]) -> Result<(), FactorError> {
        for k in (0..self.nuisance).rev() {
            let (Some((pivot, r)), rest) = (self.factor.row(k).split_first(), theta.get(k + 1..))
            else {
                return Err(FactorError::Length(theta.len()));
            };
            if *pivot <= T::zero() {
                return Err(FactorError::Singular(k));
            }
            let Some((z, r)) = r.split_last() else {
                return Err(FactorError::Length(theta.len()));
            };
            let known = r.iter().zip(rest.unwrap_or(&[]));
            let value = (*z - known.fold(T::zero(), |sum, (r, x)| sum + *r * *x)) / *pivot;
            if let Some(to) = theta.get_mut(k) {
                *to = value;
            }
        }
        Ok(())
    }
}

/// Sums of squared residuals of two nested models on data they were not fitted to, one pair per fold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeldOut<T, const FOLDS: usize> {
    /// Of the model with the effect.
    pub with: [T; FOLDS],
    /// Of the model without.
    pub without: [T; FOLDS],
}

impl<T: Real, const FOLDS: usize> HeldOut<T, FOLDS> {
    /// Nothing judged yet.
    pub const NONE: Self = Self {
        with: [T::ZERO; FOLDS],
        without: [T::ZERO; FOLDS],
    };

    /// 1 − with / without, over all folds: the share of the squared error that the effect takes away.
    pub fn gain(&self) -> T {
        let sum = |part: &[T]| part.iter().fold(T::zero(), |sum, x| sum + *x);
        T::one() - sum(&self.with) / sum(&self.without)
    }

    /// The gain's standard error by the folds' own gains: their standard deviation over √folds.
    pub fn gain_error(&self) -> T {
        let count = real::<T>(FOLDS as f64);
        let gains = |n: usize| T::one() - self.with[n] / self.without[n];
        let mean = (0..FOLDS).fold(T::zero(), |sum, n| sum + gains(n)) / count;
        let square = (0..FOLDS).fold(T::zero(), |sum, n| {
            sum + (gains(n) - mean) * (gains(n) - mean)
        });
        sqrt(square / (count * (count - T::one())))
    }
}

#[cfg(test)]
mod tests;
