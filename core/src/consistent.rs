//! The physically consistent solution: every body one that could exist, every friction and rotor inertia ≥ 0.
//!
//! The cost is that of the factors plus, per body, the prior that is infinite at the edge of what is physical
//! ([`InertialParameters::divergence_near`]), plus each effect's own prior:
//!
//! ```text
//! Σ_j ‖R_j θ − z_j‖² / σ_j²  +  Σ_b (2/s²) (tr(P₀⁻¹P_b) − log det(P₀⁻¹P_b) − 4)  +  Σ_e ((x_e − μ_e)/s_e)²,    x_e ≥ lower
//! ```
//!
//! Each term is convex in θ, so the minimum is unique and every start finds it. The data are merged once and leave, the effects taken as
//! is best with each, a triangle over the bodies alone; each Newton step adds the bodies' priors to it, expanded about where the last step
//! ended ([`Descent`]): a tenth of the ordinary solution ([`Solver`]). A step that leaves the physical bodies or
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
//! use proprio_core::factor::{FactorError, packed_len};
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
//! let bodies = [0.0; packed_len(LIMB.inertial())];
//! let mut consistent = ConsistentSolver::new(&prior, Solver::new(data, storage), theta, bodies);
//! consistent.solve(&data)?;
//! assert!(body(consistent.values(), 0).is_physical() && consistent.values()[10] >= 0.0);
//! # Ok::<(), FactorError>(())
//! ```

mod descent;

pub use descent::{Descent, Held, MAX_ITERATIONS};

use crate::estimator::{
    EFFECTS, EffectPrior, JointFactors, LEG, LEG_INERTIAL, LEG_PARAMETERS, LegVector, LimbPrior,
    Solver, solver_len,
};
use crate::factor::{FactorError, packed_len};
use crate::inertia::barrier::Root;
use crate::inertia::{INERTIAL, InertialParameters};
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::{Real, scalar::real};

/// The consistent solution of a limb, in steps of bounded cost.
///
/// `D` and `S` store what [`Solver`] needs, `V` stores θ, `W` the bodies' triangle ([`packed_len`] of their parameters), `E` the effects'
/// priors.
#[derive(Clone, Debug)]
pub struct ConsistentSolver<T: Real, D, S, V, W, E, const B: usize> {
    prior: LimbPrior<T, E, B>,
    solver: Solver<T, D, S, B>,
    descent: Descent<T, V, W>,
}

/// The consistent solution of a leg of hip, thigh and calf.
pub type LegConsistentSolver<T> = ConsistentSolver<
    T,
    [T; LEG.packed_len()],
    [T; solver_len(LEG_PARAMETERS)],
    LegVector<T>,
    [T; packed_len(LEG_INERTIAL)],
    [EffectPrior; EFFECTS.len() * JOINTS_PER_LEG],
    JOINTS_PER_LEG,
>;

impl<T, D, S, V, W, E, const B: usize> ConsistentSolver<T, D, S, V, W, E, B>
where
    T: Real,
    D: AsRef<[T]> + AsMut<[T]> + Clone,
    S: AsRef<[T]> + AsMut<[T]>,
    V: AsRef<[T]> + AsMut<[T]> + Clone,
    W: AsRef<[T]> + AsMut<[T]>,
    E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]> + Clone,
{
    /// A solver for a limb with this prior; `theta` holds as many numbers as the limb has parameters, `bodies` [`packed_len`] of its
    /// inertial ones.
    pub fn new(
        prior: &LimbPrior<T, E, B>,
        solver: Solver<T, D, S, B>,
        theta: V,
        bodies: W,
    ) -> Self {
        Self {
            prior: prior.clone(),
            solver,
            descent: Descent::new(theta.clone(), theta, bodies),
        }
    }

    /// Begins the solution for `data` (copied) at the CAD's bodies.
    pub fn start(&mut self, data: &JointFactors<T, D, B>) {
        self.start_at(data, &self.prior.cad().clone());
    }

    /// Begins at any physical bodies; where one is not physical, at the CAD's.
    pub fn start_at(&mut self, data: &JointFactors<T, D, B>, bodies: &[InertialParameters<T>; B]) {
        self.solver.data_mut().copy_from(data);
        let effects = |n: usize| {
            let effect = self.prior.effects().get(n);
            effect.map_or(T::zero(), |effect| real(effect.prior.mean))
        };
        self.descent
            .start(&self.prior, &mut self.solver, bodies, effects, Held::NONE);
    }

    /// Does the next bounded piece of work; true when the solution is new, and from then on.
    ///
    /// # Errors
    /// [`FactorError`] as of [`Solver::advance`].
    pub fn advance(&mut self) -> Result<bool, FactorError> {
        self.descent.advance(&self.prior, &mut self.solver)
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
        self.descent.theta()
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
        self.descent.iterations()
    }

    /// Effects that the data would have beyond their bound.
    pub fn held(&self) -> Held {
        self.descent.held()
    }

    /// The cost of any θ (see the module); `None` where a body is not physical.
    pub fn cost(&self, theta: &[T]) -> Option<T> {
        let (layout, data) = (self.solver.layout(), self.solver.data());
        let mut cost = T::zero();
        for joint in 0..layout.bodies() {
            let noise = data.noise(joint);
            cost += data.sum_of_squares(joint, theta) / (noise * noise);
            let root = Root::of(&body(theta, joint));
            if !root.is_physical() {
                return None;
            }
            cost += self.prior.body_cost(joint, &root);
        }
        let effects = theta.get(layout.inertial()..)?;
        for (value, EffectPrior { prior, .. }) in effects.iter().zip(self.prior.effects()) {
            let off = (*value - real(prior.mean)) / real(prior.std);
            cost += off * off;
        }
        Some(cost)
    }
}

/// Whether all bodies of θ could exist and all effects are within their bounds; the same instructions whatever θ is.
pub(crate) fn is_consistent<T: Real, E, const B: usize>(
    prior: &LimbPrior<T, E, B>,
    theta: &[T],
) -> bool
where
    E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
{
    let physical = (0..B).fold(true, |all, b| all & Root::of(&body(theta, b)).is_physical());
    let effects = theta.get(INERTIAL * B..).unwrap_or(&[]);
    let effects = effects.iter().zip(prior.effects());
    effects.fold(physical, |all, (x, EffectPrior { lower, upper, .. })| {
        all & (*x >= real(*lower)) & (*x <= real(*upper))
    })
}

/// Body b of a limb's θ; no mass if θ ends before.
pub fn body<T: Real>(theta: &[T], b: usize) -> InertialParameters<T> {
    let at = |n: usize| theta.get(INERTIAL * b + n).copied().unwrap_or(T::zero());
    InertialParameters(core::array::from_fn(at).into())
}

#[cfg(test)]
mod tests;
