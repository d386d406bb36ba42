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
//!
//! # Example
//!
//! A rod of which the data say nothing but nonsense: a mass of −1 kg. Of the solutions in which it could exist, the likeliest:
//!
//! ```
//! use nalgebra::{Matrix3, Vector3};
//! use proprio_core::consistent::{ConsistentSolver, body};
//! use proprio_core::effect::EffectKind::Viscous;
//! use proprio_core::estimator::{EffectPrior, JointFactors, Layout, LimbPrior, Solver, solver_len};
//! use proprio_core::factor::FactorError;
//! use proprio_core::inertia::InertialParameters;
//! use proprio_core::robot::Actuator;
//!
//! let about_com = Matrix3::from_diagonal(&Vector3::new(0.0133, 0.0133, 1e-4));
//! let rod = InertialParameters::from_com(1.0, Vector3::new(0.0, 0.0, -0.2), about_com);
//! let motor = Actuator { gear: 6.0, rotor_inertia: 1e-4, effort: 20.0, velocity: 30.0 };
//!
//! // One body, one effect column: friction, the ten parameters, the torque.
//! const LIMB: Layout<1> = Layout::chain(1);
//! let mut data = JointFactors::new(LIMB, [0.0; LIMB.packed_len()]);
//! for n in 0..100 {
//!     let speed = f64::from(n % 7 - 3);
//!     // Negative friction, and a mass of −1 kg.
//!     let mut row = [0.0; LIMB.columns(0) + 1];
//!     (row[0], row[1], row[11]) = (speed, 1.0, -0.1 * speed - 1.0);
//!     data.fold(0, &mut row)?;
//! }
//! let prior = LimbPrior::new([rod], [0.1], [EffectPrior::of(Viscous, &motor)]);
//!
//! let storage = [0.0; solver_len(LIMB.parameters())];
//! let mut free = Solver::new(data, storage);
//! free.restart(&prior);
//! while !free.advance()? {}
//! assert!(!body(free.values(), 0).is_physical() && free.values()[10] < 0.0);
//!
//! let theta = [0.0; LIMB.parameters()];
//! let mut consistent = ConsistentSolver::new(&prior, Solver::new(data, storage), theta);
//! consistent.solve(&data)?;
//! assert!(body(consistent.values(), 0).is_physical() && consistent.values()[10] >= 0.0);
//! # Ok::<(), FactorError>(())
//! ```

use crate::estimator::{
    EFFECTS, EffectPrior, JointFactors, LEG, LEG_PARAMETERS, LegVector, LimbPrior, Solver,
    solver_len,
};
use crate::factor::FactorError;
use crate::inertia::{INERTIAL, InertialParameters};
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::{Real, scalar::real};

/// Newton steps that a solution may take. 3 from the CAD on simulated motions; fewer than this from twenty random starts.
pub const MAX_ITERATIONS: usize = 25;

/// How often a step may be halved.
const MAX_HALVINGS: u32 = 30;

/// A Newton step that moves no parameter by more than this many standard deviations is the last.
const CONVERGED: f64 = 1e-4;

/// Effects, by their place in θ behind the inertial ones, that are held at a bound.
///
/// A limb may have up to 128.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Held(u128);

impl Held {
    /// Whether effect parameter n is held.
    pub fn contains(self, n: usize) -> bool {
        n < 128 && self.0 >> n & 1 == 1
    }

    fn set(&mut self, n: usize, held: bool) {
        let bit = 1_u128.checked_shl(n as u32).unwrap_or(0);
        self.0 = if held { self.0 | bit } else { self.0 & !bit };
    }
}

/// The consistent solution of a limb, in steps of bounded cost.
///
/// `D` and `S` store what [`Solver`] needs, `V` stores θ, `E` the effects' priors.
#[derive(Clone, Debug)]
pub struct ConsistentSolver<T: Real, D, S, V, E, const B: usize> {
    prior: LimbPrior<T, E, B>,
    /// The prior expanded about where the last step ended, held effects pinned.
    near: LimbPrior<T, E, B>,
    solver: Solver<T, D, S, B>,
    theta: V,
    trial: V,
    held: Held,
    iterations: usize,
    stage: Stage,
}

/// The consistent solution of a leg of hip, thigh and calf.
pub type LegConsistentSolver<T> = ConsistentSolver<
    T,
    [T; LEG.packed_len()],
    [T; solver_len(LEG_PARAMETERS)],
    LegVector<T>,
    [EffectPrior; EFFECTS.len() * JOINTS_PER_LEG],
    JOINTS_PER_LEG,
>;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// The prior of this body is expanded: a part of its own, for it takes as long as a tick allows.
    Expand {
        body: usize,
        hold: bool,
    },
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

