//! Square-root information: rows of a least-squares problem folded into a triangle by orthogonal rotations.
//!
//! For rows W θ ≈ b the factor keeps the augmented triangle
//!
//! ```text
//! Q [W | b] = [ R  z ]      so that   ‖W θ − b‖² = ‖R θ − z‖² + ρ²   for every θ,
//!             [ 0  ρ ]
//! ```
//!
//! with Q orthogonal and never formed (Golub & Van Loan §6.5.3; Bierman, *Factorization Methods for Discrete Sequential
//! Estimation*, ch. IV). WᵀW is never formed either: it would square the condition number. The triangle is a sufficient
//! statistic: it answers for every model nested in its columns, for the sum of two data sets and for the misfit of any θ,
//! without the data.
//!
//! Storage is packed by rows in anything that lends a slice: an array on the microcontroller, a `Vec` on the desktop.
//! Every operation executes the same instructions whatever the numbers.
//!
//! # Example
//!
//! A line through a thousand points, none of which is kept:
//!
//! ```
//! use proprio_core::factor::{Factor, FactorError, packed_len};
//!
//! let mut factor: Factor<f64, [f64; packed_len(2)]> = Factor::new::<2>();
//! for n in 0..1000 {
//!     let x = f64::from(n) * 1e-3;
//!     factor.update(&mut [x, 1.0, 2.0 * x + 0.5])?;
//! }
//! let mut line = [0.0; 2];
//! factor.solve(&mut line)?;
//! assert!((line[0] - 2.0).abs() < 1e-9 && (line[1] - 0.5).abs() < 1e-9);
//! // The misfit of any other line, from the triangle alone.
//! assert!(factor.sum_of_squares(&[2.0, 0.4]) > 9.9);
//! # Ok::<(), FactorError>(())
//! ```

use crate::Real;

/// How many numbers a factor of `columns` parameters keeps: (p + 1)(p + 2)/2, the right-hand side and ρ included.
pub const fn packed_len(columns: usize) -> usize {
    (columns + 1) * (columns + 2) / 2
}

/// Why a factor refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FactorError {
    /// A slice has this length, not the one the factor's columns ask for.
    Length(usize),
    /// The row holds a NaN or an infinity; the factor is unchanged.
    NotFinite,
    /// Nothing determines this column, nor a combination of it with later ones: add a prior.
    Singular(usize),
}

impl core::fmt::Display for FactorError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Length(n) => write!(f, "a slice of {n} numbers does not fit the factor"),
            Self::NotFinite => write!(f, "the row holds a NaN or an infinity"),
            Self::Singular(c) => write!(f, "nothing determines column {c}: add a prior"),
        }
    }
}

impl core::error::Error for FactorError {}

/// The augmented triangle [R z; 0 ρ] of a least-squares problem with `columns` parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor<T, S> {
    columns: usize,
    rows: T,
    storage: S,
}

impl<T: Real, const N: usize> Factor<T, [T; N]> {
    /// A factor of no rows and `P` parameters in an array; `N` must be [`packed_len`]`(P)`, checked when compiled.
    pub fn new<const P: usize>() -> Self {
        const { assert!(N == packed_len(P)) }
        Self {
            columns: P,
            rows: T::zero(),
            storage: [T::zero(); N],
        }
    }
}

impl<T: Real> Factor<T, &[T]> {
    /// A factor of no parameters and no data, without storage.
    pub(crate) fn nothing() -> Self {
        Self {
            columns: 0,
            rows: T::zero(),
            storage: &[],
        }
    }
}

impl<T: Real, S: AsRef<[T]>> Factor<T, S> {
    /// A factor of no rows in `storage`, which holds [`packed_len`]`(columns)` zeros.
    ///
    /// # Errors
    /// [`FactorError::Length`] if the storage has another length.
    pub fn in_storage(columns: usize, storage: S) -> Result<Self, FactorError> {
        match storage.as_ref().len() {
            len if len == packed_len(columns) => Ok(Self {
                columns,
                rows: T::zero(),
                storage,
            }),
            len => Err(FactorError::Length(len)),
        }
    }

    /// Number of parameters p.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows folded in; forgotten ones count less.
    pub fn rows(&self) -> T {
        self.rows
    }

    /// A factor that a slice holds, as [`packed`](Self::packed) gave it out.
    ///
    /// # Errors
    /// [`FactorError::Length`] if the slice has another length than [`packed_len`]`(columns)`.
    pub fn from_packed(columns: usize, rows: T, packed: S) -> Result<Self, FactorError> {
        Ok(Self {
            rows,
            ..Self::in_storage(columns, packed)?
        })
    }

    /// The numbers of the triangle, row by row.
    pub fn packed(&self) -> &[T] {
        self.storage.as_ref()
    }

    /// The same factor, borrowed.
    pub fn view(&self) -> Factor<T, &[T]> {
        Factor {
            columns: self.columns,
            rows: self.rows,
            storage: self.storage.as_ref(),
        }
    }

    /// Row k of the triangle from its diagonal on; k = p is ρ alone. Empty for k beyond.
    pub fn row(&self, k: usize) -> &[T] {
        let start = row_start(self.columns, k);
        self.storage
            .as_ref()
            .get(start..start + (self.columns + 1).saturating_sub(k))
            .unwrap_or(&[])
    }

    /// ρ², the least sum of squared residuals that any θ reaches.
    pub fn residual(&self) -> T {
        self.row(self.columns)
            .first()
            .map_or(T::zero(), |rho| *rho * *rho)
    }

