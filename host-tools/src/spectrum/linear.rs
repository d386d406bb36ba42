//! The linear algebra of a fit: rows and triangles under priors, steps, and covariances by leaving out.

use nalgebra::{DMatrix, DVector};

use super::layout::Layout;
use crate::estimate::factor::{BATCH, HeapFactor};

/// The longest step of a logarithm.
const LONGEST_STEP: f64 = 1.0;

/// Folds rows that lie one after the other, each with its right-hand side, into a factor; they are used up.
pub(super) fn fold(factor: &mut HeapFactor, rows: &mut [f64]) {
    let width = factor.columns() + 1;
    (rows.chunks_mut(BATCH * width)).for_each(|batch| factor.fold(batch));
}

/// Steps of the fits that leave out each of the factors in turn, to first order.
pub(super) fn without_each(factors: &[HeapFactor], prior: &HeapFactor) -> Vec<DVector<f64>> {
    // The prior and all that come behind each one, the last one's first; what comes before it grows on the way. So a factor is merged some times, and not
    // once for each other one.
    let mut behind = vec![prior.clone()];
    for factor in factors.iter().skip(1).rev() {
        let next = behind.last().map(|last| stacked([last, factor]));
        behind.extend(next);
    }
    let mut before = HeapFactor::new(prior.columns());
    let step = |(own, behind): (&HeapFactor, &HeapFactor)| {
        let step = damped(&stacked([behind, &before]), 0.0);
        before.merge(own);
        step
    };
    factors.iter().zip(behind.iter().rev()).map(step).collect()
}

/// The factors of each owner merged; owners are numbered from 0, and each has one.
pub(super) fn by_owner(factors: &[(usize, HeapFactor)]) -> Vec<HeapFactor> {
    let mut all: Vec<HeapFactor> = Vec::new();
    for (owner, factor) in factors {
        match all.get_mut(*owner) {
            Some(own) => own.merge(factor),
            None => all.push(factor.clone()),
        }
    }
    all
}

/// Covariance by the steps of fits that leave out one group each (Efron 1982, delete-a-group jackknife).
pub(super) fn jackknife(steps: &[DVector<f64>]) -> DMatrix<f64> {
    let n = steps.first().map_or(0, |step| step.len());
    let count = steps.len() as f64;
    let mut spread = DMatrix::zeros(n, n);
    for step in steps {
        spread += step * step.transpose() * ((count - 1.0) / count);
    }
    // Of few groups the spread itself is uncertain: the variance of Student's t of as many degrees of freedom.
    let freedom = count - 1.0;
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

/// The same folded.
pub(super) fn prior_factor(layout: &Layout, x: &[f64]) -> HeapFactor {
    let mut factor = HeapFactor::new(x.len());
    // A row of the matrix is a column of its transpose, whose numbers lie one after the other.
    fold(
        &mut factor,
        prior_rows(layout, x).transpose().as_mut_slice(),
    );
    factor
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

/// The factor of all rows of some factors of the same columns.
pub(super) fn stacked<'a>(parts: impl IntoIterator<Item = &'a HeapFactor>) -> HeapFactor {
    let mut parts = parts.into_iter();
    let mut whole = parts.next().map_or(HeapFactor::new(0), Clone::clone);
    parts.for_each(|part| whole.merge(part));
    whole
}

/// The step of min ‖R s − z‖² + damping ‖D s‖², D the columns' sizes; each entry no longer than a logarithm may move.
pub(super) fn damped(factor: &HeapFactor, damping: f64) -> DVector<f64> {
    let n = factor.columns();
    let mut squares = vec![0.0; n];
    for k in 0..n {
        for (square, x) in squares[k..].iter_mut().zip(factor.row(k)) {
            *square += x * x;
        }
    }
    let mut rows = vec![0.0; n * (n + 1)];
    for (k, square) in squares.iter().enumerate() {
        // What the data do not see is held where it is.
        let size = square.sqrt().max(1e-6);
        rows[k * (n + 1) + k] = damping.max(1e-12).sqrt() * size;
    }
    let mut whole = factor.clone();
    whole.reflect(&mut rows, &|k| k + 1);
    let mut step = vec![0.0; n];
    whole.solve_before(n, &mut step);
    DVector::from_vec(step).map(|s| s.clamp(-LONGEST_STEP, LONGEST_STEP))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What merging from both ends leaves out is what merging all others leaves out.
    #[test]
    fn each_one_is_left_out_alone() {
        const COLUMNS: usize = 3;
        let number = |k: usize| (1.7 * (k * k) as f64).sin();
        let factor = |n: usize| {
            let mut rows: Vec<f64> = (0..5 * (COLUMNS + 1)).map(|k| number(40 * n + k)).collect();
            let mut factor = HeapFactor::new(COLUMNS);
            fold(&mut factor, &mut rows);
            factor
        };
        let factors: Vec<HeapFactor> = (0..6).map(factor).collect();
        let prior = factor(9);
        let steps = without_each(&factors, &prior);
        assert_eq!(steps.len(), factors.len());
        for (n, step) in steps.iter().enumerate() {
            let others = factors.iter().enumerate().filter(|(k, _)| *k != n);
            let others = others.map(|(_, factor)| factor).chain([&prior]);
            let exact = damped(&stacked(others), 0.0);
            assert!(
                (step - &exact).norm() < 1e-12 * exact.norm(),
                "{n}: {step} {exact}"
            );
            let all = damped(&stacked(factors.iter().chain([&prior])), 0.0);
            assert!((step - all).norm() > 1e-3 * exact.norm(), "{n}");
        }
    }
}
