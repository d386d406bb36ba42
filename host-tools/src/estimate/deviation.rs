//! Standard deviations that hold where residuals are not independent.
//!
//! With H half the Hessian of the cost and S the covariance of the data's half gradient, the estimate's covariance is
//! H⁻¹ (S + Λ) H⁻¹, Λ the prior's information (the sandwich of Huber 1967; White 1980). If residuals are independent, S is
//! the data's information and the sandwich is H⁻¹. If they remember, S is told by the spread of the gradient over blocks of
//! time longer than the memory (clustered errors: Liang & Zeger 1986).

use nalgebra::{DMatrix, DVector};

use super::bounded::inverse;
use super::fit::LimbFit;

/// Roots of a limb's covariance: matrices S with covariance S Sᵀ.
#[derive(Debug, Clone)]
pub(crate) struct Deviations {
    /// If residuals are independent.
    independent: DMatrix<f64>,
    /// By the spread over blocks.
    blocks: DMatrix<f64>,
}

impl Deviations {
    pub(crate) fn of(fit: &LimbFit) -> Self {
        let independent = inverse(&fit.solution.factor);
        let prior = fit.problem.prior_information(&fit.solution.theta);
        let blocks = sandwich(&independent, &fit.scores(), &prior);
        Self {
            independent,
            blocks,
        }
    }

    /// Standard deviations of parameter k if residuals are independent, and by the spread over blocks.
    pub(crate) fn of_parameter(&self, k: usize) -> [f64; 2] {
        [&self.independent, &self.blocks].map(|root| root.row(k).norm())
    }

    /// The same of a combination of all parameters.
    pub(crate) fn of_combination(&self, combination: &DVector<f64>) -> [f64; 2] {
        [&self.independent, &self.blocks].map(|root| root.tr_mul(combination).norm())
    }
}

/// A root of the covariance from R⁻¹, each block's half gradient and the prior's rows.
pub(crate) fn sandwich(
    inverse: &DMatrix<f64>,
    scores: &[DVector<f64>],
    prior: &DMatrix<f64>,
) -> DMatrix<f64> {
    let count = scores.len() as f64;
    if scores.len() < 2 {
        return inverse.clone();
    }
    let n = inverse.nrows();
    let mean = scores.iter().fold(DVector::zeros(n), |sum, s| sum + s) / count;
    let mut root = DMatrix::zeros(n, scores.len() + prior.nrows());
    for (k, score) in scores.iter().enumerate() {
        let moved = (score - &mean) * (count / (count - 1.0)).sqrt();
        root.set_column(k, &moved);
    }
    root.columns_mut(scores.len(), prior.nrows())
        .copy_from(&prior.transpose());
    inverse * inverse.tr_mul(&root)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::bounded::triangle;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    /// The spread of a mean of first-order autoregressive noise, against the closed form of its long-run variance.
    #[test]
    fn blocks_tell_the_spread_of_a_mean_of_noise_that_remembers() {
        const BLOCKS: usize = 200;
        const LENGTH: usize = 200;
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let (memory, mut noise) = (0.8, 0.0);
        let n = (BLOCKS * LENGTH) as f64;
        let mut scores = Vec::new();
        for _ in 0..BLOCKS {
            let mut sum = 0.0;
            for _ in 0..LENGTH {
                let white: f64 = StandardNormal.sample(&mut random);
                noise = memory * noise + white;
                sum += noise;
            }
            scores.push(DVector::from_element(1, sum));
        }
        let factor = triangle(DMatrix::from_element(1, 1, n.sqrt()));
        let std = sandwich(&inverse(&factor), &scores, &DMatrix::zeros(0, 1)).norm();
        let long_run = 1.0 / (1.0 - memory);
        let expected = long_run / n.sqrt();
        assert!((std / expected - 1.0).abs() < 0.15, "{std} {expected}");
        assert!(std > 3.0 * inverse(&factor)[(0, 0)].abs());
    }
}
