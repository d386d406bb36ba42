//! One factor of all rows answers for every pose left out: the fit without it, and its error.
//!
//! With the triangle R of the stacked rows [W; 1] (the ones are priors, which parameters are scaled by) the columns of Q = W R⁻¹ are
//! orthonormal together with R⁻¹, and the residual of pose g by a fit without it is (1 − Q_g Q_gᵀ)⁻¹ r_g (Cook & Weisberg 1982, *Residuals and
//! Influence in Regression*, §2.2). A further column, orthogonalised against Q, makes Q wider: so every candidate is judged by its held-out
//! error without a new factorisation. WᵀW is never formed.

use nalgebra::{DMatrix, DVector};
use proprio_solve::bounded::{inverse, triangle};

use super::columns::Rows;

/// A least-squares solution under priors, and what it leaves.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    /// Steps, in units of the priors.
    pub(super) step: DVector<f64>,
    /// W R⁻¹.
    pub(super) q: DMatrix<f64>,
    /// R⁻¹: the parameters' covariance is R⁻¹ R⁻ᵀ for independent rows of unit noise.
    pub(super) inverse: DMatrix<f64>,
    /// What the rows leave, in units of the noise.
    pub(super) left: DVector<f64>,
    /// What the priors leave.
    prior_left: DVector<f64>,
}

/// Errors of each pose by fits without it, in units of the noise; as many as there are rows.
pub(super) type HeldOut = DVector<f64>;

/// Solves min ‖W x − b‖² + ‖x − x₀‖², where x₀ are the priors' means less the present values.
pub(super) fn solve(rows: &Rows, prior: &DVector<f64>) -> Solved {
    let (n, p) = rows.w.shape();
    let mut stacked = DMatrix::zeros(n + p, p + 1);
    stacked.view_mut((0, 0), (n, p)).copy_from(&rows.w);
    stacked.view_mut((0, p), (n, 1)).copy_from(&rows.b);
    stacked.view_mut((n, 0), (p, p)).fill_with_identity();
    stacked.view_mut((n, p), (p, 1)).copy_from(prior);
    let factor = triangle(stacked);
    let r = factor.view((0, 0), (p, p)).into_owned();
    let inverse = inverse(&r);
    let step: DVector<f64> = &inverse * factor.view((0, p), (p, 1)).column(0);
    Solved {
        q: &rows.w * &inverse,
        left: &rows.b - &rows.w * &step,
        prior_left: prior - &step,
        step,
        inverse,
    }
}

impl Solved {
    /// Held-out errors.
    pub(super) fn held_out(&self, rows: &Rows) -> HeldOut {
        self.held_out_with(rows, None)
    }

    /// Held-out errors with further columns (scaled by prior and noise, means zero).
    pub(super) fn held_out_with(&self, rows: &Rows, more: Option<&DMatrix<f64>>) -> HeldOut {
        let more = more.map(|columns| self.beside(columns));
        let mut left = self.left.clone();
        if let Some((top, below)) = &more {
            let taken = top.tr_mul(&self.left) + below.tr_mul(&self.prior_left);
            left -= top * taken;
        }
        let mut errors = DVector::zeros(left.len());
        for (_, range) in &rows.poses {
            let (start, len) = (range.start, range.len());
            let q = self.q.rows(start, len);
            let mut kept = DMatrix::identity(len, len) - q * q.transpose();
            if let Some((top, _)) = &more {
                let u = top.rows(start, len);
                kept -= u * u.transpose();
            }
            let own = left.rows(start, len).into_owned();
            // A pose that nothing else determines has no held-out error: its residual counts, which its own fit made small.
            let error = kept.lu().solve(&own).unwrap_or(own);
            errors.rows_mut(start, len).copy_from(&error);
        }
        errors
    }

    /// The steps of further columns beside all others, in units of their priors.
    pub(super) fn further_steps(&self, rows: &Rows, columns: &DMatrix<f64>) -> DVector<f64> {
        let (n, m) = columns.shape();
        let p = self.inverse.nrows();
        let mut w = DMatrix::zeros(n, p + m);
        w.view_mut((0, 0), (n, p)).copy_from(&rows.w);
        w.view_mut((0, p), (n, m)).copy_from(columns);
        let mut prior = DVector::zeros(p + m);
        prior
            .rows_mut(0, p)
            .copy_from(&(&self.prior_left + &self.step));
        let all = Rows {
            w,
            poses: Vec::new(),
            ..rows.clone()
        };
        solve(&all, &prior).step.rows(p, m).into_owned()
    }

