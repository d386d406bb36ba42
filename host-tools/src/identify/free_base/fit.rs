//! Parameters from a walk's blocks: physically consistent least squares on the CAD's prior, twice, since the accelerometer's
//! column depends on the masses; errors from the spread over blocks; held-out residuals.

use nalgebra::{DMatrix, DVector, Vector3};
use proprio_core::go2::{self, ACTUATORS, JOINTS, JOINTS_PER_LEG};
use proprio_core::inertia::{INERTIAL, InertialParameters};
use proprio_core::spatial::Transform;

use super::FreeBaseError;
use super::rows::{
    ACC, BODIES, Block, COLUMNS, EFFECTS, RowSetup, WholeFactor, Windows, empty, fold,
};
use super::stance::Stance;
use super::walk::Walk;
use crate::estimate::Constraint;
use crate::estimate::bounded::{Bounded, Problem, Solution, inverse};
use crate::estimate::deviation::sandwich;

/// Relative standard deviations of the CAD's bodies: a trunk carries what its owner put on it.
const TRUNK_UNCERTAINTY: f64 = 0.3;
const LEG_UNCERTAINTY: f64 = proprio_core::estimator::CAD_UNCERTAINTY;
/// An accelerometer's bias, m/s².
const ACC_BIAS: f64 = 0.2;
/// What the equations are multiplied by, so that their noise is alike: moments on the base (1), forces on it (m).
const MOMENT_SCALE: f64 = 0.3;
const FORCE_SCALE: f64 = 0.06;
/// Length of a block of time, s, and how many blocks a short log is cut into at least.
const BLOCK: f64 = 1.0;
const LEAST_BLOCKS: f64 = 12.0;
/// Parts of the time that are predicted by the others.
const FOLDS: usize = 5;
/// The noise of an equation before a fit tells it, and the least that is believed, N m.
const FIRST_NOISE: f64 = 0.1;
const LEAST_NOISE: f64 = 1e-4;
/// Passes over the data.
const PASSES: usize = 2;

/// What the data say of all columns.
pub(super) struct Fit {
    pub(super) theta: DVector<f64>,
    /// Roots of the covariance: if residuals are independent, and by the spread over blocks.
    pub(super) roots: [DMatrix<f64>; 2],
    /// Which are held at a bound.
    pub(super) held: Vec<bool>,
    pub(super) prior: DVector<f64>,
    /// Standard deviations of the prior.
    pub(super) prior_std: DVector<f64>,
    /// The prior as it looks from the estimate, for what the motion shows.
    pub(super) prior_there: DVector<f64>,
    pub(super) rms: f64,
    pub(super) cad_rms: f64,
    pub(super) held_out_rms: Option<f64>,
    pub(super) windows: Windows,
    pub(super) blocks: usize,
}

/// Fits the walks together.
pub(super) fn fit(walks: &[(Walk, Stance)], constraint: Constraint) -> Result<Fit, FreeBaseError> {
    let mut setup = RowSetup {
        tree: go2::free(),
        imu: Transform::from_translation(Vector3::from(go2::IMU)),
        scale: std::array::from_fn(|c| match c {
            0..3 => MOMENT_SCALE,
            3..6 => FORCE_SCALE,
            _ => 1.0,
        }),
        acc_bias: Vector3::zeros(),
    };
    let mut last = None;
    for _ in 0..PASSES {
        let (blocks, windows) = blocks_of(walks, &setup);
        if blocks.is_empty() {
            return Err(FreeBaseError::NoWindows(windows));
        }
        let data = Data {
            gravity: gravity_rows(walks),
            blocks,
            constraint,
        };
        let solved = data.solve(&|_| true).ok_or(FreeBaseError::Unsolvable)?;
        // The accelerometer's column is a derivative at these masses and this bias.
        let theta = &solved.solution.theta;
        setup.tree = setup
            .tree
            .with_inertia(&std::array::from_fn(|b| body(theta, b)));
        setup.acc_bias = theta.fixed_rows::<3>(ACC).into_owned();
        last = Some((data, solved, windows));
    }
    let (data, solved, windows) = last.ok_or(FreeBaseError::Unsolvable)?;
    Ok(data.told(solved, windows))
}

