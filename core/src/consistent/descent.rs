//! The way down to the least cost, from any physical bodies, in steps of bounded cost; see [`super`].

use super::body;
use crate::estimator::{EffectPrior, LimbPrior, Solver};
use crate::factor::{Factor, FactorError, block_cost};
use crate::inertia::barrier::Root;
use crate::inertia::{INERTIAL, InertialParameters};
use crate::{Real, scalar::real};

/// Newton steps that a solution may take. 3 from the CAD on simulated motions; fewer than this from twenty random starts.
pub const MAX_ITERATIONS: usize = 25;

/// How often a step may be halved.
const MAX_HALVINGS: u32 = 30;

/// A full Newton step over which the cost bends by less than this squared is the last. Of a self-concordant cost what is then left bends it by
/// less than the square of that (Boyd & Vandenberghe §9.6.4): no parameter, nor a combination of them, is off by more than 10⁻⁵ of its
/// standard deviation.
const CONVERGED: f64 = 3e-3;

/// A step that is shorter than this, and does not lower the cost, is rounding.
const ROUNDING: f64 = 1e-4;

/// Where the ten rows of a body's prior cost more than this to add ([`block_cost`]), the first six have a step of their own.
const STEP_COST: usize = 2000;

/// Effects, by their place in θ behind the inertial ones, that are held at a bound.
///
/// A limb may have up to 128.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Held(u128);

impl Held {
    /// None.
    pub const NONE: Self = Self(0);

    /// Whether effect parameter n is held.
    pub fn contains(self, n: usize) -> bool {
        n < 128 && self.0 >> n & 1 == 1
    }

    /// Whether none is.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    fn set(&mut self, n: usize, held: bool) {
        let bit = 1_u128.checked_shl(n as u32).unwrap_or(0);
        self.0 = if held { self.0 | bit } else { self.0 & !bit };
    }
}

/// The consistent solution of a limb, without the limb's prior and [`Solver`], which who has them lends to every step: a microcontroller
/// has one solver for all its legs.
///
/// `V` stores θ, or more numbers; `W` [`packed_len`](crate::factor::packed_len) of the bodies' parameters.
#[derive(Clone, Debug)]
pub struct Descent<T, V, W> {
    theta: V,
    trial: V,
    /// The triangle over the bodies: what the data say, their priors expanded about θ.
    bodies: W,
    held: Held,
    /// The cost at θ.
    cost: T,
    iterations: usize,
    stage: Stage,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    // First, so that one which has done nothing is all zeros.
    Done,
    /// The solver merges the data, effects at a bound held there.
    Merge,
    /// The cost at the present point.
    Weigh,
    /// A body's prior is expanded, and these rows of it are added; after the last, the Newton step is found.
    Expand {
        rows: usize,
    },
    /// The step is tried, halved this many times.
    Search {
        halvings: u32,
    },
    /// Which effects the cost would have leave their bound: after a full step, and at the minimum.
    Release {
        converged: bool,
    },
    /// The solver merges the data, no effect held.
    Free,
    /// A body's prior is expanded about the minimum.
    Know {
        rows: usize,
    },
    /// The solver finds the standard deviations.
    Deviations,
}

