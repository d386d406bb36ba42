//! The physically consistent solution: every body one that could exist, every friction and rotor inertia ≥ 0.
//!
//! The cost is that of the factors plus, per body, the prior that is infinite at the edge of what is physical
//! ([`InertialParameters::divergence_near`]), plus each effect's own prior:
//!
//! ```text
//! Σ_j ‖R_j θ − z_j‖² / σ_j²  +  Σ_b (2/s²) (tr(P₀⁻¹P_b) − log det(P₀⁻¹P_b) − 4)  +  Σ_e ((x_e − μ_e)/s_e)²,    x_e ≥ lower
//! ```
//!
//! Each term is convex in θ, so the minimum is unique and every start finds it; each Newton step is the ordinary solution
//! ([`Solver`]) with the bodies' priors expanded about where the last step ended. A step that leaves the physical bodies or
//! raises the cost is halved (the barrier is self-concordant, so this ends: Boyd & Vandenberghe §9.6). Effects below their
//! bound are put on it and let go when the cost falls away from it (an active set, as in Lawson & Hanson's NNLS).
//!
//! Log-Cholesky coordinates (Rucker & Wensing 2022) make every point physical too, but the cost is not convex in them, and
//! where the data alone ask for the impossible they run to infinity.

use crate::estimator::{
    CAD_UNCERTAINTY, EFFECTS, LegFactors, LegPrior, LegVector, Solution, Solver, effect_index,
};
use crate::factor::FactorError;
use crate::go2::JOINTS_PER_LEG;
use crate::inertia::{INERTIAL, InertialParameters};
use crate::{Real, scalar::real};

/// Newton steps that a solution may take; the worst real log needs fewer than ten.
pub const MAX_ITERATIONS: usize = 25;

/// How often a step may be halved.
const MAX_HALVINGS: u32 = 30;

/// A Newton step that moves no parameter by more than this many standard deviations is the last.
const CONVERGED: f64 = 1e-4;

/// Which effects of which joints are held at their bound.
pub type Held = [[bool; EFFECTS.len()]; JOINTS_PER_LEG];

/// The consistent solution of a leg, in steps of bounded cost.
#[derive(Clone, Debug)]
pub struct ConsistentSolver<T: Real> {
    prior: LegPrior<T>,
    data: LegFactors<T>,
    solver: Solver<T>,
    theta: LegVector<T>,
    held: Held,
    iterations: usize,
    stage: Stage,
    solution: Solution<T>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// The inner solver finds the Newton step.
    Step,
    /// The step is tried, halved this many times.
    Search {
        halvings: u32,
    },
    /// The inner solver finds the standard deviations at the minimum.
    Deviations,
    Done,
}

impl<T: Real> ConsistentSolver<T> {
    /// A solver for a leg with this prior, without data.
    pub fn new(prior: &LegPrior<T>) -> Self {
        let zero = [T::zero(); crate::estimator::LEG_PARAMETERS];
        let solver = Solver::default();
        let solution = *solver.solution();
        let data = LegFactors::default();
        let held = [[false; EFFECTS.len()]; JOINTS_PER_LEG];
        let (iterations, stage) = (0, Stage::Done);
        Self {
            prior: *prior,
            data,
            solver,
            theta: zero,
            held,
            iterations,
            stage,
            solution,
        }
    }

    /// Begins the solution for the data in `factors` (copied) at the CAD's bodies.
    pub fn start(&mut self, factors: &LegFactors<T>) {
        self.start_at(factors, &self.prior.cad.clone());
    }

    /// Begins at any physical bodies; where one is not physical, at the CAD's.
    pub fn start_at(
        &mut self,
        factors: &LegFactors<T>,
        bodies: &[InertialParameters<T>; JOINTS_PER_LEG],
    ) {
        self.data = *factors;
        self.held = [[false; EFFECTS.len()]; JOINTS_PER_LEG];
        self.iterations = 0;
        for (b, (body, cad)) in bodies.iter().zip(&self.prior.cad).enumerate() {
            let body = if body.is_physical() { body } else { cad };
            self.theta[INERTIAL * b..INERTIAL * (b + 1)].copy_from_slice(body.0.as_slice());
        }
        for joint in 0..JOINTS_PER_LEG {
            for e in 0..EFFECTS.len() {
                self.theta[effect_index(joint, e)] = real(self.prior.effects[joint][e].mean);
            }
        }
        self.begin_step(true);
    }

    /// Does the next bounded piece of work; true when [`solution`](Self::solution) is new, and from then on.
    ///
    /// # Errors
    /// [`FactorError`] as of [`Solver::advance`]; the solution stays the last one.
    pub fn advance(&mut self) -> Result<bool, FactorError> {
        match self.stage {
            Stage::Step if self.solver.advance()? => self.stage = Stage::Search { halvings: 0 },
            Stage::Search { halvings } => self.search(halvings),
            Stage::Deviations if self.solver.advance()? => {
                self.solution = Solution {
                    values: self.theta,
                    ..*self.solver.solution()
                };
                self.stage = Stage::Done;
            }
            Stage::Step | Stage::Deviations | Stage::Done => {}
        }
        Ok(self.stage == Stage::Done)
    }

