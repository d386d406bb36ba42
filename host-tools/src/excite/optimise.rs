//! From one start to a local optimum: an augmented Lagrangian (Nocedal & Wright §17.3) whose steps are argmin's L-BFGS.
//!
//! The largest singular values over the smallest is no smooth function: where two meet it has a kink, and it is at such kinks
//! that it is least. The search therefore follows the smooth bound of [`Cost::Condition`] with a power that grows from one
//! outer iteration to the next, and remembers the best motion within the limits by the number itself.

use std::cell::RefCell;

use argmin::core::{CostFunction, Error, Executor, Gradient};
use argmin::solver::linesearch::MoreThuenteLineSearch;
use argmin::solver::quasinewton::LBFGS;

use super::cost::Cost;
use super::problem::Problem;

/// Steps that L-BFGS remembers.
const MEMORY: usize = 12;
/// Its steps between two updates of the multipliers.
const INNER: u64 = 30;
/// The first penalty, what it is multiplied by where a violation does not fall to [`FALL`] of itself, and its greatest value.
const PENALTY: (f64, f64, f64) = (10.0, 4.0, 1e6);
const FALL: f64 = 0.3;
/// Growth of the smooth condition number's power per update of the multipliers, and its greatest value.
const POWER: (f64, f64) = (1.6, 64.0);

/// How much work a search takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effort {
    /// Updates of the multipliers.
    pub(super) updates: usize,
    /// The first power of the smooth condition number.
    pub(super) power: f64,
}

impl Effort {
    /// From a random motion.
    pub(super) const FIRST: Self = Self {
        updates: 9,
        power: 1.0,
    };
    /// From a good one.
    pub(super) const AGAIN: Self = Self {
        updates: 16,
        power: 4.0,
    };
}

/// A point, what it costs, and the largest constraint.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    pub(super) x: Vec<f64>,
    pub(super) cost: f64,
    pub(super) worst: f64,
}

/// What a search may ask and say on its way.
pub(super) trait Watch {
    /// Whether to stop.
    fn stop(&self) -> bool;
    /// A better motion within the limits.
    fn better(&self, point: &Point);
}

/// Why a search ended early.
#[derive(Debug, thiserror::Error)]
#[error("stopped")]
struct Stopped;

struct Lagrangian<'a> {
    problem: &'a Problem,
    /// The cost whose slopes are followed.
    smooth: Cost,
    multipliers: Vec<f64>,
    penalty: f64,
    share: f64,
    watch: &'a dyn Watch,
    shared: &'a RefCell<Shared>,
}

/// What outlives one L-BFGS run.
struct Shared {
    last: Option<(Vec<f64>, f64, Vec<f64>)>,
    best: Option<Point>,
    evaluations: u64,
}

impl Lagrangian<'_> {
    fn evaluate(&self, x: &[f64]) -> Result<(f64, Vec<f64>), Error> {
        if let Some((at, value, slopes)) = &self.shared.borrow().last
            && at == x
        {
            return Ok((*value, slopes.clone()));
        }
        if self.watch.stop() {
            return Err(Stopped.into());
        }
        let of = self.problem.evaluate(x, self.share);
        let Some(value) = self.problem.cost(&of, &self.smooth) else {
            return Ok((f64::INFINITY, vec![0.0; x.len()]));
        };
        let (mut sum, mut pushes) = (value.cost, Vec::with_capacity(of.constraints.len()));
        let mut worst = f64::NEG_INFINITY;
        for (c, multiplier) in of.constraints.iter().zip(&self.multipliers) {
            let push = (multiplier + self.penalty * c).max(0.0);
            sum += (push * push - multiplier * multiplier) / (2.0 * self.penalty);
            pushes.push(push);
            worst = worst.max(*c);
        }
        self.remember(x, value.exact, worst);
        let slopes = self.problem.slopes(&of, &value.slope, &pushes, self.share);
        let mut shared = self.shared.borrow_mut();
        shared.evaluations += 1;
        shared.last = Some((x.to_vec(), sum, slopes.clone()));
        Ok((sum, slopes))
    }

    /// Keeps a motion that is within the limits and better than any before.
    fn remember(&self, x: &[f64], cost: f64, worst: f64) {
        // What is drawn in is given back by nine tenths: the last tenth is for what lies between the samples.
        if worst > 0.9 * (1.0 - self.share) {
            return;
        }
        let mut shared = self.shared.borrow_mut();
        if shared.best.as_ref().is_none_or(|best| cost < best.cost) {
            let point = Point {
                x: x.to_vec(),
                cost,
                worst,
            };
            self.watch.better(&point);
            shared.best = Some(point);
        }
    }
}

impl CostFunction for &Lagrangian<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, x: &Self::Param) -> Result<f64, Error> {
        Ok(self.evaluate(x)?.0)
    }
}

impl Gradient for &Lagrangian<'_> {
    type Param = Vec<f64>;
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Self::Param) -> Result<Self::Gradient, Error> {
        Ok(self.evaluate(x)?.1)
    }
}

/// The best motion within the limits that the search from `start` meets, with limits drawn in to `share` of themselves; none if
/// it meets none.
pub(super) fn from(
    problem: &Problem,
    goal: &Cost,
    start: &[f64],
    share: f64,
    effort: Effort,
    watch: &dyn Watch,
) -> Option<Point> {
    let shared = RefCell::new(Shared {
        last: None,
        best: None,
        evaluations: 0,
    });
    let mut lagrangian = Lagrangian {
        problem,
        smooth: goal.clone(),
        multipliers: vec![0.0; problem.constraints()],
        penalty: PENALTY.0,
        share,
        watch,
        shared: &shared,
    };
    let (mut x, mut before) = (start.to_vec(), f64::INFINITY);
    let mut power = effort.power;
    for outer in 0..effort.updates {
        if matches!(goal, Cost::Condition { .. }) {
            lagrangian.smooth = Cost::Condition { power };
            power = (power * POWER.0).min(POWER.1);
        }
        shared.borrow_mut().last = None;
        let solver = LBFGS::new(MoreThuenteLineSearch::new(), MEMORY);
        let run = Executor::new(&lagrangian, solver)
            .configure(|state| state.param(x.clone()).max_iters(INNER))
            .run();
        match run {
            Ok(mut result) => {
                if let Some(found) = result.state.take_best_param() {
                    x = found;
                }
            }
            // A line search that finds nothing better ends a run, not the search; a request to stop does.
            Err(_) if watch.stop() => break,
            Err(_) => {}
        }
        let of = problem.evaluate(&x, share);
        let worst = of.constraints.iter().fold(0.0f64, |most, c| most.max(*c));
        for (multiplier, c) in lagrangian.multipliers.iter_mut().zip(&of.constraints) {
            *multiplier = (*multiplier + lagrangian.penalty * c).max(0.0);
        }
        if outer > 0 && worst > FALL * before && worst > 1e-4 {
            lagrangian.penalty = (lagrangian.penalty * PENALTY.1).min(PENALTY.2);
        }
        before = worst;
    }
    drop(lagrangian);
    shared.into_inner().best
}