impl<T, V, W> Descent<T, V, W>
where
    T: Real,
    V: AsRef<[T]> + AsMut<[T]>,
    W: AsRef<[T]> + AsMut<[T]>,
{
    /// Of a limb with so many parameters as `theta` and `trial` have numbers, or fewer; `bodies` holds
    /// [`packed_len`](crate::factor::packed_len) of the inertial ones. All zeros.
    pub const fn new(theta: V, trial: V, bodies: W) -> Self {
        Self {
            theta,
            trial,
            bodies,
            held: Held(0),
            cost: T::ZERO,
            iterations: 0,
            stage: Stage::Done,
        }
    }

    /// Begins the solution of the data that `solver` holds, at any physical bodies and effects; where a body is not physical, at the CAD's;
    /// where an effect is beyond a bound, there. `held` are held at their lower bound at first, as they were in a solution like this one.
    pub fn start<D, S, E, const B: usize>(
        &mut self,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
        bodies: &[InertialParameters<T>; B],
        effect: impl Fn(usize) -> T,
        held: Held,
    ) where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        let layout = *solver.layout();
        self.held = Held::NONE;
        self.iterations = 0;
        let theta = self.theta.as_mut();
        let cad = bodies.iter().zip(prior.cad()).take(layout.bodies());
        for (to, (body, cad)) in theta.chunks_exact_mut(INERTIAL).zip(cad) {
            let physical = Root::of(body).is_physical();
            let from = if physical { body } else { cad };
            to.iter_mut()
                .zip(from.0.as_slice())
                .for_each(|(to, from)| *to = *from);
        }
        let effects = theta.get_mut(layout.inertial()..).unwrap_or(&mut []);
        for (n, (to, known)) in effects.iter_mut().zip(prior.effects()).enumerate() {
            let free = match held.contains(n) && known.lower.is_finite() {
                true => real(known.lower - 1.0),
                false => effect(n),
            };
            *to = free.max(real(known.lower)).min(real(known.upper));
            self.held.set(n, *to != free);
        }
        self.merge(prior, solver);
    }

    /// Does the next bounded piece of work, with the prior and the solver that it was begun with; true when the solver has the solution, and
    /// from then on. How many pieces there are depends on the data; what each costs does not.
    ///
    /// # Errors
    /// [`FactorError`] as of [`Solver::advance`]; what the solver had solved last it still has.
    pub fn advance<D, S, E, const B: usize>(
        &mut self,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) -> Result<bool, FactorError>
    where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        match self.stage {
            Stage::Merge if solver.advance()? => self.stage = Stage::Weigh,
            Stage::Weigh => {
                self.cost = cost(prior, solver, self.theta.as_ref()).0;
                self.expand_next(solver);
            }
            Stage::Expand { rows } => self.expand(rows, prior, solver)?,
            Stage::Search { halvings } => self.search(halvings, prior, solver)?,
            Stage::Release { converged } => self.release(converged, prior, solver),
            Stage::Free if solver.advance()? => self.stage = Stage::Know { rows: 0 },
            Stage::Know { rows } => self.know(rows, prior, solver)?,
            Stage::Deviations if solver.advance()? => self.stage = Stage::Done,
            Stage::Merge | Stage::Free | Stage::Deviations | Stage::Done => {}
        }
        Ok(self.stage == Stage::Done)
    }

    /// θ of the step reached.
    pub fn theta(&self) -> &[T] {
        self.theta.as_ref()
    }

    /// Newton steps that the solution took.
    pub fn iterations(&self) -> usize {
        self.iterations
    }

    /// Effects that the data would have beyond their bound.
    pub fn held(&self) -> Held {
        self.held
    }

    /// Begins to merge the data with the held effects at their places.
    fn merge<D, S, E, const B: usize>(
        &mut self,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        let inertial = solver.layout().inertial();
        let (held, at) = (self.held, self.theta.as_ref().get(inertial..));
        let at = |n: usize| at.and_then(|at| at.get(n)).copied();
        solver.merge_data(prior.effects().len(), |n| {
            match at(n).filter(|_| held.contains(n)) {
                Some(at) => prior.pin(n, at),
                None => prior.effect(n),
            }
        });
        self.stage = Stage::Merge;
    }

    /// Begins the next Newton step, with what the data say of the bodies.
    fn expand_next<D, S, const B: usize>(&mut self, solver: &Solver<T, D, S, B>)
    where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
    {
        let numbers = self.bodies.as_mut().iter_mut().zip(solver.reduced());
        numbers.for_each(|(to, from)| *to = from);
        self.stage = Stage::Expand { rows: 0 };
    }

    /// Adds rows of the bodies' priors, expanded about the present point, from these on; after the last, solves for the Newton step.
    fn expand<D, S, E, const B: usize>(
        &mut self,
        first: usize,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) -> Result<(), FactorError>
    where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        let layout = *solver.layout();
        let mut triangle = Factor::in_storage(layout.inertial(), self.bodies.as_mut())?;
        let (b, rows, next) = part(first, layout.bodies());
        if let Some(near) = prior.near(b, &body(self.theta.as_ref(), b)) {
            let near = near.get(rows).unwrap_or(&[]);
            solver.fold_body(b, near, Some(&mut triangle))?;
        }
        self.stage = if next < 2 * layout.bodies() {
            Stage::Expand { rows: next }
        } else {
            solver.step_to(&bodies(self.bodies.as_ref(), solver)?)?;
            Stage::Search { halvings: 0 }
        };
        Ok(())
    }

    /// Adds the bodies' priors to what the solver has merged, as [`expand`](Self::expand); after the last, takes the present point for the
    /// solution.
    fn know<D, S, E, const B: usize>(
        &mut self,
        first: usize,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) -> Result<(), FactorError>
    where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        let (count, theta) = (solver.layout().bodies(), self.theta.as_ref());
        let (b, rows, next) = part(first, count);
        if let Some(near) = prior.near(b, &body(theta, b)) {
            solver.fold_body(b, near.get(rows).unwrap_or(&[]), None)?;
        }
        self.stage = if next < 2 * count {
            Stage::Know { rows: next }
        } else {
            solver.settle(|k| theta.get(k).copied().unwrap_or(T::zero()));
            Stage::Deviations
        };
        Ok(())
    }

    /// Tries the Newton step, halved `halvings` times.
    fn search<D, S, E, const B: usize>(
        &mut self,
        halvings: u32,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) -> Result<(), FactorError>
    where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        let held = self.try_step(real::<T>(0.5).powi(halvings as i32), prior, solver);
        let (there, physical) = cost(prior, solver, self.trial.as_ref());
        // A rise within rounding is the minimum.
        let rounding = self.cost.abs() * T::default_epsilon() * real(64.0);
        let falls = physical && there <= self.cost + rounding;
        let (theta, trial) = (self.theta.as_ref(), self.trial.as_ref());
        let moved = solver.bend(&bodies(self.bodies.as_ref(), solver)?, |k| {
            match (trial.get(k), theta.get(k)) {
                (Some(to), Some(from)) => *to - *from,
                _ => T::zero(),
            }
        });
        let stalls = moved < real(ROUNDING * ROUNDING) || halvings >= MAX_HALVINGS;
        if !falls && !stalls {
            self.stage = Stage::Search {
                halvings: halvings + 1,
            };
            return Ok(());
        }
        let mut changed = false;
        if falls {
            changed = held != self.held;
            (self.held, self.cost) = (held, there);
            core::mem::swap(&mut self.theta, &mut self.trial);
        }
        self.iterations += 1;
        let last = halvings == 0 && moved < real(CONVERGED * CONVERGED);
        let converged = last || !falls;
        if self.iterations >= MAX_ITERATIONS {
            self.finish(prior, solver);
        } else if changed {
            self.merge(prior, solver);
        } else {
            self.stage = Stage::Release { converged };
            if self.held.is_empty() {
                self.go_on(converged, prior, solver);
            }
        }
        Ok(())
    }

    /// Writes the trial point, effects kept within their bounds; returns which of them are at one.
    fn try_step<D, S, E, const B: usize>(
        &mut self,
        scale: T,
        prior: &LimbPrior<T, E, B>,
        solver: &Solver<T, D, S, B>,
    ) -> Held
    where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        let layout = *solver.layout();
        let pairs = self.trial.as_mut().iter_mut().zip(self.theta.as_ref());
        for (k, (trial, from)) in pairs.take(layout.parameters()).enumerate() {
            *trial = *from + (solver.step(k) - *from) * scale;
        }
        let mut held = self.held;
        let inertial = layout.inertial();
        let trial = self.trial.as_mut().get_mut(inertial..).unwrap_or(&mut []);
        let from = self.theta.as_ref().get(inertial..).unwrap_or(&[]);
        let effects = trial.iter_mut().zip(from).zip(prior.effects());
        for (n, ((value, from), effect)) in effects.enumerate() {
            let (lower, upper) = (real::<T>(effect.lower), real::<T>(effect.upper));
            let within = value.max(lower).min(upper);
            let before = self.held.contains(n);
            held.set(n, before || within != *value);
            *value = if before { *from } else { within };
        }
        held
    }

    /// Lets go of the effects whose cost falls away from their bound; where there is none and the steps have converged, the present point is
    /// the minimum.
    fn release<D, S, E, const B: usize>(
        &mut self,
        converged: bool,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        let (layout, before) = (*solver.layout(), self.held);
        let (theta, slopes) = (self.theta.as_ref(), self.trial.as_mut());
        for joint in 0..layout.bodies() {
            let (noise, effects) = (solver.data().noise(joint), layout.effects(joint));
            let slopes = slopes.get_mut(..effects).unwrap_or(&mut []);
            solver.data().slopes(joint, theta, slopes);
            for (e, slope) in slopes.iter().enumerate() {
                let k = layout.effect_index(joint, e);
                let n = k - layout.inertial();
                let (Some(EffectPrior { prior, lower, .. }), Some(value)) =
                    (prior.effects().get(n), theta.get(k))
                else {
                    continue;
                };
                let slope = *slope / (noise * noise)
                    + (*value - real(prior.mean)) / real(prior.std * prior.std);
                let inwards = if *value > real(*lower) { -slope } else { slope };
                self.held
                    .set(n, self.held.contains(n) && inwards >= T::zero());
            }
        }
        if self.held != before {
            self.merge(prior, solver);
        } else {
            self.go_on(converged, prior, solver);
        }
    }

    /// Goes on to the next Newton step, or from the minimum to the standard deviations.
    fn go_on<D, S, E, const B: usize>(
        &mut self,
        converged: bool,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        if converged {
            self.finish(prior, solver);
        } else {
            self.expand_next(solver);
        }
    }

    /// Goes on to the standard deviations: those of what is known with no effect held.
    fn finish<D, S, E, const B: usize>(
        &mut self,
        prior: &LimbPrior<T, E, B>,
        solver: &mut Solver<T, D, S, B>,
    ) where
        D: AsRef<[T]> + AsMut<[T]> + Clone,
        S: AsRef<[T]> + AsMut<[T]>,
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        solver.merge_data(prior.effects().len(), |n| prior.effect(n));
        self.stage = Stage::Free;
    }
}

