//! One leg's line: bus bytes, frames, samples, windows, factors.

use super::alignment::Alignment;
use super::counts::heard;
use super::diagnosis::Evidence;
use super::support::Support;
use crate::Real;
use crate::bus::{Listener, Queue};
use crate::consistent::{Held, body, is_consistent};
use crate::estimator::{
    Active, Beliefs, BlockTest, COLUMNS, Change, ChangeKind, DEFAULT_ACTIVE, DeviceDescent,
    DeviceFolds, DevicePrior, DeviceSolver, DeviceWindow, Gather, LEG_INERTIAL, LegBase,
    MAX_EFFECTS, NOISE_GUESS, Verdict,
};
use crate::factor::{Factor, FactorError};
use crate::go2::{ACTUATORS, Go2, JOINTS_PER_LEG, Leg};
use crate::inertia::InertialParameters;
use crate::scalar::{exp_minus, real};
use crate::slot::Slot;
use crate::spatial::Transform;
use crate::window::{Push, Sample, Settings};
use crate::wire::{self, LegCounters};

/// A motor answers when it is asked: the same numbers again are a measurement, not a message read twice.
pub(super) const SETTINGS: Settings = Settings {
    skip_repeated: false,
    ..Settings::DEFAULT
};

/// What a step takes off one bus at most, in bytes of good frames: nearly what a bus without a pause brings in 2 ms; and
/// what a step does that folds as well, one in ten.
pub(super) const STEP_EFFORT: usize = 700;
pub(super) const FOLDING_EFFORT: usize = 400;
/// Samples of a leg in one step at most: a bus polled at 1 kHz.
const STEP_SAMPLES: usize = 2;
/// What listening costs by estimate, instructions: a byte of a good frame, a sample.
const EFFORT_COST: usize = 13;
const SAMPLE_COST: usize = 3600;
/// A queue that is behind: what waits is moved to make room.
const BEHIND_COST: usize = 8000;

/// Directions that a step forgets: each costs a fifth of a fold.
const STEP_DIRECTIONS: usize = 2;

/// How well a host may say that a body is known: from a thousandth, where the prior still leaves rounding alone, to nothing.
const UNCERTAINTIES: core::ops::RangeInclusive<f32> = 1e-3..=1e2;

/// A step of gathering ends where its cost would come beyond this, in numbers rotated.
const STEP_COST: usize = 1600;

/// One leg's data: what is all zeros at first, and so needs no copy in a microcontroller's flash.
#[derive(Clone, Copy, Debug)]
pub(super) struct LegData<T> {
    folds: DeviceFolds<T>,
    base: LegBase<T>,
    test: BlockTest<T>,
    /// What the bus has brought and no step has taken yet.
    queue: Queue,
}

impl<T: Real> LegData<T> {
    /// No data.
    pub(super) const fn new() -> Self {
        Self {
            folds: DeviceFolds::empty(),
            base: LegBase::empty(),
            test: BlockTest::empty(),
            queue: Queue::new(),
        }
    }

    /// What is folded in.
    pub(super) fn folds(&self) -> &DeviceFolds<T> {
        &self.folds
    }

    /// What is folded in, to be what it was.
    pub(super) fn folds_mut(&mut self) -> &mut DeviceFolds<T> {
        &mut self.folds
    }

    /// Which columns the joints' factors have.
    pub(super) fn independent(&self) -> impl Iterator<Item = u8> + '_ {
        self.base.independent.iter().flatten().copied()
    }

    /// A joint's factor in one fold.
    pub(super) fn factor(&self, fold: usize, joint: usize) -> Factor<T, &[T]> {
        self.folds.joint(fold, joint)
    }
}

