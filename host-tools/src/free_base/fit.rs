//! Parameters from walks: physically consistent least squares on a model's prior; errors from the spread over blocks; residuals of
//! each part of the time under the fit to the others.

use nalgebra::{DMatrix, DVector};
use proprio_core::inertia::INERTIAL;

use super::data::{Data, Sum, dense};
use super::rows::{ACC, BODIES, COLUMNS};
use super::sensors::{self, SENSORS};
use super::structure::ModelStructure;
use crate::estimate::Constraint;
use crate::estimate::bounded::{Problem, Solution, inverse, triangle};
use crate::estimate::deviation::{BlockScore, sandwich};
use crate::estimate::fit::{HOLD_ROUNDS, hold};
use crate::estimate::robot::side_by_side;

/// The noise of an equation before a fit tells it, and the least that is believed, N m.
pub(crate) const FIRST_NOISE: f64 = 0.1;
const LEAST_NOISE: f64 = 1e-4;
/// Noises that differ by a smaller share weigh the prior alike.
const SAME_NOISE: f64 = 0.01;

/// A known fit that another may be near: its parameters and its noise, N m.
#[derive(Clone, Copy)]
struct Near<'a> {
    theta: &'a DVector<f64>,
    noise: f64,
}

/// A model fitted to walks, or to a part of them.
pub(crate) struct Fit {
    pub(crate) problem: Problem,
    pub(crate) solution: Solution,
    /// Root mean square of what is left in an equation, N m.
    pub(crate) noise: f64,
}

impl Fit {
    /// The bodies, the base first, then the joints' effects and what sensors get wrong.
    pub(crate) fn theta(&self) -> &DVector<f64> {
        &self.solution.theta
    }

    fn of(
        sum: &Sum,
        gravity: &DMatrix<f64>,
        structure: &ModelStructure,
        near: Option<Near<'_>>,
    ) -> Option<Self> {
        // A body with a load may be as far from the model's as it likes.
        let tightness = |loaded: bool| if loaded { f64::INFINITY } else { 1.0 };
        let bodies = structure.bodies.iter();
        let mut tightness: Vec<f64> = bodies.map(|body| tightness(body.loaded)).collect();
        let mut noise = near.map_or(FIRST_NOISE, |near| near.noise);
        let mut problem = problem(weighed(&sum.rows, gravity, noise), structure);
        let mut solution = match near {
            Some(near) => problem.solve_from(near.theta)?,
            None => problem.solve()?,
        };
        let rounds = if structure.hold_bodies {
            HOLD_ROUNDS
        } else {
            0
        };
        // The noise is what the fit leaves, and the fit weighs the prior by it.
        for round in 0..=rounds {
            let now = noise_of(sum, &solution.theta);
            if (now / noise - 1.0).abs() > SAME_NOISE {
                noise = now;
                problem.data = weighed(&sum.rows, gravity, noise);
                solution = problem.solve_from(&solution.theta)?;
            }
            if round == rounds || !hold(&mut problem, &solution, &mut tightness) {
                break;
            }
            solution = problem.solve_from(&solution.theta)?;
        }
        Some(Self {
            noise: noise.max(noise_of(sum, &solution.theta)),
            problem,
            solution,
        })
    }

    /// The cost, in units of the noise, of the solution on all data of `data`.
    pub(crate) fn cost(&self, data: &Data, noise: f64) -> f64 {
        let prior = self.problem.without_data().cost(self.theta());
        data.all.squares(self.theta()) / (noise * noise) + prior.unwrap_or(f64::INFINITY)
    }
}

fn problem(data: DMatrix<f64>, structure: &ModelStructure) -> Problem {
    Problem {
        bodies: structure.body_priors(),
        others: structure.others(),
        data,
        free: structure.constraint == Constraint::Free,
    }
}

fn noise_of(sum: &Sum, theta: &DVector<f64>) -> f64 {
    (sum.squares(theta) / sum.equations.max(1.0))
        .sqrt()
        .max(LEAST_NOISE)
}

/// Rows in units of the noise, and those of gravity's length.
fn weighed(rows: &DMatrix<f64>, gravity: &DMatrix<f64>, noise: f64) -> DMatrix<f64> {
    stack(&(rows / noise), gravity)
}

/// A part of the time under the fit to the others.
pub(crate) struct HeldOut {
    /// Sum of squares, N² m², and how many equations.
    pub(crate) squares: f64,
    pub(crate) equations: f64,
    /// The parameters that predicted it.
    pub(crate) theta: DVector<f64>,
    noise: f64,
}

/// Root mean square over all parts, N m.
pub(crate) fn rms(parts: &[HeldOut]) -> f64 {
    let (squares, equations) = parts.iter().fold((0.0, 0.0), |(s, e), part| {
        (s + part.squares, e + part.equations)
    });
    (squares / f64::max(equations, 1.0)).sqrt()
}

/// What is known of a fit's errors.
pub(crate) struct Deviations {
    /// Roots of the covariance: if residuals are independent, and by the spread over blocks.
    roots: [DMatrix<f64>; 2],
}

impl Deviations {
    /// Standard deviation of a combination of parameters: the larger of the two.
    pub(crate) fn of_combination(&self, combination: &DVector<f64>) -> f64 {
        let roots = self.roots.iter();
        roots
            .map(|root| root.tr_mul(combination).norm())
            .fold(0.0, f64::max)
    }

