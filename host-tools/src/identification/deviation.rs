//! Standard deviations that hold where residuals are not independent.
//!
//! With H half the Hessian of the cost and S the covariance of the data's half gradient, the estimate's covariance is
//! H⁻¹ (S + Λ) H⁻¹, Λ the prior's information (the sandwich of Huber 1967; White 1980). If residuals are independent, S is
//! the data's information and the sandwich is H⁻¹. If they remember, S is told by the spread of the gradient over blocks of
//! time longer than the memory (clustered errors: Liang & Zeger 1986).

use nalgebra::{DMatrix, DVector};

use super::limb::LimbFit;
use super::physical::inverse;

/// Standard deviations of a limb's parameters.
#[derive(Debug, Clone)]
pub(crate) struct Deviations {
    /// If residuals are independent.
    pub(crate) independent: DVector<f64>,
    /// By the spread over blocks.
    pub(crate) blocks: DVector<f64>,
}

impl Deviations {
    pub(crate) fn of(fit: &LimbFit) -> Self {
        let inverse = inverse(&fit.solution.factor);
        let prior = fit.problem.prior_information(&fit.solution.theta);
        Self {
            independent: row_norms(&inverse),
            blocks: sandwich(&inverse, &fit.scores(), &prior),
        }
    }

    /// The larger of the two.
    pub(crate) fn larger(&self) -> DVector<f64> {
        self.independent.zip_map(&self.blocks, f64::max)
    }
}

/// Standard deviations from R⁻¹, each block's half gradient and the prior's rows.
pub(crate) fn sandwich(
    inverse: &DMatrix<f64>,
    scores: &[DVector<f64>],
    prior: &DMatrix<f64>,
) -> DVector<f64> {
    let count = scores.len() as f64;
    if scores.len() < 2 {
        return row_norms(inverse);
    }
    let mean = scores.iter().fold(DVector::zeros(inverse.nrows()), |sum, s| sum + s) / count;
    let mut squares = DVector::zeros(inverse.nrows());
    for score in scores {
        let moved: DVector<f64> = inverse * inverse.tr_mul(&(score - &mean));
        squares += moved.component_mul(&moved) * (count / (count - 1.0));
    }
    let prior = inverse * inverse.tr_mul(&prior.transpose());
    let by_prior = row_norms(&prior);
    squares += by_prior.component_mul(&by_prior);
    squares.map(f64::sqrt)
}

fn row_norms(matrix: &DMatrix<f64>) -> DVector<f64> {
    DVector::from_fn(matrix.nrows(), |k, _| matrix.row(k).norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::physical::triangle;
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
        let std = sandwich(&inverse(&factor), &scores, &DMatrix::zeros(0, 1))[0];
        let long_run = 1.0 / (1.0 - memory);
        let expected = long_run / n.sqrt();
        assert!((std / expected - 1.0).abs() < 0.15, "{std} {expected}");
        assert!(std > 3.0 * row_norms(&inverse(&factor))[0]);
    }
}
