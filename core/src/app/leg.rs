//! One leg's line: bus bytes, frames, samples, windows, factors.

use super::assembly::Assembler;
use super::diagnosis::Evidence;
use crate::Real;
use crate::bus::{Decoder, Reply};
use crate::estimator::{
    Active, DEFAULT_ACTIVE, DeviceColumns, DeviceFolds, DevicePrior, DeviceSolver, DeviceWindow,
    Gather, LegBase, NOISE_GUESS, plausible,
};
use crate::factor::FactorError;
use crate::go2::{ACTUATORS, JOINTS_PER_LEG, Leg, leg};
use crate::scalar::real;
use crate::spatial::Transform;
use crate::window::{Push, Sample, Settings, Window};
use crate::wire::LegCounters;

/// A step of gathering ends at the first row that brings its cost here, in numbers rotated.
const STEP_COST: usize = 1200;

/// One leg's data: what is all zeros at first, and so needs no copy in a microcontroller's flash.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegData<T> {
    folds: DeviceFolds<T>,
    base: LegBase<T>,
}

impl<T: Real> LegData<T> {
    /// No data.
    pub(super) const fn new() -> Self {
        Self {
            folds: DeviceFolds::empty(),
            base: LegBase::empty(),
        }
    }
}

/// One leg, from its bus to its factors.
pub(super) struct LegLine<T: Real> {
    decoder: Decoder,
    assembler: Assembler,
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
            decoder: Decoder::new(),
            assembler: Assembler::new(),
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
        self.decoder = Decoder::new();
        self.assembler = Assembler::new();
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
        let (upright, settings) = (Transform::identity(), Settings::default());
        self.window = Some(Window::new(
            leg(which),
            upright,
            DeviceColumns,
            plausible(which),
            settings,
        ));
    }

    pub(super) fn counters(&self) -> LegCounters {
        let bus = self.decoder.counters();
        LegCounters {
            commands: bus.commands,
            replies: bus.replies,
            bad_crc: bus.bad_crc,
            short: bus.short,
            skipped_bytes: bus.skipped_bytes,
            unused_replies: self.assembler.unused(),
            ..self.counters
        }
    }

    pub(super) fn count_unsolved(&mut self) {
        increment(&mut self.counters.unsolved);
    }

    /// Takes the bytes of one step. Of several samples in them the newest is used, so that a step's work is bounded.
    pub(super) fn listen(
        &mut self,
        data: &mut LegData<T>,
        now_us: u64,
        cycle_us: u64,
        bytes: &[u8],
    ) {
        let mut newest = None;
        let mut bytes = bytes;
        while let Some(frame) = self.decoder.next(&mut bytes) {
            if let Some(replies) = self.assembler.push(&frame, now_us, cycle_us)
                && newest.replace(replies).is_some()
            {
                self.assembler.discard(JOINTS_PER_LEG as u32);
            }
        }
        if let Some(replies) = newest {
            self.push(data, &sample(now_us, &replies));
        }
    }

    fn push(&mut self, data: &mut LegData<T>, sample: &Sample<T, JOINTS_PER_LEG>) {
        let Some(window) = &mut self.window else {
            return;
        };
        // Steps so long that the turn to fold did not come: fold now, before the next window's rows take the place.
        let next_close = window.rows().span_us[1].saturating_add(Settings::default().window_us);
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
            Push::Repeated => increment(&mut counters.repeated),
            Push::Late => increment(&mut counters.late),
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

/// What three motors say, joint side.
fn sample<T: Real>(time_us: u64, replies: &[Reply; JOINTS_PER_LEG]) -> Sample<T, JOINTS_PER_LEG> {
    let joint = |quantity: fn(&Reply, f64) -> f64| {
        core::array::from_fn(|j| real(quantity(&replies[j], ACTUATORS[j].gear)))
    };
    Sample {
        time_us,
        q: joint(Reply::joint_position),
        dq: joint(Reply::joint_velocity),
        tau: joint(Reply::joint_torque),
    }
}

fn increment(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
