//! One leg's line: bus bytes, frames, samples, windows, factors.

use super::alignment::Alignment;
use super::diagnosis::Evidence;
use crate::Real;
use crate::bus::{Listener, Queue};
use crate::estimator::{
    Active, DEFAULT_ACTIVE, DeviceColumns, DeviceFolds, DevicePrior, DeviceSolver, DeviceWindow,
    Gather, LegBase, NOISE_GUESS, plausible,
};
use crate::factor::FactorError;
use crate::go2::{JOINTS_PER_LEG, Leg, leg};
use crate::scalar::real;
use crate::spatial::Transform;
use crate::window::{Push, Sample, Settings, Window};
use crate::wire::LegCounters;

/// A motor answers when it is asked: the same numbers again are a measurement, not a message read twice.
pub(super) const SETTINGS: Settings = Settings {
    skip_repeated: false,
    ..Settings::DEFAULT
};

/// What a step takes off one bus at most, in bytes of good frames: what a bus without a pause brings in 2 ms, and more.
const STEP_EFFORT: usize = 1000;
/// Samples of a leg in one step at most: a bus polled at 1 kHz.
const STEP_SAMPLES: usize = 2;
/// What listening costs by estimate, instructions: a byte of a good frame, a sample.
const EFFORT_COST: usize = 7;
const SAMPLE_COST: usize = 3900;
/// A queue that is behind: what waits is moved to make room.
const BEHIND_COST: usize = 8000;

/// A step of gathering ends at the first row that brings its cost here, in numbers rotated.
const STEP_COST: usize = 1200;

/// One leg's data: what is all zeros at first, and so needs no copy in a microcontroller's flash.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegData<T> {
    folds: DeviceFolds<T>,
    base: LegBase<T>,
    /// What the bus has brought and no step has taken yet.
    queue: Queue,
}

impl<T: Real> LegData<T> {
    /// No data.
    pub(super) const fn new() -> Self {
        Self {
            folds: DeviceFolds::empty(),
            base: LegBase::empty(),
            queue: Queue::new(),
        }
    }
}

/// One leg, from its bus to its factors.
pub(super) struct LegLine<T: Real> {
    listener: Listener,
    alignment: Alignment<T>,
    /// Cycles left out because more came than steps have time for.
    surplus: u32,
    /// `None` until the first [`Self::reset`], like the prior: neither can be a constant.
    window: Option<DeviceWindow<T>>,
    /// The window has closed and its rows are not in the factors yet.
    closed: bool,
    active: Active,
    prior: Option<DevicePrior<T>>,
    /// The joints' noise by the last solution, N m.
    noise: [T; JOINTS_PER_LEG],
    counters: LegCounters,
}

impl<T: Real> LegLine<T> {
    /// A line that listens to nothing yet.
    pub(super) const fn new() -> Self {
        Self {
            listener: Listener::new(),
            alignment: Alignment::new(),
            surplus: 0,
            window: None,
            closed: false,
            active: DEFAULT_ACTIVE,
            prior: None,
            noise: [T::ZERO; JOINTS_PER_LEG],
            counters: LegCounters::ZERO,
        }
    }

    /// Begins anew, in place: a line is larger than a microcontroller's stack. `work` is space for the analysis of the leg.
    pub(super) fn reset(&mut self, which: Leg, data: &mut LegData<T>, work: &mut [T]) {
        self.listener = Listener::new();
        self.alignment = Alignment::new();
        self.surplus = 0;
        data.queue.clear();
        self.open(which);
        self.closed = false;
        data.folds.clear();
        self.active = DEFAULT_ACTIVE;
        self.noise = [real(NOISE_GUESS); JOINTS_PER_LEG];
        self.set_prior(which);
        if let Some(prior) = &self.prior {
            // The work space is as large as it says; without the analysis, every fold would count as unfolded.
            let _ = data.base.analyse(which, prior, work);
        }
        self.counters = LegCounters::ZERO;
    }

    /// The prior of the effects active at first. Not inlined, like [`Self::open`].
    #[inline(never)]
    fn set_prior(&mut self, which: Leg) {
        self.prior = Some(DevicePrior::of(which, &self.active));
    }

    /// An empty window. Not inlined, so that what it takes of the stack is given back before the prior takes its own.
    #[inline(never)]
    fn open(&mut self, which: Leg) {
        let (upright, settings) = (Transform::identity(), SETTINGS);
        self.window = Some(Window::new(
            leg(which),
            upright,
            DeviceColumns,
            plausible(which),
            settings,
        ));
    }

    pub(super) fn counters(&self, data: &LegData<T>) -> LegCounters {
        let (frames, cycles) = (self.listener.frames(), self.listener.cycles());
        LegCounters {
            commands: frames.commands,
            replies: frames.replies,
            bad_crc: frames.bad_crc,
            short: frames.short,
            skipped_bytes: frames.skipped_bytes,
            lost_bytes: data.queue.lost(),
            unused_replies: cycles.unused_replies,
            incomplete: cycles.incomplete,
            motor_faults: cycles.motor_faults,
            overheated: cycles.overheated,
            stuck: cycles.stuck,
            surplus: self.surplus,
            ..self.counters
        }
    }

