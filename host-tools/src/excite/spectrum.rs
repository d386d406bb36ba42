//! Singular values and right singular vectors of a triangle.
//!
//! nalgebra's `SVD` (0.35) returns orthonormal vectors, but of about one in two thousand small triangles with zeros among their
//! entries vectors and values that are not the triangle's: R V has columns that are far from orthogonal. Slopes made of them are
//! wrong. Its vectors are therefore a first guess only: one-sided Jacobi rotations (Hestenes 1958; Demmel & Veselić 1992) go on
//! until the columns of R V are orthogonal to rounding. Of a right guess that takes one sweep that turns next to nothing; of a
//! wrong one, or of none at all, some more, and the outcome is the same.

use nalgebra::{DMatrix, DVector, SVD};

use crate::equation::dot::dot;

/// Most sweeps over all pairs of columns; from any start ten or fewer are enough.
const SWEEPS: usize = 60;
/// Steps of the guess before it is done without.
const STEPS: usize = 500;

/// Singular values of R, in no order, and its right singular vectors, as columns; `None` for numbers that are not finite.
pub(super) fn spectrum(r: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    if !r.iter().all(|x| x.is_finite()) {
        return None;
    }
    let guess = SVD::try_new(r.clone(), false, true, f64::EPSILON, STEPS).and_then(|svd| svd.v_t);
    let n = r.ncols();
    let mut v = guess.map_or_else(|| DMatrix::identity(n, n), |v_t| v_t.transpose());
    let mut columns = r * &v;
    let rounding = n as f64 * f64::EPSILON;
    (0..SWEEPS).find(|_| was_orthogonal(&mut columns, &mut v, rounding))?;
    let values = columns.column_iter().map(|column| column.norm());
    Some((DVector::from_iterator(n, values), v))
}

/// Makes each pair of `columns` orthogonal in turn, `v` turning with them; whether they were so to `rounding` already.
fn was_orthogonal(columns: &mut DMatrix<f64>, v: &mut DMatrix<f64>, rounding: f64) -> bool {
    let n = columns.ncols();
    // What is shorter beside the longest column is rounding itself, and has no direction.
    let nothing = rounding * rounding * columns.norm_squared();
    let mut done = true;
    for j in 1..n {
        for i in 0..j {
            let (a, b) = pair(columns, i, j);
            let (aa, bb, ab) = (square(a), square(b), dot(a, b));
            if aa.min(bb) <= nothing || ab.abs() <= rounding * (aa * bb).sqrt() {
                continue;
            }
            done = false;
            // The smaller of the two angles that make them orthogonal (Golub & Van Loan §8.5.2).
            let zeta = (bb - aa) / (2.0 * ab);
            let tan = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
            let cos = tan.hypot(1.0).recip();
            turn(a, b, cos, cos * tan);
            let (a, b) = pair(v, i, j);
            turn(a, b, cos, cos * tan);
        }
    }
    done
}

/// Columns i and j, i being the smaller.
fn pair(of: &mut DMatrix<f64>, i: usize, j: usize) -> (&mut [f64], &mut [f64]) {
    let rows = of.nrows();
    let (front, back) = of.as_mut_slice().split_at_mut(j * rows);
    (&mut front[i * rows..(i + 1) * rows], &mut back[..rows])
}

fn turn(a: &mut [f64], b: &mut [f64], cos: f64, sin: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        (*a, *b) = (cos * *a - sin * *b, sin * *a + cos * *b);
    }
}

fn square(a: &[f64]) -> f64 {
    dot(a, a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// V is orthogonal, so are the columns of R V, and the values are their lengths.
    fn assert_is_spectrum(r: &DMatrix<f64>) {
        let (values, v) = spectrum(r).unwrap();
        let n = r.ncols();
        assert!((v.transpose() * &v - DMatrix::identity(n, n)).amax() < 1e-13);
        let gram = (r * &v).transpose() * (r * &v);
        for i in 0..n {
            for j in 0..n {
                let expected = if i == j { values[i] * values[i] } else { 0.0 };
                let size = r.norm_squared().max(f64::MIN_POSITIVE);
                assert!((gram[(i, j)] - expected).abs() < 1e-14 * size, "{r} {gram}");
            }
        }
    }

    /// Of this triangle nalgebra's `SVD` leaves columns 62 degrees apart.
    #[test]
    fn a_triangle_that_misleads_the_guess() {
        #[rustfmt::skip]
        let r = DMatrix::from_row_slice(4, 4, &[
            1.411_147_622_357_589_2, 0.0, 0.0, -0.248_788_753_990_040_16,
            0.0, 0.3, 0.0, 0.0,
            0.0, 0.0, 1.311_824_421_402_315_1, 0.0,
            0.0, 0.0, 0.0, 0.389_049_711_862_022_14,
        ]);
        assert_is_spectrum(&r);
    }

    #[test]
    fn a_rank_that_is_not_full_and_numbers_that_are_none() {
        assert_is_spectrum(&DMatrix::from_element(5, 5, 0.7));
        assert_is_spectrum(&DMatrix::zeros(3, 3));
        assert!(spectrum(&DMatrix::from_element(3, 3, f64::NAN)).is_none());
    }

    proptest! {
        #[test]
        fn every_triangle_is_taken_apart(entries in prop::collection::vec((-1.0..1.0f64, any::<bool>()), 36), last in -9..1i32) {
            let r = DMatrix::from_fn(6, 6, |i, j| {
                let (entry, kept) = entries[6 * i + j];
                let size = if j == 5 { 10f64.powi(last) } else { 1.0 };
                if j == i || (j > i && kept) { size * entry } else { 0.0 }
            });
            assert_is_spectrum(&r);
        }
    }
}