/// All walks' rows, and what became of their time.
fn blocks_of(walks: &[(Walk, Stance)], setup: &RowSetup) -> (Vec<Block>, Windows) {
    let (mut all, mut counts) = (Vec::new(), Windows::default());
    for (walk, stance) in walks {
        let duration = walk.duration();
        let (blocks, of_walk) = fold(walk, stance, setup, BLOCK.min(duration / LEAST_BLOCKS));
        all.extend(blocks.into_iter().filter(|block| block.equations > 0.0));
        counts = counts.plus(&of_walk);
    }
    (all, counts)
}

/// What gravity's length tells of the accelerometer's bias, one row per walk.
fn gravity_rows(walks: &[(Walk, Stance)]) -> DMatrix<f64> {
    let told: Vec<_> = walks
        .iter()
        .filter_map(|(walk, _)| walk.gravity())
        .collect();
    let mut rows = DMatrix::zeros(told.len(), COLUMNS + 1);
    for (r, gravity) in told.iter().enumerate() {
        for n in 0..3 {
            rows[(r, ACC + n)] = gravity.up[n] / gravity.std;
        }
        rows[(r, COLUMNS)] = gravity.excess / gravity.std;
    }
    rows
}

/// Rows, and how they are to be fitted.
struct Data {
    gravity: DMatrix<f64>,
    blocks: Vec<Block>,
    constraint: Constraint,
}

/// A problem with its solution and the noise of an equation, N m.
struct Solved {
    problem: Problem,
    solution: Solution,
    noise: f64,
}

impl Data {
    /// The solution of the blocks that are chosen.
    fn solve(&self, chosen: &dyn Fn(usize) -> bool) -> Option<Solved> {
        let mut sum = empty();
        let mut scratch = vec![0.0; COLUMNS + 1];
        let mut equations = 0.0;
        for (_, block) in self.blocks.iter().enumerate().filter(|(k, _)| chosen(*k)) {
            // Same columns and finite numbers: cannot fail.
            let _ = sum.merge(&block.factor, |c| c, 1.0, &mut scratch);
            equations += block.equations;
        }
        let rows = dense(&sum);
        let mut noise = FIRST_NOISE;
        let mut solved = None;
        // The noise is what the fit leaves, and the fit weighs the prior by it.
        for _ in 0..2 {
            let problem = self.problem(&rows, noise);
            let solution = problem.solve()?;
            noise = (sum.sum_of_squares(solution.theta.as_slice()) / equations)
                .sqrt()
                .max(LEAST_NOISE);
            solved = Some((problem, solution));
        }
        solved.map(|(problem, solution)| Solved {
            problem,
            solution,
            noise,
        })
    }

    fn problem(&self, rows: &DMatrix<f64>, noise: f64) -> Problem {
        let cad = go2::free::<f64>();
        let bodies = cad.bodies().iter().enumerate().map(|(b, body)| {
            let uncertainty = if b == 0 {
                TRUNK_UNCERTAINTY
            } else {
                LEG_UNCERTAINTY
            };
            (body.inertia, uncertainty)
        });
        let mut data = DMatrix::zeros(rows.nrows() + self.gravity.nrows(), COLUMNS + 1);
        data.rows_mut(0, rows.nrows()).copy_from(&(rows / noise));
        data.rows_mut(rows.nrows(), self.gravity.nrows())
            .copy_from(&self.gravity);
        Problem {
            bodies: bodies.collect(),
            others: others(self.constraint),
            data,
            free: self.constraint == Constraint::Free,
        }
    }

    fn rms(&self, theta: &DVector<f64>, chosen: &dyn Fn(usize) -> bool) -> f64 {
        let blocks = self.blocks.iter().enumerate().filter(|(k, _)| chosen(*k));
        let (sum, equations) = blocks.fold((0.0, 0.0), |(sum, equations), (_, block)| {
            (
                sum + block.factor.sum_of_squares(theta.as_slice()),
                equations + block.equations,
            )
        });
        (sum / f64::max(equations, 1.0)).sqrt()
    }