    pub(super) fn count_unsolved(&mut self) {
        increment(&mut self.counters.unsolved);
    }

    /// Takes what the bus brought until `end_us`, each byte `byte_ns` after the one before.
    pub(super) fn hear(data: &mut LegData<T>, bytes: &[u8], end_us: u64, byte_ns: u32) {
        data.queue.push(bytes, end_us, byte_ns);
    }

    /// Makes samples of what the bus brought, as much as one step has time for; the rest waits. What it cost by estimate,
    /// instructions.
    #[inline(never)]
    pub(super) fn listen(&mut self, data: &mut LegData<T>) -> usize {
        let (mut effort, mut samples) = (STEP_EFFORT, 0);
        while (samples < STEP_SAMPLES || data.queue.is_behind()) && !data.queue.is_empty() {
            let Some(cycle) = self.listener.next(&mut data.queue, &mut effort) else {
                break;
            };
            if samples < STEP_SAMPLES {
                samples += 1;
                let sample = self.alignment.sample(cycle, SETTINGS.max_gap_us);
                self.push(data, &sample);
            } else {
                // What waits would be lost in the end, in the middle of a frame.
                increment(&mut self.surplus);
                self.listener.discard();
            }
        }
        let moved = if data.queue.is_behind() {
            BEHIND_COST
        } else {
            0
        };
        (STEP_EFFORT - effort) * EFFORT_COST + samples * SAMPLE_COST + moved
    }

    /// Puts a sample into the window. Not inlined: in a loop, the window's addresses would all be kept, which costs more.
    #[inline(never)]
    fn push(&mut self, data: &mut LegData<T>, sample: &Sample<T, JOINTS_PER_LEG>) {
        let Some(window) = &mut self.window else {
            return;
        };
        // Steps so long that the turn to fold did not come: fold now, before the next window's rows take the place.
        let next_close = window.rows().span_us[1].saturating_add(SETTINGS.window_us);
        if self.closed && sample.time_us >= next_close {
            self.fold(data);
        }
        let Some(window) = &mut self.window else {
            return;
        };
        let counters = &mut self.counters;
        increment(&mut counters.samples);
        match window.push(sample) {
            Push::Used => increment(&mut counters.used),
            Push::Closed => {
                increment(&mut counters.used);
                self.closed = true;
            }
            Push::Gap => {
                increment(&mut counters.used);
                increment(&mut counters.gaps);
            }
            Push::Late | Push::Repeated => increment(&mut counters.late),
            Push::Rejected(_) => increment(&mut counters.rejected),
        }
    }

    /// Folds a closed window into the factors; whether there was one.
    pub(super) fn fold(&mut self, data: &mut LegData<T>) -> bool {
        let (true, Some(window)) = (self.closed, &self.window) else {
            return false;
        };
        self.closed = false;
        match data.folds.fold_window(window.rows(), &data.base) {
            Ok(()) => increment(&mut self.counters.windows),
            Err(_) => increment(&mut self.counters.unfolded),
        }
        true
    }

    /// Begins to gather the windows folded so far.
    pub(super) fn gather(
        &self,
        data: &LegData<T>,
        gather: &mut Gather<T>,
        solver: &mut DeviceSolver<T>,
    ) {
        gather.start(&self.active, &data.folds, solver);
    }

    /// Goes on gathering; true when the solution has begun.
    pub(super) fn gather_on(
        &self,
        data: &LegData<T>,
        gather: &mut Gather<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<bool, FactorError> {
        let done = gather.advance(STEP_COST, &data.folds, &data.base, solver)?;
        match &self.prior {
            Some(prior) if done && *gather.active() == self.active => solver.restart(prior),
            // The host has changed the model meanwhile: once more.
            _ if done => {
                gather.start(&self.active, &data.folds, solver);
                return Ok(false);
            }
            _ => {}
        }
        Ok(done)
    }

    /// What a diagnosis looks at.
    pub(super) fn evidence<'a>(&'a self, data: &'a LegData<T>) -> Evidence<'a, T> {
        Evidence {
            folds: &data.folds,
            base: &data.base,
            active: &self.active,
            noise: &self.noise,
        }
    }

    /// Takes note of the joints' noise by a solution.
    pub(super) fn set_noise(&mut self, noise: &[T; JOINTS_PER_LEG]) {
        self.noise = *noise;
    }

    /// Adds an effect of [`crate::estimator::COLUMNS`] to a joint's model, or drops it; false if that is how it was.
    pub(super) fn set_effect(&mut self, joint: usize, effect: usize, active: bool) -> bool {
        if self.active.has(joint, effect) == active {
            return false;
        }
        self.active.set(joint, effect, active);
        if let Some(prior) = &mut self.prior {
            prior.activate(&self.active);
        }
        true
    }
}

fn increment(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