    /// The columns orthonormal to Q (and to each other) that span more columns with it, and their part below the rows, at the old priors.
    fn beside(&self, columns: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
        let (n, m) = columns.shape();
        let p = self.inverse.nrows();
        let along = self.q.tr_mul(columns);
        let mut stacked = DMatrix::zeros(n + p + m, m);
        stacked
            .view_mut((0, 0), (n, m))
            .copy_from(&(columns - &self.q * &along));
        stacked
            .view_mut((n, 0), (p, m))
            .copy_from(&(-(&self.inverse * &along)));
        stacked.view_mut((n + p, 0), (m, m)).fill_with_identity();
        let scale = inverse(&triangle(stacked.clone()));
        let orthonormal = stacked * scale;
        (
            orthonormal.rows(0, n).into_owned(),
            orthonormal.rows(n, p).into_owned(),
        )
    }

    /// Standard deviations of the steps, in units of the priors: what the data leave by the scatter of held-out errors over poses (the
    /// jackknife, Efron 1982; CR3 of Bell & McCaffrey 2002), and what the priors leave. Where model and poses agree it is the usual one;
    /// what the model lacks makes it larger.
    pub(super) fn std_by_scatter(&self, rows: &Rows, held_out: &HeldOut) -> DVector<f64> {
        let p = self.inverse.nrows();
        let mut variance = DVector::zeros(p);
        for (_, range) in &rows.poses {
            let q = self.q.rows(range.start, range.len());
            // A⁻¹ W_gᵀ e_g with A⁻¹ = R⁻¹ R⁻ᵀ.
            let pull = &self.inverse * q.tr_mul(&held_out.rows(range.start, range.len()));
            variance += pull.component_mul(&pull);
        }
        let by_prior = &self.inverse * self.inverse.transpose();
        for k in 0..p {
            variance[k] += by_prior.row(k).norm_squared();
            // Never less than independent rows would have it.
            variance[k] = f64::max(variance[k], self.inverse.row(k).norm_squared());
        }
        variance.map(f64::sqrt)
    }
}

/// Sums of squares by pose.
pub(super) fn by_pose(rows: &Rows, errors: &HeldOut) -> Vec<f64> {
    (rows.poses.iter())
        .map(|(_, range)| errors.rows(range.start, range.len()).norm_squared())
        .collect()
}

/// Root mean square distance of places, m.
pub(super) fn place_rms(rows: &Rows, errors: &HeldOut) -> f64 {
    let places = (0..errors.len()).filter(|&k| rows.is_place[k]);
    let squares: f64 = places
        .clone()
        .map(|k| (errors[k] * rows.unit[k]).powi(2))
        .sum();
    (3.0 * squares / places.count().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of random-like numbers: `poses` poses of three rows.
    fn example(poses: usize, parameters: usize) -> Rows {
        let count = 3 * poses;
        let number = |k: usize| ((k * k * 7919 + k * 104_729) % 1009) as f64 / 504.5 - 1.0;
        Rows {
            w: DMatrix::from_fn(count, parameters, |r, c| {
                5.0 * number(r * parameters + c + 1)
            }),
            b: DVector::from_fn(count, |r, _| number(r + 17)),
            unit: vec![1.0; count],
            is_place: vec![true; count],
            target: vec![0; count],
            poses: (0..poses).map(|p| (p, 3 * p..3 * p + 3)).collect(),
        }
    }

    /// The same rows without a pose.
    fn without(rows: &Rows, pose: usize) -> Rows {
        let keep: Vec<usize> = (0..rows.b.len()).filter(|r| r / 3 != pose).collect();
        Rows {
            w: rows.w.select_rows(&keep),
            b: rows.b.select_rows(&keep),
            unit: vec![1.0; keep.len()],
            is_place: vec![true; keep.len()],
            target: vec![0; keep.len()],
            poses: Vec::new(),
        }
    }

    #[test]
    fn a_held_out_error_is_that_of_a_fit_without_the_pose() {
        let rows = example(8, 7);
        let prior = DVector::from_element(7, 0.1);
        let held_out = solve(&rows, &prior).held_out(&rows);
        for pose in 0..8 {
            let fit = solve(&without(&rows, pose), &prior);
            let error = rows.b.rows(3 * pose, 3) - rows.w.rows(3 * pose, 3) * fit.step;
            let difference = (error - held_out.rows(3 * pose, 3)).norm();
            assert!(difference < 1e-10, "pose {pose}: {difference}");
        }
    }

    #[test]
    fn a_further_column_is_as_if_it_had_been_there() {
        let rows = example(8, 7);
        let few = Rows {
            w: rows.w.columns(0, 5).into_owned(),
            ..rows.clone()
        };
        let mut prior = DVector::from_element(7, 0.1);
        prior[5] = 0.0;
        prior[6] = 0.0;
        let whole = solve(&rows, &prior).held_out(&rows);
        let less = solve(&few, &prior.rows(0, 5).into_owned());
        let more = rows.w.columns(5, 2).into_owned();
        let added = less.held_out_with(&few, Some(&more));
        assert!((whole - added).norm() < 1e-10);
    }
}