    /// The solution at once.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn solve(&mut self, factors: &LegFactors<T>) -> Result<&Solution<T>, FactorError> {
        self.start(factors);
        while !self.advance()? {}
        Ok(&self.solution)
    }

    /// The last finished solution; zeros before the first.
    pub fn solution(&self) -> &Solution<T> {
        &self.solution
    }

    /// Newton steps that the solution took.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// Effects that the data would have beyond their bound.
    pub fn held(&self) -> &Held {
        &self.held
    }

    /// The solution's cost (see the module); `None` where a body is not physical.
    pub fn cost(&self, theta: &LegVector<T>) -> Option<T> {
        let mut cost = T::zero();
        for (joint, effects) in self.prior.effects.iter().enumerate() {
            let noise = self.data.noise(joint);
            cost += self.data.sum_of_squares(joint, theta) / (noise * noise);
            for (e, prior) in effects.iter().enumerate() {
                let off = (theta[effect_index(joint, e)] - real(prior.mean)) / real(prior.std);
                cost += off * off;
            }
        }
        for (b, cad) in self.prior.cad.iter().enumerate() {
            let weight = real::<T>(2.0 / (CAD_UNCERTAINTY * CAD_UNCERTAINTY));
            cost += body(theta, b).divergence(cad)? * weight;
        }
        Some(cost)
    }

    /// Expands the priors about the present point and starts the inner solver.
    fn begin_step(&mut self, hold: bool) {
        let mut near = self.prior;
        for (b, cad) in self.prior.cad.iter().enumerate() {
            if let Some(expanded) = body(&self.theta, b).divergence_near(cad, real(CAD_UNCERTAINTY))
            {
                near.bodies[b] = expanded;
            }
        }
        for (joint, held) in self.held.iter().enumerate() {
            for (e, held) in held.iter().enumerate() {
                if *held && hold {
                    let prior = &mut near.effects[joint][e];
                    prior.mean = lower(e);
                    prior.std *= 1e-4;
                }
            }
        }
        self.solver.start(&near, &self.data);
        self.stage = if hold { Stage::Step } else { Stage::Deviations };
    }

    /// Tries the Newton step, halved `halvings` times.
    fn search(&mut self, halvings: u32) {
        let scale = real::<T>(0.5).powi(halvings as i32);
        let target = self.solver.solution();
        let mut trial: LegVector<T> =
            core::array::from_fn(|k| self.theta[k] + (target.values[k] - self.theta[k]) * scale);
        let mut held = self.held;
        for (joint, held) in held.iter_mut().enumerate() {
            for (e, held) in held.iter_mut().enumerate() {
                let value = &mut trial[effect_index(joint, e)];
                if *held || *value < real(lower(e)) {
                    *held = true;
                    *value = real(lower(e));
                }
            }
        }
        let falls = match (self.cost(&trial), self.cost(&self.theta)) {
            // A rise within rounding is the minimum.
            (Some(there), Some(here)) => {
                there <= here + here.abs() * T::default_epsilon() * real(64.0)
            }
            _ => false,
        };
        // A bound that was just reached may lie against the slope of a partial step: take the step without it.
        if !falls && halvings < MAX_HALVINGS {
            self.stage = Stage::Search {
                halvings: halvings + 1,
            };
            return;
        }
        let moved = (0..trial.len()).fold(T::zero(), |most, k| {
            most.max(((trial[k] - self.theta[k]) / target.std[k]).abs())
        });
        if falls {
            self.theta = trial;
        }
        let changed = self.release(held) || held != self.held && falls;
        self.iterations += 1;
        let converged = (moved < real(CONVERGED) || !falls) && !changed;
        self.begin_step(!(converged || self.iterations >= MAX_ITERATIONS));
    }

    /// Takes over `held`, without the effects whose cost falls away from the bound; true if any was let go.
    fn release(&mut self, held: Held) -> bool {
        let mut released = false;
        self.held = held;
        for joint in 0..JOINTS_PER_LEG {
            for e in 0..EFFECTS.len() {
                if !self.held[joint][e] {
                    continue;
                }
                let (k, prior) = (effect_index(joint, e), self.prior.effects[joint][e]);
                let noise = self.data.noise(joint);
                let slope = self.data.slope(joint, e, &self.theta) / (noise * noise)
                    + (self.theta[k] - real(prior.mean)) / real(prior.std * prior.std);
                if slope < T::zero() {
                    self.held[joint][e] = false;
                    released = true;
                }
            }
        }
        released
    }
}

/// Least physical value of an effect.
fn lower(effect: usize) -> f64 {
    EFFECTS[effect].description().parameters[0].lower
}

/// Body b of a leg's θ.
pub fn body<T: Real>(theta: &LegVector<T>, b: usize) -> InertialParameters<T> {
    InertialParameters(core::array::from_fn(|n| theta[INERTIAL * b + n]).into())
}

#[cfg(test)]
mod tests;