    /// Standard deviations of parameter k if residuals are independent, and by the spread over blocks.
    pub(crate) fn of_parameter(&self, k: usize) -> [f64; 2] {
        [0, 1].map(|n: usize| self.roots[n].row(k).norm())
    }
}

impl Data {
    /// The fit of a model to all walks; none if numbers overflow.
    pub(crate) fn fit(&self, structure: &ModelStructure) -> Option<Fit> {
        Fit::of(&self.all, &self.gravity, structure, None)
    }

    /// The same, looked for from the fit of another model.
    pub(crate) fn fit_from(&self, structure: &ModelStructure, near: &Fit) -> Option<Fit> {
        let near = Near {
            theta: near.theta(),
            noise: near.noise,
        };
        Fit::of(&self.all, &self.gravity, structure, Some(near))
    }

    /// What a model's fit minimises at this noise of an equation, N m; no body is held.
    pub(crate) fn problem(&self, structure: &ModelStructure, noise: f64) -> Problem {
        problem(weighed(&self.all.rows, &self.gravity, noise), structure)
    }

    /// The same parameters with what sensors get wrong as it fits them best.
    pub(crate) fn with_sensors(&self, theta: &DVector<f64>) -> DVector<f64> {
        let mut theta = theta.clone();
        theta.rows_mut(ACC, SENSORS).fill(0.0);
        let rows = weighed(
            &self.all.rows,
            &self.gravity,
            self.rms(&theta).max(LEAST_NOISE),
        );
        let mut own = DMatrix::zeros(rows.nrows() + SENSORS, SENSORS + 1);
        own.view_mut((0, 0), (rows.nrows(), SENSORS))
            .copy_from(&rows.columns(ACC, SENSORS));
        let left = rows.column(COLUMNS) - rows.columns(0, COLUMNS) * &theta;
        own.view_mut((0, SENSORS), (rows.nrows(), 1))
            .copy_from(&left);
        (0..SENSORS).for_each(|n| own[(rows.nrows() + n, n)] = 1.0 / sensors::STD[n]);
        let solved = triangle(own);
        // Each has a prior: the triangle has no zero on its diagonal.
        let found = solved
            .view((0, 0), (SENSORS, SENSORS))
            .solve_upper_triangular(&solved.view((0, SENSORS), (SENSORS, 1)));
        if let Some(found) = found {
            theta.rows_mut(ACC, SENSORS).copy_from(&found);
        }
        theta
    }

    /// Residuals of each part of the time under the fit to the others; none for short logs.
    pub(crate) fn held_out(&self, structure: &ModelStructure) -> Option<Vec<HeldOut>> {
        self.held_out_from(structure, &[])
    }

    /// The same, looked for from the fits of another model.
    pub(crate) fn held_out_from(
        &self,
        structure: &ModelStructure,
        near: &[HeldOut],
    ) -> Option<Vec<HeldOut>> {
        let numbers: Vec<usize> = (0..self.parts.len()).collect();
        let of = |&n: &usize| {
            let part = &self.parts[n];
            let near = near.get(n).map(|near| Near {
                theta: &near.theta,
                noise: near.noise,
            });
            let fit = Fit::of(&part.others, &self.gravity, structure, near)?;
            Some(HeldOut {
                squares: part.own.squares(fit.theta()),
                equations: part.own.equations,
                noise: fit.noise,
                theta: fit.solution.theta,
            })
        };
        let parts: Option<Vec<HeldOut>> = side_by_side(&numbers, of).into_iter().collect();
        parts.filter(|parts| !parts.is_empty())
    }

    /// What is known of the errors of a fit to all walks.
    pub(crate) fn deviations(&self, fit: &Fit) -> Deviations {
        let blocks = self.blocks.iter();
        let blocks: Vec<BlockScore> = blocks
            .map(|block| BlockScore::of(dense(&block.factor) / fit.noise, fit.theta()))
            .collect();
        let independent = inverse(&fit.solution.factor);
        // What gravity's length tells is no sample of the blocks: known as a prior is.
        let prior = fit.problem.prior_information(fit.theta());
        let prior = stack(&prior, &self.gravity.columns(0, COLUMNS).into_owned());
        let blocks = sandwich(&independent, &blocks, &prior);
        Deviations {
            roots: [independent, blocks],
        }
    }

    /// Whether the walks are long enough to hold parts of them out.
    pub(crate) fn can_hold_out(&self) -> bool {
        !self.parts.is_empty()
    }

    /// Blocks of time that errors come from.
    pub(crate) fn block_count(&self) -> usize {
        self.blocks.len()
    }
}

/// The bodies as a problem has them before any data, and no effect.
pub(crate) fn bare(problem: &Problem) -> DVector<f64> {
    let mut bare = problem.start();
    bare.rows_mut(INERTIAL * BODIES, COLUMNS - INERTIAL * BODIES)
        .fill(0.0);
    bare
}

/// Two matrices of equal columns, one above the other.
pub(crate) fn stack(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut rows = a.clone().resize_vertically(a.nrows() + b.nrows(), 0.0);
    rows.rows_mut(a.nrows(), b.nrows()).copy_from(b);
    rows
}
