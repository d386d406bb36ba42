//! Which leg it is: when a trial begins, and what follows from its end.

use super::{LegData, LegLine};
use crate::Real;
use crate::app::wiring::{Model, Outcome, Said};
use crate::estimator::Change;
use crate::go2::{Leg, position_limits};
use crate::slot::Slot;
use crate::wire::{self, Wiring};

impl<T: Real> LegLine<T> {
    /// Whether what the leg says may be taken for its physics: its zeros are known, and its wiring is right.
    #[inline]
    pub(in crate::app) fn is_cleared(&self) -> bool {
        self.zeros.are_known() && self.trial.allows()
    }

    /// What is told of its wiring.
    pub(in crate::app) fn wiring(&self) -> Wiring {
        self.trial.known()
    }

    /// Begins a trial of a leg whose zeros were set; ends one where they are not known, or are none of a wiring's.
    pub(super) fn try_anew(&mut self) {
        match self.zeros.are_set() {
            true => self.trial.begin(false),
            false => self.trial.clear(),
        }
    }

    /// Takes the wiring to be right by the host's word; false if it is not on trial, or has a fault.
    pub(in crate::app) fn trust_wiring(&mut self, data: &mut LegData<T>) -> bool {
        let trusted = self.trial.trust();
        if trusted {
            self.accept_withheld(data);
        }
        trusted
    }

    /// Accepts the change that has waited for the end of a trial, if one has: the wiring is none of its causes.
    fn accept_withheld(&mut self, data: &mut LegData<T>) {
        if self.trial.is_of_a_change()
            && let Some((told, change)) = data.withheld.take()
        {
            self.accept(data, told, change);
        }
    }

    /// Has a change wait until a trial has found that it is none of the wiring's; false if the leg is not tried.
    pub(super) fn withhold(
        &mut self,
        data: &mut LegData<T>,
        told: wire::Change,
        change: Change<T>,
    ) -> bool {
        if !self.zeros.are_set() {
            return false;
        }
        let waiting = data.folds.drop_waiting() as u32;
        self.counters.forgotten = self.counters.forgotten.wrapping_add(waiting);
        data.test.begin_block();
        data.withheld = Slot::Full((told, change));
        self.trial.begin(true);
        true
    }

    /// Whether a part of a trial waits to be done.
    #[inline]
    pub(in crate::app) fn waits_for_trial(&self) -> bool {
        self.trial.is_ready()
    }

    /// Does it; whether there is something new to be told. `work` is the solver's storage.
    #[inline(never)]
    pub(in crate::app) fn try_on(
        &mut self,
        data: &mut LegData<T>,
        which: Leg,
        carried: bool,
        work: &mut [T],
    ) -> bool {
        let Some(window) = self.window.get() else {
            return false;
        };
        let said = Said {
            angles: *self.zeros.angles(),
            reversed: self.alignment.reversed(),
        };
        let model = Model {
            frame: window.frame(),
            base: &data.base,
            said,
            stops: position_limits(which),
        };
        let notes = &mut data.notes;
        let outcome = self.trial.advance(&model, carried, notes, work);
        if outcome == Outcome::Cleared {
            self.accept_withheld(data);
        }
        outcome != Outcome::Nothing
    }
}
