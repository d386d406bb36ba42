//! Parameters from walks: physically consistent least squares on a model's prior; errors from the spread over blocks; residuals of
//! each part of the time under the fit to the others.

use nalgebra::{DMatrix, DVector};
use proprio_core::inertia::INERTIAL;
use proprio_solve::far::ROUNDS;

use super::columns::SENSORS;
use super::data::{Data, Sum};
use super::structure::ModelStructure;
use crate::estimate::Constraint;
use crate::estimate::bounded::{Problem, Solution, inverse, triangle};
use crate::estimate::deviation::{BlockScore, sandwich};
use crate::estimate::fit::hold;
use crate::parallel::side_by_side;

/// The least noise of an equation that is believed, N m.
const LEAST_NOISE: f64 = 1e-4;
/// Times that the noise of a fit without bounds is taken from what the one before leaves.
const NOISE_ROUNDS: usize = 2;
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
    /// Over the columns that the model has.
    pub(crate) problem: Problem,
    pub(crate) solution: Solution,
    /// Which columns these are.
    pub(crate) active: Vec<usize>,
    /// All parameters; zero where the model does not have a column.
    theta: DVector<f64>,
    /// Root mean square of what is left in an equation, N m.
    pub(crate) noise: f64,
}

impl Fit {
    /// The bodies, the base first, what sensors get wrong, and effects.
    pub(crate) fn theta(&self) -> &DVector<f64> {
        &self.theta
    }

    /// Whether column k's parameter is at a bound.
    pub(crate) fn is_held(&self, k: usize) -> bool {
        let at = self.active.binary_search(&k);
        at.is_ok_and(|at| self.solution.held[at])
    }

    fn of(
        data: &Data,
        sum: &Sum,
        structure: &ModelStructure,
        near: Option<Near<'_>>,
    ) -> Option<Self> {
        // A body with a load may be as far from the model's as it likes.
        let tightness = |loaded: bool| if loaded { f64::INFINITY } else { 1.0 };
        let bodies = structure.bodies.iter();
        let mut tightness: Vec<f64> = bodies.map(|body| tightness(body.loaded)).collect();
        let mut noise = near.map_or(structure.robot.first_noise, |near| near.noise);
        let active = structure.active(data.columns());
        let rows = some_columns(&sum.rows, &active);
        let rows = if rows.nrows() > rows.ncols() {
            triangle(rows)
        } else {
            rows
        };
        let gravity = some_columns(&data.gravity, &active);
        let mut problem = problem(data, weighed(&rows, &gravity, noise), structure);
        let mut solution = match near {
            Some(near) => problem.solve_from(&some_entries(near.theta, &active))?,
            None => problem.solve()?,
        };
        let rounds = if structure.hold_bodies { ROUNDS } else { 0 };
        let all = |theta: &DVector<f64>| spread_out(theta, &active, data.columns().len());
        // The noise is what the fit leaves, and the fit weighs the prior by it.
        for round in 0..=rounds {
            let now = noise_of(sum, &all(&solution.theta));
            if (now / noise - 1.0).abs() > SAME_NOISE {
                noise = now;
                problem.data = weighed(&rows, &gravity, noise);
                solution = problem.solve_from(&solution.theta)?;
            }
            if round == rounds || !hold(&mut problem, &solution, &mut tightness) {
                break;
            }
            solution = problem.solve_from(&solution.theta)?;
        }
        let theta = all(&solution.theta);
        Some(Self {
            noise: noise.max(noise_of(sum, &theta)),
            theta,
            active,
            problem,
            solution,
        })
    }

    /// The cost, in units of the noise, of the solution on all data of `data`.
    pub(crate) fn cost(&self, data: &Data, noise: f64) -> f64 {
        let prior = self.problem.without_data().cost(&self.solution.theta);
        data.all.squares(self.theta()) / (noise * noise) + prior.unwrap_or(f64::INFINITY)
    }
}

