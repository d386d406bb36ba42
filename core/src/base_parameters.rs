//! Base parameters: the combinations of inertial parameters that rows can determine at all.
//!
//! Columns of a regressor that are linear combinations of others in every state say nothing of their own. With the
//! independent columns W_i of W, picked from the left, W = W_i P exactly: what W θ tells is β = P θ, the *base parameters*
//! (Gautier 1991, "Numerical calculation of the base inertial parameters of robots"). In the independent columns P is the
//! identity, elsewhere it says which multiple of a standard parameter goes to which base parameter; it depends on the
//! tree's geometry alone.
//!
//! The analysis reduces a triangle to row echelon form by rotations and back-substitutes. The triangle may be that of
//! rows in random-like states ([`of_joint`](BaseParameters::of_joint): what no motion can tell) or of data
//! ([`of_factor`](BaseParameters::of_factor): what this motion does not tell).

use crate::Real;
use crate::factor::{Factor, FactorError, packed_len};
use crate::inertia::INERTIAL;
use crate::scalar::{real, sin_cos, sqrt};
use crate::spatial::Transform;
use crate::tree::Tree;
use nalgebra::{Matrix3, SVector, Vector3};

/// Independent columns and how the others combine into them, in the storage of a [`Factor`] of as many columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseParameters<T, S> {
    /// Row r of the rank first ones: P from the diagonal on. The place of the right-hand side is not used.
    reduced: Factor<T, S>,
    rank: usize,
}

impl<T: Real, S: AsRef<[T]> + AsMut<[T]>> BaseParameters<T, S> {
    /// The base parameters that the rows of a factor determine; its right-hand side is overwritten.
    ///
    /// A column is independent if more than `tolerance` of its length is not a combination of those before it. For a
    /// factor of data this is the noise's share; [`of_joint`](Self::of_joint) takes the root of the rounding error.
    pub fn of_factor(factor: Factor<T, S>, tolerance: T) -> Self {
        let mut reduced = factor;
        let rank = reduced.reduce(tolerance);
        Self { reduced, rank }
    }

    /// The base parameters of one joint's torque, whatever the motion and the tilt of the base: columns are the inertial
    /// parameters of the bodies that the joint (of one degree of freedom) moves.
    ///
    /// `storage` holds [`packed_len`] of so many columns, `row` one number more than columns. `P` is 10 `B`.
    ///
    /// # Errors
    /// [`FactorError::Length`] for a slice of another length.
    pub fn of_joint<const B: usize, const V: usize, const P: usize>(
        tree: &Tree<T, B, V>,
        joint: usize,
        storage: S,
        row: &mut [T],
    ) -> Result<Self, FactorError> {
        let columns = INERTIAL * tree.subtree(joint).len();
        let mut factor = Factor::in_storage(columns, storage)?;
        factor.clear();
        let mut states = States(1);
        // As many again as are needed: a state in which two columns happen to look alike does no harm.
        for _ in 0..2 * columns {
            states.write_row::<T, B, V, P>(tree, joint, row);
            factor.update(row)?;
        }
        Ok(Self::of_factor(factor, sqrt(T::default_epsilon())))
    }
}

impl<T: Real, S: AsRef<[T]>> BaseParameters<T, S> {
    /// Those that another's [`packed`](Self::packed) numbers say, in a slice of any kind.
    ///
    /// # Errors
    /// [`FactorError::Length`] if the slice is of another length.
    pub fn from_packed(columns: usize, rank: usize, packed: S) -> Result<Self, FactorError> {
        let reduced = Factor::in_storage(columns, packed)?;
        Ok(Self { reduced, rank })
    }

    /// The numbers of the reduced triangle, row by row.
    pub fn packed(&self) -> &[T] {
        self.reduced.packed()
    }

    /// How many columns there are.
    pub fn columns(&self) -> usize {
        self.reduced.columns()
    }

    /// How many base parameters there are.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// The column that stands for base parameter r; grows with r.
    pub fn independent(&self, r: usize) -> Option<usize> {
        let row = self.combination(r);
        let zeros = row.iter().take_while(|x| **x == T::zero()).count();
        (zeros < row.len()).then_some(r + zeros)
    }