/// One leg, from its bus to its factors.
pub(super) struct LegLine<T: Real> {
    listener: Slot<Listener>,
    alignment: Alignment<T, Go2, JOINTS_PER_LEG>,
    /// Cycles left out because more came than steps have time for.
    surplus: u32,
    /// Empty until the first [`Self::reset`], like the prior: neither can be a constant.
    window: Slot<DeviceWindow<T>>,
    active: Active,
    prior: Slot<DevicePrior<T>>,
    beliefs: Beliefs,
    /// The joints' noise by the last solution, N m.
    noise: [T; JOINTS_PER_LEG],
    /// The bodies of the last consistent solution; none, and so not physical, at first.
    bodies: [InertialParameters<T>; JOINTS_PER_LEG],
    /// The effects that it had at a bound, and of which model.
    held: (Held, Active),
    /// Data of so many seconds ago weigh 1/e; 0: as much as new ones.
    memory_s: u32,
    /// A change that is being forgotten, and how many of its directions are.
    forgetting: Slot<(Change<T>, usize)>,
    /// Data that were gathered are no longer what the factors hold.
    stale: bool,
    /// What the calf says of a force at the foot; whether the feet carry the robot; and whether what came shortly before is still to be left
    /// out.
    support: Support<T>,
    carried: bool,
    spoilt: bool,
    /// A change to be told.
    changed: Slot<wire::Change>,
    counters: LegCounters,
}

impl<T: Real> LegLine<T> {
    /// A line that listens to nothing yet: all zeros.
    pub(super) const fn new() -> Self {
        Self {
            listener: Slot::Empty,
            alignment: Alignment::new(),
            surplus: 0,
            window: Slot::Empty,
            active: Active::NONE,
            prior: Slot::Empty,
            beliefs: Beliefs::NONE,
            noise: [T::ZERO; JOINTS_PER_LEG],
            bodies: [InertialParameters::NONE; JOINTS_PER_LEG],
            held: (Held::NONE, Active::NONE),
            memory_s: 0,
            forgetting: Slot::Empty,
            stale: false,
            support: Support::new(),
            carried: false,
            spoilt: false,
            changed: Slot::Empty,
            counters: LegCounters::ZERO,
        }
    }

    /// Begins anew, in place: a line is larger than a microcontroller's stack. `work` is space for the analysis of the leg.
    pub(super) fn reset(&mut self, which: Leg, data: &mut LegData<T>, work: &mut [T]) {
        self.listener = Slot::Full(Listener::new());
        self.alignment = Alignment::new();
        self.surplus = 0;
        data.queue.clear();
        self.open(which);
        data.folds.clear();
        data.test.clear();
        self.memory_s = 0;
        self.forgetting = Slot::Empty;
        self.stale = false;
        self.changed = Slot::Empty;
        self.active = DEFAULT_ACTIVE;
        self.beliefs = Beliefs::NONE;
        self.noise = [real(NOISE_GUESS); JOINTS_PER_LEG];
        self.bodies = [InertialParameters::zero(); JOINTS_PER_LEG];
        self.held = (Held::NONE, Active::NONE);
        self.set_prior(which);
        if let Slot::Full(prior) = &self.prior {
            // The work space is as large as it says; without the analysis, every fold would count as unfolded.
            let _ = data.base.analyse(which, prior, work);
            self.support.begin(prior, &data.base);
        }
        (self.carried, self.spoilt) = (false, false);
        self.counters = LegCounters::ZERO;
    }

    /// The prior of the effects active at first. Not inlined, like [`Self::open`].
    #[inline(never)]
    fn set_prior(&mut self, which: Leg) {
        self.prior = Slot::Full(DevicePrior::of(which, &self.active));
    }

    /// An empty window. Not inlined, so that what it takes of the stack is given back before the prior takes its own.
    #[inline(never)]
    fn open(&mut self, which: Leg) {
        self.window = Slot::Full(DeviceWindow::new(which, &Transform::identity(), SETTINGS));
    }

    pub(super) fn counters(&self, data: &LegData<T>) -> LegCounters {
        LegCounters {
            lost_bytes: data.queue.lost(),
            ..self.counted()
        }
    }

    /// The counters but for the queue's, which is among the data.
    pub(super) fn counted(&self) -> LegCounters {
        let own = LegCounters {
            surplus: self.surplus,
            ..self.counters
        };
        heard(&self.listener, own)
    }

    pub(super) fn count_unsolved(&mut self) {
        increment(&mut self.counters.unsolved);
    }

    /// Takes what the bus brought until `end_us`, each byte `byte_ns` after the one before.
    pub(super) fn hear(data: &mut LegData<T>, bytes: &[u8], end_us: u64, byte_ns: u32) {
        data.queue.push(bytes, end_us, byte_ns);
    }

