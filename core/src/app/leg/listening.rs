//! From a leg's bus to its closed windows: bytes wait in a queue, a step takes as many as it has time for, and makes samples of them.

use super::{LegData, LegLine, increment};
use crate::Real;
use crate::app::LISTENING;
use crate::go2::JOINTS_PER_LEG;
use crate::window::{Push, Sample, Settings};

/// A motor answers when it is asked: the same numbers again are a measurement, not a message read twice.
pub(in crate::app) const SETTINGS: Settings = Settings {
    skip_repeated: false,
    ..Settings::DEFAULT
};

/// What a step takes off one bus at most, in bytes of good frames: nearly what a bus without a pause brings in 2 ms; and
/// what a step does that folds as well, one in ten.
pub(in crate::app) const STEP_EFFORT: usize = 700;
pub(in crate::app) const FOLDING_EFFORT: usize = 400;
/// Samples of a leg in one step at most: a bus polled at 1 kHz.
const STEP_SAMPLES: usize = 2;
/// What listening costs by estimate, instructions: a byte of a good frame, a sample.
const EFFORT_COST: usize = 13;
const SAMPLE_COST: usize = 3600;
/// A queue that is behind: what waits is moved to make room.
const BEHIND_COST: usize = 8000;

impl<T: Real> LegLine<T> {
    /// Takes what the bus brought until `end_us`, each byte `byte_ns` after the one before.
    pub(in crate::app) fn hear(data: &mut LegData<T>, bytes: &[u8], end_us: u64, byte_ns: u32) {
        data.queue.push(bytes, end_us, byte_ns);
    }

    /// Makes samples of what the bus brought, `most` bytes at most; the rest waits. What it cost by estimate, instructions.
    #[inline(never)]
    pub(in crate::app) fn listen(&mut self, data: &mut LegData<T>, most: usize) -> usize {
        let (mut effort, mut samples) = (most, 0);
        while (samples < STEP_SAMPLES || data.queue.is_behind()) && !data.queue.is_empty() {
            let Some(listener) = self.listener.get_mut() else {
                break;
            };
            let Some(cycle) = listener.next(&mut data.queue, &mut effort) else {
                break;
            };
            if samples < STEP_SAMPLES {
                samples += 1;
                let sample = self.alignment.sample(cycle, SETTINGS.max_gap_us);
                if listener.is_broken() || self.alignment.was_silent() {
                    self.note_breaks();
                }
                self.push(data, &sample);
            } else {
                // What waits would be lost in the end, in the middle of a frame.
                increment(&mut self.surplus);
                listener.discard();
            }
        }
        let moved = if data.queue.is_behind() {
            BEHIND_COST
        } else {
            0
        };
        if self.voided {
            // The step has to say so, and does nothing else: see its caller.
            return LISTENING + 1;
        }
        (most - effort) * EFFORT_COST + samples * SAMPLE_COST + moved
    }

    /// Puts a sample into the window. Not inlined: in a loop, the window's addresses would all be kept, which costs more.
    #[inline(never)]
    fn push(&mut self, data: &mut LegData<T>, sample: &Sample<T, JOINTS_PER_LEG>) {
        let Some(window) = self.window.get_mut() else {
            return;
        };
        let counters = &mut self.counters;
        increment(&mut counters.samples);
        if !self.zeros.are_known() {
            increment(&mut counters.unplaced);
            return;
        }
        if self.trial.is_running() {
            return self.try_sample(data, sample);
        }
        let pushed = window.push(sample);
        self.note(data, pushed, sample);
    }

    /// Counts a sample, and takes the rows of the window that it has closed.
    #[inline(always)]
    fn note(&mut self, data: &mut LegData<T>, pushed: Push, sample: &Sample<T, JOINTS_PER_LEG>) {
        let counters = &mut self.counters;
        match pushed {
            Push::Used => increment(&mut counters.used),
            Push::Closed => {
                increment(&mut counters.used);
                self.take(data, &sample.q);
            }
            Push::Gap => {
                increment(&mut counters.used);
                increment(&mut counters.gaps);
            }
            Push::Late | Push::Repeated => increment(&mut counters.late),
            Push::Rejected(_) => increment(&mut counters.rejected),
        }
    }

    /// The same of a leg on trial, which sees the sample too. Apart: any other leg pays for a look at a flag.
    #[cold]
    #[inline(never)]
    fn try_sample(&mut self, data: &mut LegData<T>, sample: &Sample<T, JOINTS_PER_LEG>) {
        if let Some(window) = self.window.get_mut() {
            let pushed = window.push(sample);
            self.trial
                .see(pushed, sample, window.rows(), &mut data.notes);
            self.note(data, pushed, sample);
        }
    }

    /// Lays the rows of the closed window by, to be folded in with others.
    fn take(&mut self, data: &mut LegData<T>, q: &[T; JOINTS_PER_LEG]) {
        if let Some(window) = self.window.get() {
            self.support.see(window.rows(), q);
        }
        if !self.trial.allows() {
            increment(&mut self.counters.tried);
            return;
        }
        if self.carried {
            increment(&mut self.counters.carried);
            return;
        }
        // Steps so long that the turn to fold did not come.
        if data.folds.is_full() {
            self.fold(data);
        }
        let Some(window) = self.window.get() else {
            return;
        };
        if data.folds.is_full() {
            // The factors are not what they should be before a change is forgotten.
            increment(&mut self.counters.forgotten);
        } else if data.folds.take(window.rows()).is_err() {
            increment(&mut self.counters.unfolded);
        }
    }

    /// Counts what a bus brought that nobody listens to.
    pub(in crate::app) fn count_unheard(&mut self, bytes: usize) {
        let unheard = &mut self.counters.unheard_bytes;
        *unheard = unheard.wrapping_add(bytes as u32);
    }
}
