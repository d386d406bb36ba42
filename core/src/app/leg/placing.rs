//! Where a leg's zeros are: what the host says, what the motors say, what a snapshot says.

use super::{LegData, LegLine};
use crate::Real;
use crate::app::zeros::{self, Done};
use crate::go2::{JOINTS_PER_LEG, Leg};
use crate::slot::Slot;
use crate::wire::{Outcome, Positions, SetZero, Zero};

impl<T: Real> LegLine<T> {
    /// What is told of the zeros.
    pub(in crate::app) fn zeros(&self) -> [Zero; JOINTS_PER_LEG] {
        self.zeros.told()
    }

    /// Whether a zero has become void since this was asked last.
    pub(in crate::app) fn take_voided(&mut self) -> bool {
        core::mem::take(&mut self.voided)
    }

    /// Takes note of motors that no longer count from where they did.
    #[cold]
    #[inline(never)]
    pub(super) fn note_breaks(&mut self) {
        if let Some(listener) = self.listener.get_mut() {
            let silent = self.alignment.take_silence();
            let voided = self.zeros.void::<T>(listener.take_breaks(), silent);
            if voided {
                self.try_anew();
            }
            self.voided |= voided;
        }
    }

    /// Takes positions to be angles, or counts whose zeros are still to be said: what was learnt is of others. False if they were angles.
    pub(in crate::app) fn set_positions(
        &mut self,
        data: &mut LegData<T>,
        positions: Positions,
    ) -> bool {
        if positions == Positions::Absolute && self.zeros() == [Zero::Absolute; JOINTS_PER_LEG] {
            return false;
        }
        self.zeros.set_positions(positions, &mut self.alignment);
        self.try_anew();
        self.forget_motion(data);
        true
    }

    /// Takes a joint's angle to be what the host says.
    pub(in crate::app) fn set_zero(
        &mut self,
        data: &mut LegData<T>,
        which: Leg,
        asked: &SetZero,
        now_us: u64,
    ) -> Outcome {
        let (listener, alignment) = (&self.listener, &mut self.alignment);
        match self.zeros.set(which, asked, listener, alignment, now_us) {
            Ok(Done::Same) => self.begin_window(),
            Ok(Done::Another) => self.forget_motion(data),
            Err(refused) => return refused,
        }
        self.try_anew();
        Outcome::Accepted
    }

    /// Takes the zeros to hold that were kept before a restart; false if there are none.
    pub(in crate::app) fn trust_zeros(&mut self) -> bool {
        let trusted = self.zeros.trust();
        if trusted {
            self.try_anew();
        }
        trusted
    }

    /// Has no window bridge the samples before and those to come.
    fn begin_window(&mut self) {
        if let Some(window) = self.window.get_mut() {
            window.clear();
        }
    }

    /// Forgets what was learnt of the leg, but not what is believed of it.
    fn forget_motion(&mut self, data: &mut LegData<T>) {
        self.begin_window();
        data.folds.clear();
        data.test.clear();
        self.forgetting = Slot::Empty;
        self.spoilt = false;
        self.stale = true;
    }

    /// The n-th number of the zeros in a snapshot.
    pub(in crate::app) fn zero_number(&self, n: usize) -> Option<f64> {
        self.zeros.number(&self.alignment, n)
    }

    /// The count where a joint's angle is 0, and whether its motor turns against it.
    #[cfg(test)]
    pub(in crate::app) fn zero_of(&self, joint: usize) -> (i32, bool) {
        self.alignment.zero(joint)
    }

    /// Takes it from a snapshot.
    pub(in crate::app) fn restore_zero(&mut self, n: usize, number: f64) {
        self.zeros.set_number(&mut self.alignment, n, number);
    }
}

/// Numbers of the zeros in a snapshot.
pub(in crate::app) const ZERO_NUMBERS: usize = zeros::NUMBERS;
