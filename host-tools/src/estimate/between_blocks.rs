//! How far a parameter's value differs from stretch to stretch, or from log to log, beyond what noise explains.
//!
//! A model that lacks something has other values for slow motion than for fast, for one gain of the controller than for another. Each fold (an
//! eighth of a log, or one of several logs) is fitted on its own, to first order about the common fit: δ_f = −(A_fᵀA_f + Λ)⁻¹ g_f with
//! A_f its rows, g_f half its gradient and Λ the prior's information. If the δ_f of a parameter differ by more than their errors w_f^(−1/2) allow,
//! what is left is the variance of the values themselves: τ² = (Q − (k − 1)) / (Σw − Σw²/Σw), Q = Σ w (δ − δ̄)², which is χ² of k − 1 degrees of
//! freedom where they are the same (Cochran 1954; DerSimonian & Laird 1986, eq. 7). It is what another log's value may be off by, and no
//! number of samples makes it smaller.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::bounded::{Problem, Solution, inverse, triangle};
use super::deviation::{BlockScore, Deviations};
use crate::equation::folds::Blocks;
use crate::robust;

/// How improbable it must be that noise alone makes the folds differ so: of a hundred parameters that do not, one is said to.
const CHANCE: f64 = 0.01;

/// A limb's folds, each fitted on its own.
pub(crate) struct Spread {
    /// By how much each fold would move all parameters.
    moved: Vec<DVector<f64>>,
    /// Roots of their covariance if residuals are independent.
    roots: Vec<DMatrix<f64>>,
    /// How much larger errors are, for residuals that remember: the usual ratio of the two deviations of all parameters.
    memory: f64,
}

impl Spread {
    /// Of a problem at its solution, with these deviations: each block of time with its score.
    pub(crate) fn of(
        (problem, solution): (&Problem, &Solution),
        blocks: &Blocks,
        scores: impl Iterator<Item = (usize, BlockScore)>,
        deviations: &Deviations,
    ) -> Self {
        let prior = problem.prior_information(&solution.theta);
        let n = solution.theta.len();
        let mut folds = vec![(prior, DVector::zeros(n)); blocks.folds];
        for (block, score) in scores {
            let (rows, gradient) = &mut folds[blocks.fold(block)];
            let before = rows.nrows();
            *rows = std::mem::replace(rows, DMatrix::zeros(0, 0))
                .resize_vertically(before + score.rows.nrows(), 0.0);
            rows.rows_mut(before, score.rows.nrows())
                .copy_from(&score.rows);
            *gradient += &score.gradient;
        }
        let folds = folds
            .into_iter()
            .filter(|(_, gradient)| gradient.amax() > 0.0);
        let (mut moved, mut roots) = (Vec::new(), Vec::new());
        for (rows, gradient) in folds {
            let root = inverse(&triangle(rows));
            moved.push(-(&root * root.tr_mul(&gradient)));
            roots.push(root);
        }
        let ratios = (0..n)
            .map(|k| deviations.of_parameter(k))
            .map(|[independent, blocks]| blocks / independent)
            .filter(|ratio| ratio.is_finite());
        let memory = robust::median(ratios).unwrap_or(1.0);
        Self {
            moved,
            roots,
            memory: memory.max(1.0),
        }
    }

    /// Standard deviation of a combination's value between folds; 0 where noise explains their differences.
    pub(crate) fn of_combination(&self, combination: &DVector<f64>) -> f64 {
        let of = |(moved, root): (&DVector<f64>, &DMatrix<f64>)| {
            let std = self.memory * root.tr_mul(combination).norm();
            (moved.dot(combination), std.powi(-2))
        };
        let told: Vec<(f64, f64)> = self.moved.iter().zip(&self.roots).map(of).collect();
        between(&told).sqrt()
    }

    /// The same of parameter k.
    pub(crate) fn of_parameter(&self, k: usize) -> f64 {
        let n = self.moved.first().map_or(0, DVector::len);
        let mut own = DVector::zeros(n);
        if k < n {
            own[k] = 1.0;
        }
        self.of_combination(&own)
    }
}

/// The variance τ² of values that are told with errors, each (value, 1 / variance of its error); 0 where they differ by no more than chance.
fn between(told: &[(f64, f64)]) -> f64 {
    let told = || {
        told.iter()
            .filter(|(_, weight)| weight.is_finite() && *weight > 0.0)
    };
    let freedom = told().count() as f64 - 1.0;
    let sum: f64 = told().map(|(_, w)| w).sum();
    let mean = told().map(|(x, w)| x * w).sum::<f64>() / sum;
    let q: f64 = told().map(|(x, w)| w * (x - mean).powi(2)).sum();
    let Ok(chance) = ChiSquared::new(freedom) else {
        return 0.0;
    };
    if 1.0 - chance.cdf(q) > CHANCE {
        return 0.0;
    }
    let squares: f64 = told().map(|(_, w)| w * w).sum();
    (q - freedom) / (sum - squares / sum)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// Eight stretches, told with errors of unlike size, whose values differ by `spread`: the mean of τ², and how often it is none.
    fn of(spread: f64) -> (f64, f64) {
        const TRIALS: usize = 4_000;
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let (mut sum, mut none) = (0.0, 0.0);
        for _ in 0..TRIALS {
            let told: Vec<(f64, f64)> = (1..=8)
                .map(|k| {
                    let std = 0.3 * f64::from(k);
                    (spread * normal() + std * normal(), std.powi(-2))
                })
                .collect();
            let found = between(&told);
            sum += found;
            none += f64::from(u8::from(found == 0.0));
        }
        (sum / TRIALS as f64, none / TRIALS as f64)
    }

    #[test]
    fn the_spread_of_values_is_told_and_none_where_there_is_none() {
        let (_, none) = of(0.0);
        assert!((none - 0.99).abs() < 0.005, "{none}");
        let (square, none) = of(6.0);
        assert!((square / 36.0 - 1.0).abs() < 0.05, "{square}");
        assert!(none < 0.01, "{none}");
    }
}
