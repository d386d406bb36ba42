//! Standard deviations that hold where residuals are not independent.
//!
//! With H half the Hessian of the cost and S the covariance of the data's half gradient, the estimate's covariance is
//! H⁻¹ (S + Λ) H⁻¹, Λ the prior's information (the sandwich of Huber 1967; White 1980). If residuals are independent, S is
//! the data's information and the sandwich is H⁻¹. If they remember, S is told by the spread of the gradient over blocks of
//! time longer than the memory (clustered errors: Liang & Zeger 1986).
//!
//! The fit bends towards each block, the more the fewer there are and the more one of them tells alone, so that gradients at the
//! solution are too small. Each is taken at the solution without its own block instead: the jackknife over blocks (Bell &
//! McCaffrey 2002; MacKinnon, Nielsen & Webb 2023, CV3), which is (I − A_b H⁻¹)⁻¹ times the gradient, A_b the block's information.

use crate::parallel::side_by_side;
use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::bounded::{Problem, Solution, inverse};

/// The least share of a direction's information that is taken to be outside a block: below it, rounding.
const LEAST_REST: f64 = 1e-9;
/// What two standard deviations leave to either side is beyond this.
const COVERED: f64 = 0.975;

/// Roots of a limb's covariance: matrices S with covariance S Sᵀ.
#[derive(Debug, Clone)]
pub(crate) struct Deviations {
    /// If residuals are independent.
    independent: DMatrix<f64>,
    /// By the spread over blocks.
    blocks: DMatrix<f64>,
}

impl Deviations {
    /// Of a problem at its solution, whose blocks have these scores.
    pub(crate) fn of(problem: &Problem, solution: &Solution, scores: &[BlockScore]) -> Self {
        let independent = inverse(&solution.factor);
        let prior = problem.prior_information(&solution.theta);
        let blocks = sandwich(&independent, scores, &prior);
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

/// A block of time at the solution: its rows over all parameters, in units of their noise, and half the gradient of their squares.
pub(crate) struct BlockScore {
    pub(crate) rows: DMatrix<f64>,
    pub(crate) gradient: DVector<f64>,
}

impl BlockScore {
    /// Of rows with the right-hand side last, in units of their noise, under θ.
    pub(crate) fn of(mut rows: DMatrix<f64>, theta: &DVector<f64>) -> Self {
        let n = theta.len();
        let left = rows.columns(0, n) * theta - rows.column(n);
        rows = rows.remove_column(n);
        Self {
            gradient: rows.tr_mul(&left),
            rows,
        }
    }

    /// R⁻ᵀ times the gradient at the solution without this block, with R⁻¹ of all of them.
    fn without_itself(&self, inverse: &DMatrix<f64>) -> DVector<f64> {
        let own = &self.rows * inverse;
        let mut rest = own.tr_mul(&own);
        rest.neg_mut();
        (0..rest.nrows()).for_each(|k| rest[(k, k)] += 1.0 + LEAST_REST);
        let gradient = inverse.tr_mul(&self.gradient);
        // What a block alone tells leaves nothing of the rest: to rounding, as good as unknown.
        rest.cholesky()
            .map_or_else(|| &gradient / LEAST_REST, |rest| rest.solve(&gradient))
    }
}

/// A root of the covariance from R⁻¹, the blocks and the prior's rows.
pub(crate) fn sandwich(
    inverse: &DMatrix<f64>,
    blocks: &[BlockScore],
    prior: &DMatrix<f64>,
) -> DMatrix<f64> {
    let count = blocks.len() as f64;
    if blocks.len() < 2 {
        return inverse.clone();
    }
    let moved = |block: &BlockScore| block.without_itself(inverse);
    let moved: Vec<DVector<f64>> = side_by_side(blocks, moved);
    let mean = moved.iter().sum::<DVector<f64>>() / count;
    let mut root = DMatrix::zeros(inverse.nrows(), moved.len() + prior.nrows());
    let scale = ((count - 1.0) / count).sqrt() * few(count - 1.0);
    for (k, moved) in moved.iter().enumerate() {
        root.set_column(k, &((moved - &mean) * scale));
    }
    root.columns_mut(moved.len(), prior.nrows())
        .copy_from(&inverse.tr_mul(&prior.transpose()));
    inverse * root
}

/// What a deviation of so many degrees of freedom is multiplied by, so that twice of it covers as much as of one that is known: the ratio of
/// Student's and the normal distribution's 97.5 %.
fn few(freedom: f64) -> f64 {
    let normal = Normal::standard().inverse_cdf(COVERED);
    StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |student| student.inverse_cdf(COVERED) / normal)
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
            scores.push(BlockScore {
                rows: DMatrix::from_element(1, 1, (LENGTH as f64).sqrt()),
                gradient: DVector::from_element(1, sum),
            });
        }
        let factor = triangle(DMatrix::from_element(1, 1, n.sqrt()));
        let std = sandwich(&inverse(&factor), &scores, &DMatrix::zeros(0, 1)).norm();
        let long_run = 1.0 / (1.0 - memory);
        let expected = long_run / n.sqrt();
        assert!((std / expected - 1.0).abs() < 0.15, "{std} {expected}");
        assert!(std > 3.0 * inverse(&factor)[(0, 0)].abs());
    }

    /// Twelve blocks tell eight parameters, each noise remembered within its block: two standard deviations cover as much as they should.
    #[test]
    fn a_few_blocks_that_tell_many_parameters_are_not_believed_too_much() {
        const BLOCKS: usize = 12;
        const LENGTH: usize = 40;
        const PARAMETERS: usize = 8;
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut normal = move || -> f64 { StandardNormal.sample(&mut random) };
        let (mut covered, mut trials) = (0, 0);
        for _ in 0..200 {
            let blocks: Vec<DMatrix<f64>> = (0..BLOCKS)
                .map(|_| {
                    // Where a block does not move much, it tells little; what it says wrong is common to all of it.
                    let (size, wrong) = (normal().exp(), 2.0 * normal());
                    DMatrix::from_fn(LENGTH, PARAMETERS + 1, |_, c| {
                        let own = normal();
                        if c == PARAMETERS {
                            wrong + own
                        } else {
                            size * (own + 0.5)
                        }
                    })
                })
                .collect();
            let mut all = DMatrix::zeros(BLOCKS * LENGTH, PARAMETERS + 1);
            for (k, block) in blocks.iter().enumerate() {
                all.rows_mut(k * LENGTH, LENGTH).copy_from(block);
            }
            let solved = triangle(all);
            let factor = solved.view((0, 0), (PARAMETERS, PARAMETERS)).into_owned();
            let theta = factor
                .solve_upper_triangular(&solved.view((0, PARAMETERS), (PARAMETERS, 1)))
                .unwrap()
                .column(0)
                .into_owned();
            let blocks: Vec<BlockScore> = blocks
                .into_iter()
                .map(|block| BlockScore::of(block, &theta))
                .collect();
            let root = sandwich(&inverse(&factor), &blocks, &DMatrix::zeros(0, PARAMETERS));
            for (k, error) in theta.iter().enumerate() {
                covered += usize::from(error.abs() < 2.0 * root.row(k).norm());
                trials += 1;
            }
        }
        let covered = f64::from(u32::try_from(covered).unwrap()) / f64::from(trials);
        assert!((0.93..0.99).contains(&covered), "{covered}");
    }
}