    /// All of them, from the left. One pass: the first row's zeros and what the rows below say of each column.
    pub fn independent_columns(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.rank).filter_map(|r| self.independent(r))
    }

    /// Base parameter r as a combination of the standard parameters from number r on: β_r = Σ_n c_n φ_(r+n). Empty for r
    /// beyond the rank.
    pub fn combination(&self, r: usize) -> &[T] {
        match self.reduced.row(r).split_last() {
            Some((_, row)) if r < self.rank => row,
            _ => &[],
        }
    }

    /// β = P φ into `base`.
    pub fn base_of(&self, standard: &[T], base: &mut [T]) {
        for (r, beta) in base.iter_mut().enumerate() {
            let terms = self.combination(r).iter().zip(standard.iter().skip(r));
            *beta = terms.fold(T::zero(), |sum, (c, phi)| sum + *c * *phi);
        }
    }

    /// Adds to `standard` a row over the base parameters from number `first` on as one over the standard parameters: row · P.
    pub fn expand(&self, first: usize, row: &[T], standard: &mut [T]) {
        for (n, entry) in row.iter().enumerate() {
            let r = first + n;
            let target = standard.get_mut(r..).unwrap_or(&mut []);
            for (to, c) in target.iter_mut().zip(self.combination(r)) {
                *to += *entry * *c;
            }
        }
    }

    /// The marginal of a prior on the standard parameters (a factor over the same columns) as a factor over the base
    /// parameters, into `base`, which has [`rank`](Self::rank) columns.
    ///
    /// With φ_i = β − K φ_d the prior is a factor over (φ_d, β); its last rows do not know φ_d. `work` holds
    /// [`packed_len`] of all columns, `row` one number more than columns.
    ///
    /// # Errors
    /// As [`Factor::update`]'s.
    pub fn marginal<O, D>(
        &self,
        prior: &Factor<T, O>,
        base: &mut Factor<T, D>,
        work: &mut [T],
        row: &mut [T],
    ) -> Result<(), FactorError>
    where
        O: AsRef<[T]>,
        D: AsRef<[T]> + AsMut<[T]>,
    {
        let columns = self.columns();
        let mut whole = Factor::in_storage(columns, work)?;
        whole.clear();
        let dependent = columns.saturating_sub(self.rank);
        for k in 0..=columns {
            self.write_changed(prior, k, dependent, row);
            whole.update(row)?;
        }
        base.clear();
        for r in 0..=self.rank {
            base.set_row(r, whole.row(dependent + r))?;
        }
        Ok(())
    }

    /// Row k of a factor over φ as one over (φ_d, β).
    fn write_changed<O: AsRef<[T]>>(
        &self,
        prior: &Factor<T, O>,
        k: usize,
        dependent: usize,
        row: &mut [T],
    ) {
        row.fill(T::zero());
        let from = prior.row(k);
        let entry = |c: usize| {
            let entry = c.checked_sub(k).and_then(|n| from.get(n));
            entry.copied().unwrap_or(T::zero())
        };
        let (mut d, mut r) = (0, 0);
        for c in 0..self.columns() {
            let independent = self.independent(r) == Some(c);
            let place = if independent { dependent + r } else { d };
            let mut value = entry(c);
            if independent {
                r += 1;
            } else {
                // −K φ_d in the place of φ_i.
                for i in 0..r {
                    let pivot = self.independent(i).unwrap_or(0);
                    let share = c.checked_sub(i).and_then(|n| self.combination(i).get(n));
                    value -= entry(pivot) * share.copied().unwrap_or(T::zero());
                }
                d += 1;
            }
            if let Some(to) = row.get_mut(place) {
                *to = value;
            }
        }
        if let Some(to) = row.get_mut(self.columns()) {
            *to = entry(self.columns());
        }
    }
}

/// States of a tree that look random and are the same on every machine.
struct States(u32);

impl States {
    /// A number in −1 to 1.
    fn next<T: Real>(&mut self) -> T {
        // Numerical Recipes' generator; the upper bits are good enough for variety.
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        real(f64::from(self.0 as i32 >> 8) / f64::from(1 << 23))
    }

    /// The torque row of a joint in the next state: position, velocity, acceleration and the tilt of the base.
    fn write_row<T: Real, const B: usize, const V: usize, const P: usize>(
        &mut self,
        tree: &Tree<T, B, V>,
        joint: usize,
        row: &mut [T],
    ) {
        let mut base = Transform::identity();
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            base.rotation *= turn(&axis, self.next::<T>() * real(3.0));
        }
        let q = SVector::from_fn(|_, _| self.next::<T>() * real(3.0));
        let v = SVector::from_fn(|_, _| self.next::<T>() * real(5.0));
        // Accelerations as large as gravity's and the centrifugal ones, so that no kind of column is faint.
        let a = SVector::from_fn(|_, _| self.next::<T>() * real(25.0));
        let regressor =
            tree.inverse_dynamics_regressor::<P>(&tree.kinematics(&base, &q, &v), &v, &a);
        let coordinate = tree.coordinates(joint).start;
        let first = INERTIAL * joint;
        for (n, to) in row.iter_mut().enumerate() {
            let within = n < INERTIAL * tree.subtree(joint).len();
            let entry = regressor.get((coordinate, first + n));
            *to = entry.filter(|_| within).copied().unwrap_or(T::zero());
        }
    }
}

/// The rotation about a unit axis.
fn turn<T: Real>(axis: &Vector3<T>, angle: T) -> Matrix3<T> {
    let (sin, cos) = sin_cos(angle);
    let cross = axis.cross_matrix();
    Matrix3::identity() + cross * sin + cross * cross * (T::one() - cos)
}

/// Numbers of the workspace that [`BaseParameters::of_joint`] and [`BaseParameters::marginal`] take, a row included.
pub const fn workspace_len(columns: usize) -> usize {
    packed_len(columns) + columns + 1
}

#[cfg(test)]
mod tests;