impl<T, D, S, V, E, const B: usize> ConsistentSolver<T, D, S, V, E, B>
where
    T: Real,
    D: AsRef<[T]> + AsMut<[T]> + Clone,
    S: AsRef<[T]> + AsMut<[T]>,
    V: AsRef<[T]> + AsMut<[T]> + Clone,
    E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]> + Clone,
{
    /// A solver for a limb with this prior; `theta` holds as many numbers as the limb has parameters.
    pub fn new(prior: &LimbPrior<T, E, B>, solver: Solver<T, D, S, B>, theta: V) -> Self {
        let (prior, near, trial) = (prior.clone(), prior.clone(), theta.clone());
        let (held, iterations, stage) = (Held::default(), 0, Stage::Done);
        Self {
            prior,
            near,
            solver,
            theta,
            trial,
            held,
            iterations,
            stage,
        }
    }

    /// Begins the solution for `data` (copied) at the CAD's bodies.
    pub fn start(&mut self, data: &JointFactors<T, D, B>) {
        self.start_at(data, &self.prior.cad().clone());
    }

    /// Begins at any physical bodies; where one is not physical, at the CAD's.
    pub fn start_at(&mut self, data: &JointFactors<T, D, B>, bodies: &[InertialParameters<T>; B]) {
        let layout = *self.layout();
        self.held = Held::default();
        self.iterations = 0;
        let theta = self.theta.as_mut();
        let cad = bodies.iter().zip(self.prior.cad()).take(layout.bodies());
        for (to, (body, cad)) in theta.chunks_exact_mut(INERTIAL).zip(cad) {
            let body = if body.is_physical() { body } else { cad };
            to.copy_from_slice(body.0.as_slice());
        }
        let effects = theta.get_mut(layout.inertial()..).unwrap_or(&mut []);
        for (to, effect) in effects.iter_mut().zip(self.prior.effects()) {
            *to = real(effect.prior.mean);
        }
        self.solver.data_mut().copy_from(data);
        self.begin_step(true);
    }

    /// Does the next bounded piece of work; true when the solution is new, and from then on.
    ///
    /// # Errors
    /// [`FactorError`] as of [`Solver::advance`].
    pub fn advance(&mut self) -> Result<bool, FactorError> {
        match self.stage {
            Stage::Expand { body, hold } => self.expand(body, hold),
            Stage::Step if self.solver.advance()? => self.stage = Stage::Search { halvings: 0 },
            Stage::Search { halvings } => self.search(halvings),
            Stage::Deviations if self.solver.advance()? => self.stage = Stage::Done,
            Stage::Step | Stage::Deviations | Stage::Done => {}
        }
        Ok(self.stage == Stage::Done)
    }

    /// Starts and goes on to the end.
    ///
    /// # Errors
    /// As [`advance`](Self::advance).
    pub fn solve(&mut self, data: &JointFactors<T, D, B>) -> Result<(), FactorError> {
        self.start(data);
        while !self.advance()? {}
        Ok(())
    }

    /// θ: of the last finished solution when [`advance`](Self::advance) has said so, else of the step reached.
    pub fn values(&self) -> &[T] {
        self.theta.as_ref()
    }

    /// Standard deviations of the last finished solution, from the cost's curvature, bounds left aside.
    pub fn std(&self) -> &[T] {
        self.solver.std()
    }

    /// Each joint's noise, as [`Solver::noise`].
    pub fn noise(&self) -> &[T; B] {
        self.solver.noise()
    }

    /// Newton steps that the solution took.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// Effects that the data would have beyond their bound.
    pub fn held(&self) -> Held {
        self.held
    }

    /// The cost of any θ (see the module); `None` where a body is not physical.
    pub fn cost(&self, theta: &[T]) -> Option<T> {
        let (layout, data) = (self.layout(), self.solver.data());
        let mut cost = T::zero();
        for joint in 0..layout.bodies() {
            let noise = data.noise(joint);
            cost += data.sum_of_squares(joint, theta) / (noise * noise);
            cost += self.prior.body_cost(joint, &body(theta, joint))?;
        }
        let effects = theta.get(layout.inertial()..)?;
        for (value, EffectPrior { prior, .. }) in effects.iter().zip(self.prior.effects()) {
            let off = (*value - real(prior.mean)) / real(prior.std);
            cost += off * off;
        }
        Some(cost)
    }

    fn layout(&self) -> &crate::estimator::Layout<B> {
        self.solver.layout()
    }

    /// Begins the next step from the present point, or, if effects are not to be held, the standard deviations.
    fn begin_step(&mut self, hold: bool) {
        let inertial = self.layout().inertial();
        let at = self.theta.as_ref().get(inertial..).unwrap_or(&[]);
        let priors = self.prior.effects().iter().zip(at);
        for (n, (to, (from, at))) in self.near.effects_mut().iter_mut().zip(priors).enumerate() {
            *to = *from;
            if hold && self.held.contains(n) {
                to.prior.mean = if *at > real(from.lower) {
                    from.upper
                } else {
                    from.lower
                };
                to.prior.std *= 1e-4;
            }
        }
        self.stage = Stage::Expand { body: 0, hold };
    }

    /// Expands a body's prior about the present point; after the last, starts the inner solver.
    fn expand(&mut self, b: usize, hold: bool) {
        self.near.expand(b, &body(self.theta.as_ref(), b));
        if b + 1 < self.layout().bodies() {
            self.stage = Stage::Expand { body: b + 1, hold };
            return;
        }
        self.solver.restart(&self.near);
        self.stage = if hold { Stage::Step } else { Stage::Deviations };
    }

    /// Tries the Newton step, halved `halvings` times.
    fn search(&mut self, halvings: u32) {
        let held = self.try_step(real::<T>(0.5).powi(halvings as i32));
        let falls = match (
            self.cost(self.trial.as_ref()),
            self.cost(self.theta.as_ref()),
        ) {
            // A rise within rounding is the minimum.
            (Some(there), Some(here)) => {
                there <= here + here.abs() * T::default_epsilon() * real(64.0)
            }
            _ => false,
        };
        if !falls && halvings < MAX_HALVINGS {
            self.stage = Stage::Search {
                halvings: halvings + 1,
            };
            return;
        }
        let pairs = self
            .trial
            .as_ref()
            .iter()
            .zip(self.theta.as_ref())
            .zip(self.solver.std());
        let moved = pairs.fold(T::zero(), |most, ((to, from), std)| {
            most.max(((*to - *from) / *std).abs())
        });
        let mut changed = false;
        if falls {
            changed = held != self.held;
            self.held = held;
            core::mem::swap(&mut self.theta, &mut self.trial);
            changed |= self.release();
        }
        self.iterations += 1;
        let converged = (moved < real(CONVERGED) || !falls) && !changed;
        self.begin_step(!(converged || self.iterations >= MAX_ITERATIONS));
    }

    /// Writes the trial point, effects kept within their bounds; returns which of them are at one.
    fn try_step(&mut self, scale: T) -> Held {
        let inertial = self.layout().inertial();
        let from = self.theta.as_ref().iter().zip(self.solver.values());
        for (trial, (from, to)) in self.trial.as_mut().iter_mut().zip(from) {
            *trial = *from + (*to - *from) * scale;
        }
        let mut held = self.held;
        let trial = self.trial.as_mut().get_mut(inertial..).unwrap_or(&mut []);
        let from = self.theta.as_ref().get(inertial..).unwrap_or(&[]);
        for (n, (value, effect)) in trial.iter_mut().zip(self.prior.effects()).enumerate() {
            let (lower, upper) = (real::<T>(effect.lower), real::<T>(effect.upper));
            if self.held.contains(n) {
                *value = from.get(n).copied().unwrap_or(lower);
            } else if *value < lower || *value > upper {
                held.set(n, true);
                *value = value.max(lower).min(upper);
            }
        }
        held
    }

    /// Lets go of the effects whose cost falls away from their bound; true if there was one.
    fn release(&mut self) -> bool {
        let (layout, before) = (*self.layout(), self.held);
        for joint in 0..layout.bodies() {
            for e in 0..layout.effects(joint) {
                let k = layout.effect_index(joint, e);
                let n = k - layout.inertial();
                let (Some(EffectPrior { prior, lower, .. }), Some(value), true) = (
                    self.prior.effects().get(n),
                    self.theta.as_ref().get(k),
                    self.held.contains(n),
                ) else {
                    continue;
                };
                let (data, noise) = (self.solver.data(), self.solver.data().noise(joint));
                let slope = data.slope(joint, e, self.theta.as_ref()) / (noise * noise)
                    + (*value - real(prior.mean)) / real(prior.std * prior.std);
                let inwards = if *value > real(*lower) { -slope } else { slope };
                if inwards < T::zero() {
                    self.held.set(n, false);
                }
            }
        }
        self.held != before
    }
}

/// Body b of a limb's θ; no mass if θ ends before.
pub fn body<T: Real>(theta: &[T], b: usize) -> InertialParameters<T> {
    let at = |n: usize| theta.get(INERTIAL * b + n).copied().unwrap_or(T::zero());
    InertialParameters(core::array::from_fn(at).into())
}

#[cfg(test)]
mod tests;
