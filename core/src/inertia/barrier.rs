//! How far a body is from the CAD's, and from what is impossible, in steps that a microcontroller can do between two samples.
//!
//! The same numbers as [`InertialParameters::divergence`] and [`InertialParameters::divergence_near`], to rounding, by the same
//! instructions whatever they are: written out for the 4 × 4 triangle, without what can panic.

use super::{INERTIAL, InertialParameters};
use crate::Real;
use crate::factor::ROWS;
use crate::scalar::{ln, real};

type Square<T> = [[T; 4]; 4];

/// Six rows of ten numbers and a right-hand side, side by side.
pub(crate) type KnownRows<T> = [[T; ROWS]; INERTIAL + 1];

/// Ten rows: the first six, and the other four.
pub(crate) type Expansion<T> = [KnownRows<T>; 2];

/// The triangle L of a pseudo-inertia P = L Lᵀ, and its inverse.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Root<T> {
    lower: Square<T>,
    inverse: Square<T>,
    physical: bool,
}

impl<T: Real> Root<T> {
    /// Of a body; of one that is not physical, some numbers.
    pub(crate) fn of(body: &InertialParameters<T>) -> Self {
        let p = pseudo(body);
        let (mut lower, mut inverse) = ([[T::zero(); 4]; 4], [[T::zero(); 4]; 4]);
        let mut physical = true;
        for i in 0..4 {
            for j in 0..i {
                let known = (0..j).fold(T::zero(), |sum, k| {
                    sum + at(&lower, i, k) * at(&lower, j, k)
                });
                let left = at(&p, i, j) - known;
                set(&mut lower, i, j, left * at(&inverse, j, j));
            }
            let known = (0..i).fold(T::zero(), |sum, k| {
                sum + at(&lower, i, k) * at(&lower, i, k)
            });
            let pivot = at(&p, i, i) - known;
            // What rounding leaves of a spread of nothing is not a spread; a NaN is none either.
            let least = at(&p, i, i).abs() * T::default_epsilon();
            physical &= pivot > least;
            let pivot = pivot.max(least + real(1e-30));
            let scale = pivot.inverse_sqrt();
            set(&mut inverse, i, i, scale);
            set(&mut lower, i, i, pivot * scale);
            for j in 0..i {
                let sum = (j..i).fold(T::zero(), |sum, k| {
                    sum + at(&lower, i, k) * at(&inverse, k, j)
                });
                set(&mut inverse, i, j, -sum * scale);
            }
        }
        Self {
            lower,
            inverse,
            physical,
        }
    }

    /// Whether a body of positive density could have these parameters.
    pub(crate) fn is_physical(&self) -> bool {
        self.physical
    }

    /// L₀⁻¹ L: how this body is to the CAD's.
    fn relative(&self, cad: &Self) -> Square<T> {
        let mut ratio = [[T::zero(); 4]; 4];
        for i in 0..4 {
            for j in 0..=i {
                let sum = (j..=i).fold(T::zero(), |sum, k| {
                    sum + at(&cad.inverse, i, k) * at(&self.lower, k, j)
                });
                set(&mut ratio, i, j, sum);
            }
        }
        ratio
    }

    /// tr(P₀⁻¹ P) − log det(P₀⁻¹ P) − 4 ≥ 0, if both bodies are physical.
    pub(crate) fn divergence(&self, cad: &Self) -> T {
        let ratio = self.relative(cad);
        let trace = ratio
            .as_flattened()
            .iter()
            .fold(T::zero(), |sum, x| sum + *x * *x);
        let root = (0..4).fold(T::one(), |product, k| product * at(&ratio, k, k));
        trace - real::<T>(2.0) * ln(root) - real(4.0)
    }

    /// The ten rows of [`InertialParameters::divergence_near`] about `body`, whose root this is.
    pub(crate) fn expansion(
        &self,
        body: &InertialParameters<T>,
        cad: &Self,
        relative: T,
    ) -> Expansion<T> {
        let ratio = self.relative(cad);
        let scale = T::one() / relative;
        let diagonal_off = scale * real(core::f64::consts::SQRT_2);
        let mut rows = [[[T::zero(); ROWS]; INERTIAL + 1]; 2];
        let mut n = 0;
        for i in 0..4 {
            for j in 0..=i {
                // Lᵀ P₀⁻¹ L at (i, j), subtracted from one.
                let product = (i..4).fold(T::zero(), |sum, k| {
                    sum + at(&ratio, k, i) * at(&ratio, k, j)
                });
                let (weight, one) = if i == j {
                    (scale, T::one())
                } else {
                    (diagonal_off, T::zero())
                };
                let row = self.whitened(i, j);
                let own = row.iter().zip(body.0.as_slice());
                let own = own.fold(T::zero(), |sum, (r, x)| sum + *r * *x);
                let right = own + one - product;
                if let Some(half) = rows.get_mut(n / ROWS) {
                    for (to, x) in half.iter_mut().zip(row.iter().chain([&right])) {
                        to[n % ROWS] = *x * weight;
                    }
                }
                n += 1;
            }
        }
        rows
    }