    /// Residuals of each part of the time under the fit to the others.
    fn held_out_rms(&self) -> Option<f64> {
        let count = self.blocks.len();
        if count < 2 * FOLDS {
            return None;
        }
        let (mut sum, mut equations) = (0.0, 0.0);
        for part in 0..FOLDS {
            let own = |k: usize| k * FOLDS / count == part;
            // The neighbours of a part share its noise.
            let near = |k: usize| own(k) || own(k + 1) || (k > 0 && own(k - 1));
            let solved = self.solve(&|k| !near(k))?;
            let of_part: f64 = (0..count)
                .filter(|k| own(*k))
                .map(|k| self.blocks[k].equations)
                .sum();
            sum += self.rms(&solved.solution.theta, &own).powi(2) * of_part;
            equations += of_part;
        }
        Some((sum / equations).sqrt())
    }

    fn told(&self, solved: Solved, windows: Windows) -> Fit {
        let Solved {
            problem,
            solution,
            noise,
        } = solved;
        let theta = &solution.theta;
        let scores: Vec<DVector<f64>> = self
            .blocks
            .iter()
            .map(|block| score(block, theta, noise))
            .collect();
        let independent = inverse(&solution.factor);
        let mut prior = problem.prior_information(theta);
        // What gravity's length tells is no sample of the blocks: known as a prior is.
        prior = stack(&prior, &self.gravity.columns(0, COLUMNS).into_owned());
        let blocks = sandwich(&independent, &scores, &prior);
        let norms = |root: DMatrix<f64>| DVector::from_fn(root.nrows(), |k, _| root.row(k).norm());
        let cad = problem.start();
        let mut bare = cad.clone();
        bare.rows_mut(INERTIAL * BODIES, COLUMNS - INERTIAL * BODIES)
            .fill(0.0);
        Fit {
            prior_std: norms(problem.prior_root(&cad)),
            prior_there: norms(problem.prior_root(theta)),
            roots: [independent, blocks],
            rms: self.rms(theta, &|_| true),
            cad_rms: self.rms(&bare, &|_| true),
            held_out_rms: self.held_out_rms(),
            held: solution.held.clone(),
            prior: cad,
            windows,
            blocks: self.blocks.len(),
            theta: solution.theta,
        }
    }
}

/// A factor's triangle as a matrix, the right-hand side last.
fn dense(factor: &WholeFactor) -> DMatrix<f64> {
    let n = factor.columns();
    let mut rows = DMatrix::zeros(n, n + 1);
    for k in 0..n {
        for (c, x) in factor.row(k).iter().enumerate() {
            rows[(k, k + c)] = *x;
        }
    }
    rows
}

/// Half the gradient of a block's squares in units of the noise.
fn score(block: &Block, theta: &DVector<f64>, noise: f64) -> DVector<f64> {
    let rows = dense(&block.factor);
    let n = theta.len();
    let r = rows.columns(0, n);
    r.tr_mul(&(r * theta - rows.column(n))) / (noise * noise)
}

fn stack(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut rows = a.clone().resize_vertically(a.nrows() + b.nrows(), 0.0);
    rows.rows_mut(a.nrows(), b.nrows()).copy_from(b);
    rows
}

/// Priors and bounds of the effects and of the accelerometer's bias.
fn others(constraint: Constraint) -> Vec<Bounded> {
    let unbounded = [f64::NEG_INFINITY, f64::INFINITY];
    let effect = |j: usize, e: usize| {
        let prior = EFFECTS[e].prior_of(&ACTUATORS[j % JOINTS_PER_LEG], 0);
        let described = &EFFECTS[e].description().parameters[0];
        let [lower, upper] = match constraint {
            Constraint::Free => unbounded,
            Constraint::Physical => [described.lower, described.upper],
        };
        Bounded {
            mean: prior.mean,
            std: prior.std,
            lower,
            upper,
        }
    };
    let bias = Bounded {
        mean: 0.0,
        std: ACC_BIAS,
        lower: unbounded[0],
        upper: unbounded[1],
    };
    let effects = (0..JOINTS).flat_map(|j| (0..EFFECTS.len()).map(move |e| (j, e)));
    effects
        .map(|(j, e)| effect(j, e))
        .chain([bias; 3])
        .collect()
}

/// Body b of θ, the base first.
pub(super) fn body(theta: &DVector<f64>, b: usize) -> InertialParameters<f64> {
    InertialParameters(theta.fixed_rows::<INERTIAL>(INERTIAL * b).into_owned())
}