/// The cost of θ by the data that the solver has merged, and whether its bodies are physical.
fn cost<T, D, S, E, const B: usize>(
    prior: &LimbPrior<T, E, B>,
    solver: &mut Solver<T, D, S, B>,
    theta: &[T],
) -> (T, bool)
where
    T: Real,
    D: AsRef<[T]> + AsMut<[T]> + Clone,
    S: AsRef<[T]> + AsMut<[T]>,
    E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
{
    let mut physical = true;
    let mut cost = solver.misfit(|k| theta.get(k).copied().unwrap_or(T::zero()));
    for b in 0..solver.layout().bodies() {
        let root = Root::of(&body(theta, b));
        physical &= root.is_physical();
        cost += prior.body_cost(b, &root);
    }
    (cost, physical)
}

/// The triangle over the bodies of the limb that a solver solves.
fn bodies<'a, T, D, S, const B: usize>(
    storage: &'a [T],
    solver: &Solver<T, D, S, B>,
) -> Result<Factor<T, &'a [T]>, FactorError>
where
    T: Real,
    D: AsRef<[T]> + AsMut<[T]> + Clone,
    S: AsRef<[T]> + AsMut<[T]>,
{
    Factor::in_storage(solver.layout().inertial(), storage)
}

/// Which rows of a body's prior, by sixes, are added in one step, and how many sixes are then behind it: two for each body.
fn part(first: usize, bodies: usize) -> (usize, core::ops::Range<usize>, usize) {
    let (b, half) = (first / 2, first % 2);
    let width = INERTIAL * bodies.saturating_sub(b) + 1;
    let both = half == 0 && 2 * block_cost(width) <= STEP_COST;
    let end = if both { 2 } else { half + 1 };
    (b, half..end, 2 * b + end)
}
