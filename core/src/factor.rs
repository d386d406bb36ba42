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

use crate::Real;
use crate::scalar::sqrt;

/// How many numbers a factor of `columns` parameters keeps: (p + 1)(p + 2)/2, the right-hand side and ρ included.
pub const fn packed_len(columns: usize) -> usize {
    (columns + 1) * (columns + 2) / 2
}

/// Why a factor refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
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
        if theta.len() != self.columns {
            return Err(FactorError::Length(theta.len()));
        }
        for k in (0..self.columns).rev() {
            let row = self.row(k);
            let (Some(pivot), Some(z), Some(r)) =
                (row.first(), row.last(), row.get(1..self.columns - k))
            else {
                return Err(FactorError::Length(theta.len()));
            };
            if *pivot <= T::zero() {
                return Err(FactorError::Singular(k));
            }
            theta[k] = (*z - dot(r, &theta[k + 1..])) / *pivot;
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
            out[k] = (right - dot(row.get(1..=j - k).unwrap_or(&[]), &out[k + 1..])) / pivot;
        }
        Ok(())
    }
}

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

    /// Weighs everything folded in so far down to `retention` (0 to 1): exponential forgetting.
    pub fn forget(&mut self, retention: T) {
        let scale = sqrt(retention.max(T::zero()).min(T::one()));
        self.storage.as_mut().iter_mut().for_each(|x| *x *= scale);
        self.rows *= retention;
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

    /// Row k of [`merge`](Self::merge), for callers that spread the work over time; [`rows`](Self::rows) is not changed.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    pub fn merge_row<O: AsRef<[T]>>(
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

/// Where row k starts in packed storage.
const fn row_start(columns: usize, k: usize) -> usize {
    // Rows before it have columns + 1, columns, … entries.
    k * (2 * columns + 3 - if k <= columns { k } else { columns + 1 }) / 2
}

fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (x, y)| sum + *x * *y)
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

/// What is known of one body's ten inertial parameters.
pub type BodyFactor<T> = Factor<T, [T; packed_len(crate::inertia::INERTIAL)]>;

#[cfg(test)]
mod tests;
