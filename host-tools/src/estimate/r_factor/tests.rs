//! Solutions and trials against dense least squares.

use nalgebra::{DMatrix, DVector};
use proprio_core::effect::EffectKind;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::*;
use crate::equation::column::{Entry, columns_of};
use crate::equation::values::NO_SHAPES;

/// A limb of one joint with some effects, its rows as a matrix and folded, and a prior.
struct Problem {
    columns: Columns,
    rows: DMatrix<f64>,
    factor: HeapFactor,
    prior: Prior,
}

const EFFECTS: [EffectKind; 4] = [
    EffectKind::Viscous,
    EffectKind::Coulomb,
    EffectKind::Bias,
    EffectKind::Spring,
];
const NOISE: f64 = 0.3;

fn problem(seed: u64) -> Problem {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut number = || f64::from(rng.next_u32()) / f64::from(u32::MAX) - 0.5;
    let entries = EFFECTS.iter().flat_map(|&effect| {
        let of = move |(parameter, column)| Entry {
            effect: Some(effect),
            joint: 0,
            parameter,
            mean: 0.2,
            std: 0.7,
            column,
        };
        columns_of((effect, 0), NO_SHAPES).into_iter().map(of)
    });
    let columns = Columns::new(vec![1], entries.collect());
    let width = columns.of_joint[0].len() + 1;
    let rows = DMatrix::from_fn(60, width, |_, _| number());
    let mut factor = HeapFactor::new(width - 1);
    factor.fold(rows.transpose().as_mut_slice());
    let body = (0..10).map(|k| {
        std::array::from_fn(|c| {
            if c >= k {
                number() + if c == k { 2.0 } else { 0.0 }
            } else {
                0.0
            }
        })
    });
    let prior = Prior {
        bodies: vec![body.collect()],
        tightness: vec![1.5],
    };
    Problem {
        columns,
        rows,
        factor,
        prior,
    }
}

impl Problem {
    fn triangle(&self, active: usize) -> RFactor {
        RFactor::new(
            &self.columns,
            &self.prior,
            std::slice::from_ref(&self.factor),
            &[NOISE],
            active,
        )
    }

    /// The normal equations, for a small well-conditioned problem: θ of `active` and the least cost.
    fn dense(&self, active: &[usize]) -> (Vec<f64>, f64) {
        let (n, m) = (active.len(), self.rows.nrows());
        let mut a = DMatrix::zeros(m + 10 + n, n);
        let mut b = DVector::zeros(m + 10 + n);
        for (c, &entry) in active.iter().enumerate() {
            let place = self.columns.place(0, entry).unwrap();
            a.view_mut((0, c), (m, 1))
                .copy_from(&(self.rows.column(place) / NOISE));
            if entry >= 10 {
                let Entry { mean, std, .. } = self.columns.entries[entry];
                a[(m + 10 + c, c)] = 1.0 / std;
                b[m + 10 + c] = mean / std;
            }
        }
        b.view_mut((0, 0), (m, 1))
            .copy_from(&(self.rows.column(self.rows.ncols() - 1) / NOISE));
        for (r, row) in self.prior.bodies[0].iter().enumerate() {
            (0..10).for_each(|c| a[(m + r, c)] = row[c] * 1.5);
            b[m + r] = row[10] * 1.5;
        }
        let solution = (a.transpose() * &a)
            .lu()
            .solve(&(a.transpose() * &b))
            .unwrap();
        let cost = (a * &solution - b).norm_squared();
        (solution.iter().copied().collect(), cost)
    }
}

#[test]
fn the_solution_is_that_of_dense_least_squares() {
    for seed in 0..20 {
        let problem = problem(seed);
        let active: Vec<usize> = (0..13).collect();
        let theta = problem.triangle(13).solve(&[]);
        let (dense, _) = problem.dense(&active);
        for (k, value) in active.iter().zip(dense) {
            assert!(
                (theta[*k] - value).abs() < 1e-9,
                "{k}: {} {value}",
                theta[*k]
            );
        }
    }
}

#[test]
fn a_trial_is_the_fit_with_its_entries_in_the_model() {
    for seed in 0..20 {
        let problem = problem(seed);
        let (active, group): (Vec<usize>, Vec<usize>) = ((0..13).collect(), vec![13, 14]);
        let triangle = problem.triangle(13);
        let trial = triangle.trial(&group).unwrap();
        let pairs: Vec<(usize, f64)> = group
            .iter()
            .copied()
            .zip(trial.value.iter().copied())
            .collect();
        let theta = triangle.solve(&pairs);
        let all: Vec<usize> = (0..15).collect();
        let (dense, least) = problem.dense(&all);
        for (value, expected) in theta.iter().zip(&dense) {
            assert!((value - expected).abs() < 1e-9, "{value} {expected}");
        }
        let std = problem.triangle(15).std();
        assert!((trial.std[0] - std[13]).abs() < 1e-9 && (trial.std[1] - std[14]).abs() < 1e-9);
        // The group's own prior, met by zero, costs (mean / std)² each.
        let (_, without) = problem.dense(&active);
        let absent = 2.0 * (0.2f64 / 0.7).powi(2);
        assert!(
            (trial.fall - (without + absent - least)).abs() < 1e-8,
            "{} {}",
            trial.fall,
            without - least
        );
    }
}
