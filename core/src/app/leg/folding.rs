//! From closed windows to a leg's factors, in blocks of time: at the end of a block it is judged whether the leg has changed in it, and what a
//! change has touched is forgotten.

use super::{LegData, LegLine, increment};
use crate::Real;
use crate::app::messages::single;
use crate::app::support::Support;
use crate::estimator::{Change, ChangeKind, Verdict};
use crate::scalar::{exp_minus, real};
use crate::slot::Slot;
use crate::wire;

/// Directions that a step forgets: each costs a fifth of a fold.
const STEP_DIRECTIONS: usize = 2;

impl<T: Real> LegLine<T> {
    /// Whether as many windows wait as are folded in together, or the first of another block of time does: all legs' blocks end at once,
    /// and to judge, look and fold when all are full would take more steps than a window has.
    pub(in crate::app) fn is_due(data: &LegData<T>) -> bool {
        data.folds.is_full() || data.folds.is_new_block()
    }

    /// Whether a change is being forgotten: nothing is folded in or gathered meanwhile.
    pub(in crate::app) fn is_forgetting(&self) -> bool {
        self.forgetting.get().is_some()
    }

    /// A step of what is due: goes on forgetting, closes a block of time, looks at the windows that wait, or folds them in. False
    /// if no window waits and nothing is forgotten.
    #[inline(never)]
    pub(in crate::app) fn fold_on(&mut self, data: &mut LegData<T>) -> bool {
        if self.is_forgetting() {
            self.forget(data);
        } else if self.spoilt {
            self.leave_out_spoilt(data);
        } else if data.folds.waiting() == 0 {
            return false;
        } else if !self.close_block(data) {
            if data.test.has_seen(&data.folds) {
                self.fold_waiting(data);
            } else {
                data.test.look(&data.folds, &data.base);
            }
        }
        true
    }

    /// Folds the windows that wait into the factors, whatever it takes.
    pub(in crate::app) fn fold(&mut self, data: &mut LegData<T>) {
        if !self.is_forgetting() {
            self.close_block(data);
        }
        if !self.is_forgetting() {
            self.fold_waiting(data);
        }
    }

    #[inline(never)]
    fn fold_waiting(&mut self, data: &mut LegData<T>) {
        let waiting = data.folds.waiting();
        if waiting == 0 {
            return;
        }
        let counter = match data.test.fold(&mut data.folds, &data.base) {
            Ok(()) => &mut self.counters.windows,
            Err(_) => &mut self.counters.unfolded,
        };
        *counter = counter.wrapping_add(waiting as u32);
    }

    /// Leaves out the present block and what waits to be folded in.
    fn leave_out_spoilt(&mut self, data: &mut LegData<T>) {
        self.spoilt = false;
        self.stale = true;
        let windows = data.folds.drop_waiting() as u32 + single(data.folds.restore()) as u32;
        self.counters.carried = self.counters.carried.wrapping_add(windows);
        data.test.begin_block();
    }

    /// Closes the block of time before what waits, if it is another: looks whether the leg has changed in it, and begins the
    /// next. False if it is the same.
    #[inline(never)]
    pub(in crate::app) fn close_block(&mut self, data: &mut LegData<T>) -> bool {
        if !data.folds.is_new_block() {
            return false;
        }
        match data.test.judge(&data.folds) {
            Verdict::Changed(change) => self.find(data, change),
            Verdict::Doubtful => {
                self.leave_out(data);
                self.begin_block(data);
            }
            Verdict::Same => self.begin_block(data),
        }
        true
    }

    fn begin_block(&mut self, data: &mut LegData<T>) {
        let [start, end] = data.folds.block_span();
        let length = (end - start) as f64 * 1e-6;
        let retention = match self.memory_s {
            0 => T::one(),
            seconds => exp_minus(real(length / f64::from(seconds))),
        };
        data.folds.begin_block(retention);
        data.test.begin_block();
    }

    /// Takes the block that is at its end out again.
    fn leave_out(&mut self, data: &mut LegData<T>) {
        let windows = single(data.folds.restore()) as u32;
        self.counters.forgotten = self.counters.forgotten.wrapping_add(windows);
        self.stale = true;
    }

    /// Takes note of a change in the block that is at its end.
    fn find(&mut self, data: &mut LegData<T>, change: Change<T>) {
        let [start, time_us] = data.folds.block_span();
        let since_us = start.saturating_sub((change.blocks - 1) * (time_us - start));
        let told = wire::Change {
            leg: 0,
            joint: change.joint as u8,
            kind: match change.kind {
                ChangeKind::Bias => wire::ChangeKind::Bias,
                ChangeKind::Friction => wire::ChangeKind::Friction,
                ChangeKind::Load => wire::ChangeKind::Load,
            },
            size: single(change.size),
            since_us,
            time_us,
        };
        self.leave_out(data);
        if !self.withhold(data, told, change) {
            self.accept(data, told, change);
        }
    }

    /// Tells of a change, and begins to forget what it has touched.
    pub(super) fn accept(&mut self, data: &mut LegData<T>, told: wire::Change, change: Change<T>) {
        self.changed = Slot::Full(told);
        increment(&mut self.counters.changes);
        if let Some(prior) = self.prior.get_mut()
            && let Some(body) = prior.cad().get(change.joint).copied()
            && let Some(uncertainty) = change.uncertainty(body.mass())
        {
            prior.loosen(change.joint, uncertainty);
            data.base.set_uncertainty(prior.uncertainty());
        }
        self.forgetting = Slot::Full((change, 0));
    }

    /// Goes on forgetting what a change has touched; after the last of it the next block begins.
    fn forget(&mut self, data: &mut LegData<T>) {
        let Slot::Full((change, done)) = &mut self.forgetting else {
            return;
        };
        for _ in 0..STEP_DIRECTIONS {
            if !change.forget(*done, &mut data.folds, &data.base) {
                self.forgetting = Slot::Empty;
                self.begin_block(data);
                return;
            }
            *done += 1;
        }
    }

    /// The change to be told, once.
    pub(in crate::app) fn take_change(&mut self, leg: usize) -> Option<wire::Change> {
        let change = self.changed.take()?;
        Some(wire::Change {
            leg: leg as u8,
            ..change
        })
    }

    /// What the calf says of a force at the foot.
    pub(in crate::app) fn support(&self) -> &Support<T> {
        &self.support
    }

    /// Takes note of whether the feet carry the robot. As they begin to, what came shortly before is not of a robot that hangs either.
    pub(in crate::app) fn set_carried(&mut self, carried: bool) {
        self.spoilt |= carried && !self.carried;
        self.carried = carried;
    }

    /// Whether the present block and what waits are to be left out.
    pub(in crate::app) fn is_spoilt(&self) -> bool {
        self.spoilt
    }
}
