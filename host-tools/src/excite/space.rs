//! Which parameters a design is about, in which units.
//!
//! A limb's torque is linear in ten parameters per body and one per effect column; only r combinations of them can be told by
//! any motion (a pinned leg's inertias: 17 of 30). A scale matrix takes those r, in units in which the prior is a unit one, to
//! all of them: rows times it are what a cost sees, with r columns and no structural zeros.
//!
//! Two units are of use. By the *whole prior*, bodies as the CAD has them within its uncertainty: what a motion tells beyond
//! what is known. And, for the condition number, by *kind*: one standard deviation for all masses of the limb, one for all
//! first moments, one for all inertias, each the largest that the prior states of a body. A number for each kind compares
//! motions as the literature does, which takes kg, kg m and kg m², and yet does not hang on the choice of these units; a
//! number for each body would count how little a light body matters, which no motion changes.

use nalgebra::{DMatrix, DVector};
use proprio_core::inertia::{INERTIAL, InertialParameters};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::columns::Column;
use super::limb::{Instant, Limb};
use super::spectrum::spectrum;

/// Random states from which the structure is found: several times as many rows as columns.
const STATES: usize = 200;
/// Their greatest position (rad), velocity (rad/s) and acceleration (rad/s²): gravity, centrifugal and inertial forces alike.
const STATE: [f64; 3] = [3.0, 5.0, 25.0];
/// Share of the largest singular value below which a combination is structurally absent. URDFs that round π/2 to 1.5708 make
/// some of 3e-6; scaled to unit length, columns that are there by such rounding alone would look like any other.
const ABSENT: f64 = 1e-5;

/// The identifiable parameters.
#[derive(Debug, Clone)]
pub(super) struct Space {
    /// From the r scaled parameters to all of them.
    pub(super) scale: DMatrix<f64>,
}

impl Space {
    /// The identifiable part of a limb's inertias with these effects, `root` being a square root of the prior's covariance.
    ///
    /// `theta` is the limb's inertias, which friction by load needs.
    pub(super) fn new(
        limb: &dyn Limb,
        theta: &[f64],
        columns: &[Column],
        root: &DMatrix<f64>,
    ) -> Self {
        let rows = random_rows(limb, theta, columns);
        let rank = rank(&rows);
        let scaled = (rows * root).qr().unpack_r();
        let all = scaled.ncols();
        let (values, v) =
            spectrum(&scaled).unwrap_or_else(|| (DVector::zeros(all), DMatrix::identity(all, all)));
        let mut order: Vec<usize> = (0..all).collect();
        order.sort_by(|&a, &b| values[b].total_cmp(&values[a]));
        let directions: Vec<_> = order[..rank].iter().map(|&n| v.column(n)).collect();
        Self {
            scale: root * DMatrix::from_columns(&directions),
        }
    }

    pub(super) fn rank(&self) -> usize {
        self.scale.ncols()
    }
}

/// Torque rows of random states.
fn random_rows(limb: &dyn Limb, theta: &[f64], columns: &[Column]) -> DMatrix<f64> {
    let (n, p) = (limb.joints(), INERTIAL * limb.joints());
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut rows = DMatrix::zeros(n * STATES, p + columns.len());
    let mut w = vec![0.0; n * p];
    for s in 0..STATES {
        let mut at = Instant::zero(n);
        for (part, most) in [&mut at.q, &mut at.dq, &mut at.ddq].into_iter().zip(STATE) {
            part.iter_mut()
                .for_each(|x| *x = random.random_range(-most..most));
        }
        limb.regressor(&at, &mut w);
        for c in 0..n {
            let row = &w[p * c..p * (c + 1)];
            let torque: f64 = row.iter().zip(theta).map(|(w, theta)| w * theta).sum();
            for (k, w) in row.iter().enumerate() {
                rows[(n * s + c, k)] = *w;
            }
            for (e, column) in columns.iter().enumerate().filter(|(_, e)| e.joint == c) {
                rows[(n * s + c, p + e)] =
                    column.term([at.q[c], at.dq[c], at.ddq[c]], torque).value;
            }
        }
    }
    rows
}

/// How many combinations of columns are there at all.
fn rank(rows: &DMatrix<f64>) -> usize {
    let Some((values, _)) = spectrum(&rows.clone().qr().unpack_r()) else {
        return 0;
    };
    let most = values.max();
    values.iter().filter(|s| **s > ABSENT * most).count()
}

/// A square root of the prior's covariance: the bodies' blocks by the CAD's uncertainties, then the effects' standard deviations.
pub(super) fn whole_prior(
    bodies: &[(InertialParameters<f64>, f64)],
    effects: &[f64],
) -> Option<DMatrix<f64>> {
    let p = INERTIAL * bodies.len();
    let mut root = DMatrix::zeros(p + effects.len(), p + effects.len());
    for (b, (body, relative)) in bodies.iter().enumerate() {
        let factor = body.prior(*relative)?;
        let triangle = DMatrix::from_fn(INERTIAL, INERTIAL, |i, j| {
            if j >= i { factor.row(i)[j - i] } else { 0.0 }
        });
        let inverse = triangle.try_inverse()?;
        root.view_mut((INERTIAL * b, INERTIAL * b), (INERTIAL, INERTIAL))
            .copy_from(&inverse);
    }
    for (e, std) in effects.iter().enumerate() {
        root[(p + e, p + e)] = *std;
    }
    Some(root)
}

/// One standard deviation for each kind of inertial parameter, the largest of the whole prior's `root`, and no effects.
pub(super) fn by_kind(root: &DMatrix<f64>, bodies: usize) -> DMatrix<f64> {
    let kind = |k: usize| match k % INERTIAL {
        0 => 0,
        1..=3 => 1,
        _ => 2,
    };
    let mut most = [0.0f64; 3];
    for k in 0..INERTIAL * bodies {
        most[kind(k)] = most[kind(k)].max(root.row(k).norm());
    }
    DMatrix::from_diagonal(&DVector::from_fn(INERTIAL * bodies, |k, _| most[kind(k)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_rounding_makes_of_an_axis_is_no_parameter() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut rows = DMatrix::from_fn(60, 5, |_, _| random.random_range(-1.0..1.0));
        // Two columns that are combinations of others but for 3e-6 of them, and one that is nothing but that.
        let small = DMatrix::from_fn(60, 3, |_, _| random.random_range(-3e-6..3e-6));
        let sum = rows.column(0) + rows.column(1) + small.column(0);
        rows.set_column(2, &sum);
        let double = rows.column(0) * 2.0 + small.column(1);
        rows.set_column(3, &double);
        rows.set_column(4, &small.column(2));
        assert_eq!(rank(&rows), 2);
    }
}
