//! The linear algebra of a fit: rows and triangles under priors, steps, and covariances by leaving out.

use nalgebra::{DMatrix, DVector};
use proprio_solve::bounded::{inverse, triangle};

use super::layout::Layout;

/// The longest step of a logarithm.
const LONGEST_STEP: f64 = 1.0;

/// Covariance by fits that leave out the factors of each owner in turn, to first order (Efron 1982, delete-a-group jackknife).
pub(super) fn jackknife(
    factors: &[DMatrix<f64>],
    owners: &[usize],
    prior: &DMatrix<f64>,
) -> DMatrix<f64> {
    let n = prior.ncols() - 1;
    let count = owners.iter().max().map_or(0, |last| last + 1);
    let mut spread = DMatrix::zeros(n, n);
    for left_out in 0..count {
        let others = factors
            .iter()
            .zip(owners)
            .filter(|(_, owner)| **owner != left_out);
        let step = damped(&stacked(others.map(|(factor, _)| factor), prior), 0.0);
        spread += &step * step.transpose() * ((count as f64 - 1.0) / count as f64);
    }
    // Of few groups the spread itself is uncertain: the variance of Student's t of as many degrees of freedom.
    let freedom = count as f64 - 1.0;
    if freedom > 2.0 {
        spread *= freedom / (freedom - 2.0);
    }
    spread
}

/// A covariance whose standard deviations are made as large as those of another one, where that has larger ones.
pub(super) fn larger(mut covariance: DMatrix<f64>, other: &DMatrix<f64>) -> DMatrix<f64> {
    let n = covariance.nrows();
    let factor = |k: usize| {
        let ratio = other[(k, k)] / covariance[(k, k)].max(1e-300);
        ratio.max(1.0).sqrt()
    };
    let factors: Vec<f64> = (0..n).map(factor).collect();
    for i in 0..n {
        for j in 0..n {
            covariance[(i, j)] *= factors[i] * factors[j];
        }
    }
    covariance
}

/// The priors as rows: (x − mean)/std is nothing.
pub(super) fn prior_rows(layout: &Layout, x: &[f64]) -> DMatrix<f64> {
    let n = layout.unknowns.len();
    let known: Vec<(usize, (f64, f64))> = (layout.priors.iter().enumerate())
        .filter_map(|(k, prior)| prior.map(|p| (k, p)))
        .collect();
    let mut rows = DMatrix::zeros(known.len(), n + 1);
    for (row, (k, (mean, std))) in known.into_iter().enumerate() {
        rows[(row, k)] = 1.0 / std;
        rows[(row, n)] = (mean - x[k]) / std;
    }
    rows
}

/// How far the priors' own errors move the estimates, a column each: C R_pᵀ, and where a prior is too sure so many times that. What no scatter shows.
pub(super) fn moved_by_priors(
    layout: &Layout,
    posterior: &DMatrix<f64>,
    prior: &DMatrix<f64>,
) -> DMatrix<f64> {
    let n = layout.unknowns.len();
    let mut rows = prior.view((0, 0), (prior.nrows(), n)).into_owned();
    let own = layout.priors.iter().zip(&layout.doubts);
    let doubts = own.filter_map(|(prior, doubt)| prior.map(|_| *doubt));
    for (mut row, doubt) in rows.row_iter_mut().zip(doubts) {
        row *= doubt;
    }
    posterior * rows.transpose()
}

/// The triangle of all rows.
pub(super) fn stacked<'a>(
    parts: impl Iterator<Item = &'a DMatrix<f64>>,
    prior: &'a DMatrix<f64>,
) -> DMatrix<f64> {
    let columns = prior.ncols();
    let parts: Vec<&DMatrix<f64>> = parts.chain([prior]).collect();
    let count: usize = parts.iter().map(|p| p.nrows()).sum();
    let mut all = DMatrix::zeros(count, columns);
    let mut at = 0;
    for part in parts {
        all.view_mut((at, 0), (part.nrows(), columns))
            .copy_from(part);
        at += part.nrows();
    }
    triangle(all)
}

/// The step of min ‖R s − z‖² + damping ‖D s‖², D the columns' sizes; each entry no longer than a logarithm may move.
pub(super) fn damped(factor: &DMatrix<f64>, damping: f64) -> DVector<f64> {
    let n = factor.ncols() - 1;
    let mut rows = DMatrix::zeros(n, n + 1);
    for k in 0..n {
        // What the data do not see is held where it is.
        let size = factor.view((0, k), (n, 1)).norm().max(1e-6);
        rows[(k, k)] = (damping.max(1e-12)).sqrt() * size;
    }
    let whole = stacked(std::iter::once(factor), &rows);
    let r = whole.view((0, 0), (n, n)).into_owned();
    let step = inverse(&r) * whole.view((0, n), (n, 1)).column(0);
    step.map(|s| s.clamp(-LONGEST_STEP, LONGEST_STEP))
}