fn problem(data: &Data, rows: DMatrix<f64>, structure: &ModelStructure) -> Problem {
    Problem {
        bodies: structure.body_priors(),
        others: structure.others(data.columns()),
        data: rows,
        free: structure.constraint == Constraint::Free,
    }
}

/// Some columns of rows, and their right-hand side.
fn some_columns(rows: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
    let right = rows.ncols() - 1;
    let all: Vec<usize> = columns.iter().copied().chain([right]).collect();
    rows.select_columns(&all)
}

fn some_entries(theta: &DVector<f64>, entries: &[usize]) -> DVector<f64> {
    DVector::from_iterator(entries.len(), entries.iter().map(|k| theta[*k]))
}

/// The entries of a whole vector, all others zero.
fn spread_out(theta: &DVector<f64>, entries: &[usize], len: usize) -> DVector<f64> {
    let mut all = DVector::zeros(len);
    entries.iter().zip(theta).for_each(|(k, x)| all[*k] = *x);
    all
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
    /// The columns that these are of.
    active: Vec<usize>,
}

impl Deviations {
    /// Standard deviation of a combination of all parameters: the larger of the two.
    pub(crate) fn of_combination(&self, combination: &DVector<f64>) -> f64 {
        let own = some_entries(combination, &self.active);
        let roots = self.roots.iter();
        roots
            .map(|root| root.tr_mul(&own).norm())
            .fold(0.0, f64::max)
    }

    /// Standard deviations of parameter k if residuals are independent, and by the spread over blocks; zero of one that the model does not have.
    pub(crate) fn of_parameter(&self, k: usize) -> [f64; 2] {
        let at = self.active.binary_search(&k);
        [0, 1].map(|n: usize| at.map_or(0.0, |at| self.roots[n].row(at).norm()))
    }
}

impl Data {
    /// The fit of a model to all walks; none if numbers overflow.
    pub(crate) fn fit(&self, structure: &ModelStructure) -> Option<Fit> {
        Fit::of(self, &self.all, structure, None)
    }

    /// The same, looked for from the fit of another model.
    pub(crate) fn fit_from(&self, structure: &ModelStructure, near: &Fit) -> Option<Fit> {
        let near = Near {
            theta: near.theta(),
            noise: near.noise,
        };
        Fit::of(self, &self.all, structure, Some(near))
    }

    /// The same with bodies that the CAD's uncertainty alone holds, as `identify` has them.
    pub(crate) fn fit_with_free_bodies(
        &self,
        structure: &ModelStructure,
        near: &Fit,
    ) -> Option<Fit> {
        let mut free = structure.clone();
        free.hold_bodies = false;
        self.fit_from(&free, near)
    }

    /// With all torques at joints that the data have columns of and a load on every body, to first order and without bounds: the parameters by each of
    /// some sums of the data. What these leave no candidate explains.
    pub(crate) fn with_all(
        &self,
        structure: &ModelStructure,
        sums: &[&Sum],
    ) -> Option<Vec<DVector<f64>>> {
        let columns = self.columns();
        let own = columns.sites.iter();
        let own = own.filter(|site| site.is_torque() || structure.has(site.place));
        let whole = ModelStructure {
            effects: own.cloned().collect(),
            ..structure.with_loads(true)
        };
        let active = whole.active(columns);
        let gravity = some_columns(&self.gravity, &active);
        let solved = |sum: &&Sum| {
            let (mut noise, mut theta) = (structure.robot.first_noise, DVector::zeros(0));
            let own = some_columns(&sum.rows, &active);
            for _ in 0..NOISE_ROUNDS {
                let problem = problem(self, weighed(&own, &gravity, noise), &whole);
                let (r, z) = problem.expanded(&problem.start())?;
                let found = r.solve_upper_triangular(&z)?;
                theta = spread_out(&found, &active, columns.len());
                noise = noise_of(sum, &theta);
            }
            Some(theta)
        };
        side_by_side(sums, solved).into_iter().collect()
    }

