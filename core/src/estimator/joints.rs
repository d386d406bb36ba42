//! All that a limb's data say: one factor per joint.

use super::Layout;
use crate::factor::{Factor, FactorError};
use crate::{Real, scalar::real, scalar::sqrt};

/// A joint's noise before there are data, N m.
pub const NOISE_GUESS: f64 = 0.1;
/// How many rows that guess is worth.
const NOISE_GUESS_ROWS: f64 = 10.0;

/// What every parameter of an empty factor is known by, as a row of that weight for the value zero.
///
/// A limb's columns are linearly dependent. Pivots that are zero but for rounding would turn rounding into rotations and so
/// take a share of the residual, a different one in every order of the arithmetic. This much is far above rounding and far
/// below any prior: zero ± 2e5 in `f64`, ± 200 in `f32`, in the parameter's unit.
pub(crate) fn floor<T: Real>() -> T {
    T::default_epsilon().cbrt()
}

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
        let mut factors = Self::unset(layout, storage);
        factors.clear();
        factors
    }

    /// [`new`](Self::new) as a constant, for statics: to be [`clear`](Self::clear)ed before it is used.
    pub const fn unset(layout: Layout<B>, storage: S) -> Self {
        Self {
            layout,
            rows: [T::ZERO; B],
            storage,
        }
    }

    /// Becomes a copy of `other`, in place: it may be larger than a microcontroller's stack.
    pub fn copy_from(&mut self, other: &Self) {
        self.layout = other.layout;
        self.rows = other.rows;
        let numbers = self.storage.as_mut().iter_mut();
        numbers
            .zip(other.storage.as_ref())
            .for_each(|(to, from)| *to = *from);
    }

    /// Becomes factors of `layout`, without data and without a floor, that count `windows`.
    pub(crate) fn reset_to(&mut self, layout: Layout<B>, windows: T) {
        self.layout = layout;
        self.rows = [windows; B];
        self.storage.as_mut().fill(T::zero());
    }

    /// Forgets all data.
    pub fn clear(&mut self) {
        for joint in 0..self.layout.bodies() {
            // The only error is a storage of the wrong length, which the first row will tell.
            let _ = self.with_joint(joint, |factor| {
                factor.clear();
                factor.set_floor(floor());
                Ok(())
            });
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

    /// Half the slopes of a joint's sum of squared residuals along each of its effects, at any parameters θ of the limb, into `slopes`.
    pub(crate) fn slopes(&self, joint: usize, theta: &[T], slopes: &mut [T]) {
        let factor = self.joint(joint);
        slopes.fill(T::zero());
        for k in 0..self.layout.effects(joint) {
            let misfit = self.misfit(&factor, joint, k, theta);
            let later = slopes.get_mut(k..).unwrap_or(&mut []);
            for (slope, r) in later.iter_mut().zip(factor.row(k)) {
                *slope += *r * misfit;
            }
        }
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

    pub(super) fn with_joint(
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