    /// Makes samples of what the bus brought, `most` bytes at most; the rest waits. What it cost by estimate, instructions.
    #[inline(never)]
    pub(super) fn listen(&mut self, data: &mut LegData<T>, most: usize) -> usize {
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
        match window.push(sample) {
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

    /// Lays the rows of the closed window by, to be folded in with others.
    fn take(&mut self, data: &mut LegData<T>, q: &[T; JOINTS_PER_LEG]) {
        if let Some(window) = self.window.get() {
            self.support.see(window.rows(), q);
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

    /// What the calf says of a force at the foot.
    pub(super) fn support(&self) -> &Support<T> {
        &self.support
    }

    /// Takes note of whether the feet carry the robot. As they begin to, what came shortly before is not of a robot that hangs either.
    pub(super) fn set_carried(&mut self, carried: bool) {
        self.spoilt |= carried && !self.carried;
        self.carried = carried;
    }

    /// Whether the present block and what waits are to be left out.
    pub(super) fn is_spoilt(&self) -> bool {
        self.spoilt
    }

    /// Leaves out the present block and what waits to be folded in.
    fn leave_out_spoilt(&mut self, data: &mut LegData<T>) {
        self.spoilt = false;
        self.stale = true;
        let windows = data.folds.drop_waiting() as u32 + super::single(data.folds.restore()) as u32;
        self.counters.carried = self.counters.carried.wrapping_add(windows);
        data.test.begin_block();
    }

    /// Whether as many windows wait as are folded in together, or the first of another block of time does: all legs' blocks end at once,
    /// and to judge, look and fold when all are full would take more steps than a window has.
    pub(super) fn is_due(data: &LegData<T>) -> bool {
        data.folds.is_full() || data.folds.is_new_block()
    }

    /// Whether a change is being forgotten: nothing is folded in or gathered meanwhile.
    pub(super) fn is_forgetting(&self) -> bool {
        self.forgetting.get().is_some()
    }

    /// A step of what is due: goes on forgetting, closes a block of time, looks at the windows that wait, or folds them in. False
    /// if no window waits and nothing is forgotten.
    #[inline(never)]
    pub(super) fn fold_on(&mut self, data: &mut LegData<T>) -> bool {
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
    pub(super) fn fold(&mut self, data: &mut LegData<T>) {
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

    /// Closes the block of time before what waits, if it is another: looks whether the leg has changed in it, and begins the
    /// next. False if it is the same.
    #[inline(never)]
    pub(super) fn close_block(&mut self, data: &mut LegData<T>) -> bool {
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
        let windows = super::single(data.folds.restore()) as u32;
        self.counters.forgotten = self.counters.forgotten.wrapping_add(windows);
        self.stale = true;
    }

    /// Takes note of a change in the block that is at its end.
    fn find(&mut self, data: &mut LegData<T>, change: Change<T>) {
        let [start, time_us] = data.folds.block_span();
        let since_us = start.saturating_sub((change.blocks - 1) * (time_us - start));
        self.changed = Slot::Full(wire::Change {
            leg: 0,
            joint: change.joint as u8,
            kind: match change.kind {
                ChangeKind::Bias => wire::ChangeKind::Bias,
                ChangeKind::Friction => wire::ChangeKind::Friction,
                ChangeKind::Load => wire::ChangeKind::Load,
            },
            size: super::single(change.size),
            since_us,
            time_us,
        });
        increment(&mut self.counters.changes);
        self.leave_out(data);
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
    pub(super) fn take_change(&mut self, leg: usize) -> Option<wire::Change> {
        let change = self.changed.take()?;
        Some(wire::Change {
            leg: leg as u8,
            ..change
        })
    }

    /// Has data of so many seconds ago weigh 1/e from the next block on; 0: as much as new ones.
    pub(super) fn set_memory(&mut self, seconds: u32) {
        self.memory_s = seconds;
    }

    /// Begins to gather what is folded in.
    pub(super) fn gather(
        &mut self,
        data: &LegData<T>,
        gather: &mut Gather<T>,
        solver: &mut DeviceSolver<T>,
    ) {
        self.stale = false;
        gather.start(&self.active, &data.folds, solver);
    }

    /// Goes on gathering; true when the solution has begun.
    pub(super) fn gather_on(
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

    /// What a diagnosis looks at.
    pub(super) fn evidence<'a>(&'a self, data: &'a LegData<T>) -> Evidence<'a, T> {
        Evidence {
            folds: &data.folds,
            base: &data.base,
            active: &self.active,
            beliefs: &self.beliefs,
            noise: &self.noise,
        }
    }

    /// Takes note of a solution: of the joints' noise, and of what the next block is to be judged by.
    pub(super) fn learn(
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

    /// Whether all bodies of a solution could exist and all effects are within their bounds.
    #[inline(never)]
    pub(super) fn is_consistent(&self, solver: &DeviceSolver<T>) -> bool {
        let prior = self.prior.get();
        prior.is_none_or(|prior| is_consistent(prior, solver.values()))
    }

    /// Begins the consistent solution of what has been solved freely, at the last one's bodies.
    pub(super) fn descend(&mut self, descent: &mut DeviceDescent<T>, solver: &mut DeviceSolver<T>) {
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
    pub(super) fn descend_on(
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

    /// Whether what was gathered is no longer what the factors hold.
    pub(super) fn is_stale(&self) -> bool {
        self.stale
    }

    /// Adds an effect of [`crate::estimator::COLUMNS`] to a joint's model, or drops it; false if that is how it was.
    pub(super) fn set_effect(&mut self, joint: usize, effect: usize, active: bool) -> bool {
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
    pub(super) fn believe(&mut self, joint: usize, effect: usize, mean: f32, std: f32) -> bool {
        let possible = self.beliefs.set(joint, effect, mean, std);
        if let (true, Some(prior)) = (possible, self.prior.get_mut()) {
            prior.activate(&self.active, &self.beliefs, &ACTUATORS);
        }
        possible
    }

    /// Takes a body to be within `uncertainty` of the CAD's; false if that is not within [`UNCERTAINTIES`].
    #[inline(never)]
    pub(super) fn know_body(
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
    pub(super) fn uncertainty(&self, body: usize) -> Option<T> {
        self.prior.get()?.uncertainty().get(body).copied()
    }

    /// Which effects the joints' models have.
    pub(super) fn active(&self) -> &Active {
        &self.active
    }

    /// What the host has said of effects.
    pub(super) fn beliefs(&self) -> &Beliefs {
        &self.beliefs
    }

    /// The joints' noise by the last solution, N m.
    pub(super) fn noise(&self) -> &[T; JOINTS_PER_LEG] {
        &self.noise
    }

    /// Data of so many seconds ago weigh 1/e; 0: as much as new ones.
    pub(super) fn memory_s(&self) -> u32 {
        self.memory_s
    }

    /// Takes a body's uncertainty from a snapshot.
    pub(super) fn restore_uncertainty(&mut self, body: usize, uncertainty: T) {
        if let (true, Some(prior)) = (uncertainty > T::zero(), self.prior.get_mut()) {
            prior.set_uncertainty(body, uncertainty);
        }
    }

    /// Takes a joint's effects from a snapshot.
    pub(super) fn restore_active(&mut self, joint: usize, effects: u32) {
        (0..COLUMNS.len()).for_each(|n| self.active.set(joint, n, effects >> n & 1 == 1));
    }

    /// Takes one number of what is believed from a snapshot.
    pub(super) fn restore_belief(&mut self, n: usize, number: f32) {
        self.beliefs.set_number(n, number);
    }

    /// Takes a joint's noise from a snapshot, N m.
    pub(super) fn restore_noise(&mut self, joint: usize, noise: T) {
        if let Some(place) = self.noise.get_mut(joint) {
            *place = noise;
        }
    }

    /// Goes on with what was taken from a snapshot.
    pub(super) fn restored(&mut self, data: &mut LegData<T>) {
        if let Some(prior) = self.prior.get_mut() {
            prior.activate(&self.active, &self.beliefs, &ACTUATORS);
            data.base.set_uncertainty(prior.uncertainty());
        }
    }

    /// Counts what a bus brought that nobody listens to.
    pub(super) fn count_unheard(&mut self, bytes: usize) {
        let unheard = &mut self.counters.unheard_bytes;
        *unheard = unheard.wrapping_add(bytes as u32);
    }
}

fn increment(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}
