//! From a leg's factors to its solution, in parts: what is folded in is gathered, solved freely, and, where that could not be, brought to the
//! likeliest solution that could.

use super::{LegData, LegLine, increment};
use crate::Real;
use crate::consistent::{Held, body, is_consistent};
use crate::estimator::{Active, DeviceDescent, DeviceSolver, Gather, LEG_INERTIAL, MAX_EFFECTS};
use crate::factor::FactorError;

/// A step of gathering ends where its cost would come beyond this, in numbers rotated.
const STEP_COST: usize = 1600;

impl<T: Real> LegLine<T> {
    /// Begins to gather what is folded in.
    pub(in crate::app) fn gather(
        &mut self,
        data: &LegData<T>,
        gather: &mut Gather<T>,
        solver: &mut DeviceSolver<T>,
    ) {
        self.stale = false;
        gather.start(&self.active, &data.folds, solver);
    }

    /// Goes on gathering; true when the solution has begun.
    pub(in crate::app) fn gather_on(
        &mut self,
        data: &LegData<T>,
        gather: &mut Gather<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<bool, FactorError> {
        if self.is_forgetting() {
            return Ok(false);
        }
        if self.stale {
            // Half of what is gathered is of the leg before it changed: once more.
            self.stale = false;
            gather.start(&self.active, &data.folds, solver);
            return Ok(false);
        }
        // The prior takes a step of its own.
        if !gather.is_done() {
            gather.advance(STEP_COST, &data.folds, &data.base, solver)?;
            return Ok(false);
        }
        match self.prior.get() {
            Some(prior) if *gather.active() == self.active => solver.restart(prior),
            // The host has changed the model meanwhile: once more.
            _ => {
                gather.start(&self.active, &data.folds, solver);
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Takes note of a solution: of the joints' noise, and of what the next block is to be judged by.
    pub(in crate::app) fn learn(
        &mut self,
        data: &mut LegData<T>,
        solver: &DeviceSolver<T>,
        active: &Active,
    ) {
        self.noise = *solver.noise();
        // One of the leg before it changed says nothing of it.
        if !self.stale {
            data.test.learn(solver.values(), active, &data.base);
        }
    }

    /// Whether what was gathered is no longer what the factors hold.
    pub(in crate::app) fn is_stale(&self) -> bool {
        self.stale
    }

    /// Whether all bodies of a solution could exist and all effects are within their bounds.
    #[inline(never)]
    pub(in crate::app) fn is_consistent(&self, solver: &DeviceSolver<T>) -> bool {
        let prior = self.prior.get();
        prior.is_none_or(|prior| is_consistent(prior, solver.values()))
    }

    /// Begins the consistent solution of what has been solved freely, at the last one's bodies.
    pub(in crate::app) fn descend(
        &mut self,
        descent: &mut DeviceDescent<T>,
        solver: &mut DeviceSolver<T>,
    ) {
        let Some(prior) = self.prior.get() else {
            return;
        };
        let mut effects = [T::zero(); MAX_EFFECTS];
        let free = solver.values().get(LEG_INERTIAL..).unwrap_or(&[]);
        let pairs = effects.iter_mut().zip(free);
        pairs.for_each(|(to, from)| *to = *from);
        let effect = |n: usize| effects.get(n).copied().unwrap_or(T::zero());
        let held = match self.held {
            (held, of) if of == self.active => held,
            _ => Held::NONE,
        };
        descent.start(prior, solver, &self.bodies, effect, held);
    }

    /// Goes on with it; true when the solver has it.
    pub(in crate::app) fn descend_on(
        &mut self,
        descent: &mut DeviceDescent<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<bool, FactorError> {
        let Some(prior) = self.prior.get() else {
            return Ok(true);
        };
        let done = descent.advance(prior, solver)?;
        if done {
            self.bodies = core::array::from_fn(|b| body(descent.theta(), b));
            self.held = (descent.held(), self.active);
        }
        Ok(done)
    }

    pub(in crate::app) fn count_unsolved(&mut self) {
        increment(&mut self.counters.unsolved);
    }
}