    /// ‖W θ − b‖² of the rows folded in, for any θ of p numbers (missing ones count as zero).
    pub fn sum_of_squares(&self, theta: &[T]) -> T {
        (0..self.columns).fold(self.residual(), |sum, k| {
            let misfit = self.misfit(k, theta);
            sum + misfit * misfit
        })
    }

    /// Σ (R δ)² of some rows: how much ‖W θ − b‖² bends over a step δ.
    pub(crate) fn bend(&self, rows: core::ops::Range<usize>, step: &[T]) -> T {
        rows.fold(T::zero(), |sum, k| {
            let r = self.row(k).split_last().map_or(&[] as &[T], |(_, r)| r);
            let change = dot(r, step.get(k..).unwrap_or(&[]));
            sum + change * change
        })
    }

    /// Entry k of R θ − z.
    fn misfit(&self, k: usize, theta: &[T]) -> T {
        self.row(k).split_last().map_or(T::zero(), |(z, r)| {
            dot(r, theta.get(k..).unwrap_or(&[])) - *z
        })
    }

    /// The least-squares solution R⁻¹ z into `theta`.
    ///
    /// # Errors
    /// [`FactorError::Singular`] names the last column that nothing determines; [`FactorError::Length`] if `theta` does
    /// not hold p numbers. `theta` is then unspecified.
    pub fn solve(&self, theta: &mut [T]) -> Result<(), FactorError> {
        self.solve_rows(self.columns, theta)
    }

    /// [`solve`](Self::solve) for the first `rows` parameters; `theta` has the others.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    #[inline(always)]
    pub(crate) fn solve_rows(&self, rows: usize, theta: &mut [T]) -> Result<(), FactorError> {
        if theta.len() != self.columns || rows > self.columns {
            return Err(FactorError::Length(theta.len()));
        }
        for k in (0..rows).rev() {
            let row = self.row(k);
            let (Some(pivot), Some(z), Some(r)) =
                (row.first(), row.last(), row.get(1..self.columns - k))
            else {
                return Err(FactorError::Length(theta.len()));
            };
            if *pivot <= T::zero() {
                return Err(FactorError::Singular(k));
            }
            let value = (*z - dot(r, theta.get(k + 1..).unwrap_or(&[]))) / *pivot;
            if let Some(to) = theta.get_mut(k) {
                *to = value;
            }
        }
        Ok(())
    }

    /// The diagonal of (RᵀR)⁻¹ into `variance`: the variances of the solution for rows of unit noise.
    ///
    /// `scratch` holds p numbers and is overwritten. Row norms of R⁻¹, one column of it at a time.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn variances(&self, variance: &mut [T], scratch: &mut [T]) -> Result<(), FactorError> {
        variance.fill(T::zero());
        for j in 0..self.columns {
            self.add_variance_column(j, variance, scratch)?;
        }
        Ok(())
    }

    /// Column j's share of [`variances`](Self::variances), for callers that spread the work over time.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn add_variance_column(
        &self,
        j: usize,
        variance: &mut [T],
        scratch: &mut [T],
    ) -> Result<(), FactorError> {
        self.inverse_column(j, scratch)?;
        if variance.len() != self.columns {
            return Err(FactorError::Length(variance.len()));
        }
        for (sum, x) in variance.iter_mut().zip(scratch.iter()).take(j + 1) {
            *sum += *x * *x;
        }
        Ok(())
    }

    /// Column j of R⁻¹ into the first j + 1 numbers of `out`, which holds p.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn inverse_column(&self, j: usize, out: &mut [T]) -> Result<(), FactorError> {
        if out.len() != self.columns || j >= self.columns {
            return Err(FactorError::Length(out.len()));
        }
        for k in (0..=j).rev() {
            let row = self.row(k);
            let pivot = row.first().copied().unwrap_or(T::zero());
            if pivot <= T::zero() {
                return Err(FactorError::Singular(k));
            }
            let right = if k == j { T::one() } else { T::zero() };
            let below = out.get(k + 1..).unwrap_or(&[]);
            let value = (right - dot(row.get(1..=j - k).unwrap_or(&[]), below)) / pivot;
            if let Some(to) = out.get_mut(k) {
                *to = value;
            }
        }
        Ok(())
    }
}

/// Where row k starts in packed storage.
pub(crate) const fn row_start(columns: usize, k: usize) -> usize {
    // Rows before it have columns + 1, columns, … entries.
    k * (2 * columns + 3 - if k <= columns { k } else { columns + 1 }) / 2
}

/// Σ a b of as many numbers as both have, from the first on. Four a turn: a loop's own instructions are as many as a product's.
#[inline]
fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    let a = a.get(..b.len()).unwrap_or(a);
    let ((fours, rest), (of_b, _)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let sum = fours.iter().zip(of_b).fold(T::zero(), |sum, (x, y)| {
        sum + x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + x[3] * y[3]
    });
    let of_rest = b.get(4 * fours.len()..).unwrap_or(&[]);
    let rest = rest.iter().zip(of_rest);
    rest.fold(sum, |sum, (x, y)| sum + *x * *y)
}

mod arrow;
mod block;
mod forget;
mod reduce;
mod update;

pub use arrow::{ArrowFactor, Folding};
pub use block::{Block, ROWS};
pub(crate) use block::{Run, block_cost};

#[cfg(test)]
mod arrow_tests;
#[cfg(test)]
mod tests;