    /// What a model's fit minimises at this noise of an equation, N m; no body is held.
    pub(crate) fn problem(&self, structure: &ModelStructure, noise: f64) -> Problem {
        let active = structure.active(self.columns());
        let [rows, gravity] = [&self.all.rows, &self.gravity].map(|r| some_columns(r, &active));
        problem(self, weighed(&rows, &gravity, noise), structure)
    }

    /// The same parameters with what sensors get wrong as it fits them best.
    pub(crate) fn with_sensors(&self, theta: &DVector<f64>) -> DVector<f64> {
        let acc = self.columns().acc();
        let mut theta = theta.clone();
        theta.rows_mut(acc, SENSORS).fill(0.0);
        let rows = weighed(
            &self.all.rows,
            &self.gravity,
            self.rms(&theta).max(LEAST_NOISE),
        );
        let mut own = DMatrix::zeros(rows.nrows() + SENSORS, SENSORS + 1);
        own.view_mut((0, 0), (rows.nrows(), SENSORS))
            .copy_from(&rows.columns(acc, SENSORS));
        let columns = theta.len();
        let left = rows.column(columns) - rows.columns(0, columns) * &theta;
        own.view_mut((0, SENSORS), (rows.nrows(), 1))
            .copy_from(&left);
        let std = &self.columns().robot.sensor_std;
        (0..SENSORS).for_each(|n| own[(rows.nrows() + n, n)] = 1.0 / std[n]);
        let solved = triangle(own);
        // Each has a prior: the triangle has no zero on its diagonal.
        let found = solved
            .view((0, 0), (SENSORS, SENSORS))
            .solve_upper_triangular(&solved.view((0, SENSORS), (SENSORS, 1)));
        if let Some(found) = found {
            theta.rows_mut(acc, SENSORS).copy_from(&found);
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
            let fit = Fit::of(self, &part.others, structure, near)?;
            Some(HeldOut {
                squares: part.own.squares(fit.theta()),
                equations: part.own.equations,
                noise: fit.noise,
                theta: fit.theta,
            })
        };
        let parts: Option<Vec<HeldOut>> = side_by_side(&numbers, of).into_iter().collect();
        parts.filter(|parts| !parts.is_empty())
    }

    /// What is known of the errors of a fit to all walks.
    pub(crate) fn deviations(&self, fit: &Fit) -> Deviations {
        let of = |block: &super::rows::Block| {
            let rows = some_columns(&block.folded.factor.dense(), &fit.active);
            BlockScore::of(rows / fit.noise, &fit.solution.theta)
        };
        let blocks: Vec<BlockScore> = side_by_side(&self.blocks, of);
        let independent = inverse(&fit.solution.factor);
        // What gravity's length tells is no sample of the blocks: known as a prior is.
        let prior = fit.problem.prior_information(&fit.solution.theta);
        let gravity = some_columns(&self.gravity, &fit.active);
        let prior = stack(&prior, &gravity.columns(0, fit.active.len()).into_owned());
        let blocks = sandwich(&independent, &blocks, &prior);
        Deviations {
            roots: [independent, blocks],
            active: fit.active.clone(),
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

/// The bodies as a structure has them before any data, and no effect.
pub(crate) fn bare(data: &Data, structure: &ModelStructure) -> DVector<f64> {
    let mut bare = DVector::zeros(data.columns().len());
    for (b, (body, _)) in structure.body_priors().iter().enumerate() {
        bare.rows_mut(INERTIAL * b, INERTIAL).copy_from(&body.0);
    }
    bare
}

/// Two matrices of equal columns, one above the other.
pub(crate) fn stack(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut rows = a.clone().resize_vertically(a.nrows() + b.nrows(), 0.0);
    rows.rows_mut(a.nrows(), b.nrows()).copy_from(b);
    rows
}