    /// Entry (i, j) of L⁻¹ δP L⁻ᵀ as a row in δφ.
    #[inline(always)]
    fn whitened(&self, i: usize, j: usize) -> [T; INERTIAL] {
        let zero = [T::zero(); 4];
        let row = |n: usize| self.inverse.get(n).unwrap_or(&zero);
        let (a, b) = (row(i), row(j));
        let off = |m: usize, n: usize| a[m] * b[n] + a[n] * b[m];
        let half = real::<T>(0.5);
        let [x, y, z] = [a[0] * b[0] * half, a[1] * b[1] * half, a[2] * b[2] * half];
        // Σ = ½ tr(I) 1 − I: an inertia about an axis is spread along the two others.
        [
            a[3] * b[3],
            off(0, 3),
            off(1, 3),
            off(2, 3),
            y + z - x,
            -off(0, 1),
            -off(0, 2),
            x + z - y,
            -off(1, 2),
            x + y - z,
        ]
    }
}

/// An entry; zero beyond the matrix.
#[inline(always)]
fn at<T: Real>(matrix: &Square<T>, i: usize, j: usize) -> T {
    let entry = matrix.get(i).and_then(|row| row.get(j));
    entry.copied().unwrap_or(T::zero())
}

#[inline(always)]
fn set<T: Real>(matrix: &mut Square<T>, i: usize, j: usize, value: T) {
    if let Some(entry) = matrix.get_mut(i).and_then(|row| row.get_mut(j)) {
        *entry = value;
    }
}

/// The lower half of the pseudo-inertia, as [`InertialParameters::pseudo_inertia`] has it.
fn pseudo<T: Real>(body: &InertialParameters<T>) -> Square<T> {
    let [m, hx, hy, hz, xx, xy, xz, yy, yz, zz] = body.0.data.0[0];
    let (half, o) = (real::<T>(0.5), T::zero());
    [
        [(yy + zz - xx) * half, o, o, o],
        [-xy, (xx + zz - yy) * half, o, o],
        [-xz, -yz, (xx + yy - zz) * half, o],
        [hx, hy, hz, m],
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inertia::tests::physical;
    use nalgebra::SVector;
    use proptest::prelude::*;
    use std::prelude::rust_2024::*;

    proptest! {
        #[test]
        fn it_says_what_the_matrices_say(phi in physical(), cad in physical(), at in physical()) {
            let (root, there) = (Root::of(&phi), Root::of(&cad));
            prop_assert!(root.is_physical());
            let (ours, theirs) = (root.divergence(&there), phi.divergence(&cad).unwrap());
            prop_assert!((ours - theirs).abs() < 1e-9 * (1.0 + theirs), "{ours} {theirs}");
            let near = phi.divergence_near(&cad, 0.3).unwrap();
            let theirs = near.sum_of_squares(at.0.as_slice());
            let rows = root.expansion(&phi, &there, 0.3);
            let mut ours = 0.0;
            for row in (0..ROWS).flat_map(|n| rows.iter().map(move |half| half.map(|c| c[n]))) {
                let sum: f64 = (0..INERTIAL).map(|c| row[c] * at.0[c]).sum();
                ours += (sum - row[INERTIAL]).powi(2);
            }
            prop_assert!((ours - theirs).abs() < 1e-6 * (1.0 + theirs), "{ours} {theirs}");
        }

        #[test]
        fn it_knows_what_is_physical(phi in prop::array::uniform10(-1.0..1.0f64), about in physical()) {
            // From a body that is, some way towards numbers that need not be.
            for part in [0.01, 0.1, 1.0] {
                let body = InertialParameters(about.0 * (1.0 - part) + SVector::from(phi) * part);
                prop_assert_eq!(Root::of(&body).is_physical(), body.is_physical());
            }
        }
    }

    #[test]
    fn what_is_not_a_number_is_not_physical() {
        let mut body = InertialParameters::<f64>::zero();
        assert!(!Root::of(&body).is_physical());
        body.0[0] = f64::NAN;
        assert!(!Root::of(&body).is_physical());
    }
}
