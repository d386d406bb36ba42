//! What is believed of a leg before any data: its effects, how well its bodies are known, how long data are remembered. The host sets it,
//! and a snapshot brings it back.

use super::{LegData, LegLine};
use crate::Real;
use crate::estimator::{Active, Beliefs, COLUMNS};
use crate::go2::{ACTUATORS, JOINTS_PER_LEG};
use crate::scalar::real;

/// How well a host may say that a body is known: from a thousandth, where the prior still leaves rounding alone, to nothing.
const UNCERTAINTIES: core::ops::RangeInclusive<f32> = 1e-3..=1e2;

impl<T: Real> LegLine<T> {
    /// Has data of so many seconds ago weigh 1/e from the next block on; 0: as much as new ones.
    pub(in crate::app) fn set_memory(&mut self, seconds: u32) {
        self.memory_s = seconds;
    }

    /// Adds an effect of [`crate::estimator::COLUMNS`] to a joint's model, or drops it; false if that is how it was.
    pub(in crate::app) fn set_effect(&mut self, joint: usize, effect: usize, active: bool) -> bool {
        if self.active.has(joint, effect) == active {
            return false;
        }
        self.active.set(joint, effect, active);
        if let Some(prior) = self.prior.get_mut() {
            prior.activate(&self.active, &self.beliefs, &ACTUATORS);
        }
        true
    }

    /// Believes something else of an effect's parameter than the catalogue; false if it cannot be ([`Beliefs::set`]).
    pub(in crate::app) fn believe(
        &mut self,
        joint: usize,
        effect: usize,
        mean: f32,
        std: f32,
    ) -> bool {
        let possible = self.beliefs.set(joint, effect, mean, std);
        if let (true, Some(prior)) = (possible, self.prior.get_mut()) {
            prior.activate(&self.active, &self.beliefs, &ACTUATORS);
        }
        possible
    }

    /// Takes a body to be within `uncertainty` of the CAD's; false if that is not within [`UNCERTAINTIES`].
    #[inline(never)]
    pub(in crate::app) fn know_body(
        &mut self,
        data: &mut LegData<T>,
        body: usize,
        uncertainty: f32,
    ) -> bool {
        let possible = UNCERTAINTIES.contains(&uncertainty);
        if let (true, Some(prior)) = (possible, self.prior.get_mut()) {
            prior.set_uncertainty(body, real(uncertainty.into()));
            data.base.set_uncertainty(prior.uncertainty());
        }
        possible
    }

    /// How well a body is known, relative to the CAD's.
    pub(in crate::app) fn uncertainty(&self, body: usize) -> Option<T> {
        self.prior.get()?.uncertainty().get(body).copied()
    }

    /// Which effects the joints' models have.
    pub(in crate::app) fn active(&self) -> &Active {
        &self.active
    }

    /// What the host has said of effects.
    pub(in crate::app) fn beliefs(&self) -> &Beliefs {
        &self.beliefs
    }

    /// The joints' noise by the last solution, N m.
    pub(in crate::app) fn noise(&self) -> &[T; JOINTS_PER_LEG] {
        &self.noise
    }

    /// Data of so many seconds ago weigh 1/e; 0: as much as new ones.
    pub(in crate::app) fn memory_s(&self) -> u32 {
        self.memory_s
    }

    /// Takes a body's uncertainty from a snapshot.
    pub(in crate::app) fn restore_uncertainty(&mut self, body: usize, uncertainty: T) {
        if let (true, Some(prior)) = (uncertainty > T::zero(), self.prior.get_mut()) {
            prior.set_uncertainty(body, uncertainty);
        }
    }

    /// Takes a joint's effects from a snapshot.
    pub(in crate::app) fn restore_active(&mut self, joint: usize, effects: u32) {
        (0..COLUMNS.len()).for_each(|n| self.active.set(joint, n, effects >> n & 1 == 1));
    }

    /// Takes one number of what is believed from a snapshot.
    pub(in crate::app) fn restore_belief(&mut self, n: usize, number: f32) {
        self.beliefs.set_number(n, number);
    }

    /// Takes a joint's noise from a snapshot, N m.
    pub(in crate::app) fn restore_noise(&mut self, joint: usize, noise: T) {
        if let Some(place) = self.noise.get_mut(joint) {
            *place = noise;
        }
    }

    /// Goes on with what was taken from a snapshot.
    pub(in crate::app) fn restored(&mut self, data: &mut LegData<T>) {
        if let Some(prior) = self.prior.get_mut() {
            prior.activate(&self.active, &self.beliefs, &ACTUATORS);
            data.base.set_uncertainty(prior.uncertainty());
        }
    }
}
