//! All that a limb's data say: one factor per joint.

use super::Layout;
use crate::factor::{Factor, FactorError};
use crate::{Real, scalar::real, scalar::sqrt};

/// A joint's noise before there are data, N m.
pub const NOISE_GUESS: f64 = 0.1;
/// How many rows that guess is worth.
const NOISE_GUESS_ROWS: f64 = 10.0;

/// The factors of a limb's joints, packed one after the other in `storage`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointFactors<T, S, const B: usize> {
    layout: Layout<B>,
    rows: [T; B],
    storage: S,
}

impl<T: Real, S: AsRef<[T]> + AsMut<[T]>, const B: usize> JointFactors<T, S, B> {
    /// No data, in `storage` of [`Layout::packed_len`] zeros; with another length, every use is an error of length.
    pub fn new(layout: Layout<B>, storage: S) -> Self {
        Self {
            layout,
            rows: [T::zero(); B],
            storage,
        }
    }

    /// Which column is what.
    pub fn layout(&self) -> &Layout<B> {
        &self.layout
    }

    /// The factor of one joint; of no columns for a joint beyond the limb.
    pub fn joint(&self, joint: usize) -> Factor<T, &[T]> {
        let (columns, rows, packed) = match self.rows.get(joint) {
            Some(rows) if joint < self.layout.bodies() => {
                let packed = self.storage.as_ref().get(self.layout.packed(joint));
                (self.layout.columns(joint), *rows, packed.unwrap_or(&[]))
            }
            _ => (0, T::zero(), &[] as &[T]),
        };
        Factor::from_packed(columns, rows, packed).unwrap_or(Factor::nothing())
    }

    /// Windows folded in; forgotten ones count less.
    pub fn windows(&self) -> T {
        self.rows.first().copied().unwrap_or(T::zero())
    }

    /// Folds in one row of a joint: its effects, its bodies' parameters, its torque. The row is used up.
    ///
    /// # Errors
    /// [`FactorError::NotFinite`], and then the joint's factor is unchanged; [`FactorError::Length`].
    pub fn fold(&mut self, joint: usize, row: &mut [T]) -> Result<(), FactorError> {
        self.with_joint(joint, |factor| factor.update(row))
    }

    /// Weighs all data so far down to `retention` (0 to 1).
    pub fn forget(&mut self, retention: T) {
        for joint in 0..self.layout.bodies() {
            // The only error is a joint beyond the limb.
            let _ = self.with_joint(joint, |factor| {
                factor.forget(retention);
                Ok(())
            });
        }
    }

    /// Adds the data of `other`, which has the same layout; in any order. `scratch` holds one number more than the
    /// longest joint's columns.
    ///
    /// # Errors
    /// [`FactorError::NotFinite`] if `other` holds such a number, [`FactorError::Length`] if it has another layout.
    pub fn merge<O>(
        &mut self,
        other: &JointFactors<T, O, B>,
        scratch: &mut [T],
    ) -> Result<(), FactorError>
    where
        O: AsRef<[T]> + AsMut<[T]>,
    {
        if self.layout != other.layout {
            return Err(FactorError::Length(other.layout.parameters()));
        }
        for joint in 0..self.layout.bodies() {
            self.with_joint(joint, |factor| {
                factor.merge(&other.joint(joint), |c| c, T::one(), scratch)
            })?;
        }
        Ok(())
    }

    /// A joint's noise: the standard deviation of its mean torque over a window (N m) about its own best fit.
    ///
    /// Before there are data it is [`NOISE_GUESS`].
    pub fn noise(&self, joint: usize) -> T {
        let (guess, rows) = (real::<T>(NOISE_GUESS), real::<T>(NOISE_GUESS_ROWS));
        let factor = self.joint(joint);
        let freedom = (factor.rows() - real(factor.columns() as f64)).max(T::zero());
        sqrt((factor.residual() + rows * guess * guess) / (freedom + rows))
    }

    /// A joint's sum of squared residuals (mean torques over windows, N m) under any parameters θ of the limb.
    pub fn sum_of_squares(&self, joint: usize, theta: &[T]) -> T {
        let factor = self.joint(joint);
        (0..=factor.columns()).fold(T::zero(), |sum, k| {
            let misfit = self.misfit(&factor, joint, k, theta);
            sum + misfit * misfit
        })
    }

    /// Half the slope of a joint's sum of squared residuals along its effect `effect`, at any parameters θ of the limb.
    pub fn slope(&self, joint: usize, effect: usize, theta: &[T]) -> T {
        let factor = self.joint(joint);
        (0..=effect).fold(T::zero(), |sum, k| {
            let r = factor.row(k).get(effect - k).copied().unwrap_or(T::zero());
            sum + r * self.misfit(&factor, joint, k, theta)
        })
    }

    /// Entry k of \[R θ − z; −ρ\] of a joint.
    fn misfit(&self, factor: &Factor<T, &[T]>, joint: usize, k: usize, theta: &[T]) -> T {
        factor.row(k).split_last().map_or(T::zero(), |(z, r)| {
            r.iter().enumerate().fold(-*z, |sum, (n, r)| {
                let parameter = self.layout.parameter_index(joint, k + n);
                sum + *r * theta.get(parameter).copied().unwrap_or(T::zero())
            })
        })
    }

    fn with_joint(
        &mut self,
        joint: usize,
        work: impl FnOnce(&mut Factor<T, &mut [T]>) -> Result<(), FactorError>,
    ) -> Result<(), FactorError> {
        if joint >= self.layout.bodies() {
            return Err(FactorError::Length(joint));
        }
        let packed = self
            .storage
            .as_mut()
            .get_mut(self.layout.packed(joint))
            .unwrap_or(&mut []);
        let columns = self.layout.columns(joint);
        let mut factor = Factor::from_packed(columns, self.rows[joint], packed)?;
        let result = work(&mut factor);
        self.rows[joint] = factor.rows();
        result
    }
}
