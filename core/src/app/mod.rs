//! The whole line, one bounded step at a time: bus bytes in, messages out.
//!
//! [`App::step`] is the same synchronous function on a board, in emulation and on the desktop; who calls it says what time
//! it is and who it is. A step
//!
//! 1. obeys at most one request of the host (`requests`);
//! 2. folds one leg's windows into its factors, if six of them wait; or closes a block of 2 s, looks whether the leg has
//!    changed in it ([`crate::estimator::BlockTest`]), and forgets what no longer holds, bit by bit;
//! 3. decodes what each leg's bus has brought ([`App::hear`]) and makes samples of it ([`crate::bus::Listener`], `alignment`):
//!    two of a leg at most, and no more bytes than a step has time for, fewer if it folded; the rest waits;
//! 4. puts the samples into the legs' windows; the rows of a window that closes wait to be folded;
//! 5. if it did not fold, does one part of a solution or of the diagnosis; a solution that could not be is followed by the likeliest that
//!    could ([`crate::consistent`]), which is told in its place;
//! 6. says at most one message.
//!
//! So the legs, whose windows close in the same step, share the work of the steps that follow, and a step's cost has a
//! bound. Apart from part 3, which is cheaper where less came, it does not depend on the data; a step whose listening was dear
//! leaves the solution and the diagnosis to the next.
//! Nothing is dropped without being counted ([`crate::wire::LegCounters`]).

mod alignment;
#[cfg(test)]
mod change_tests;
#[cfg(test)]
mod consistent_tests;
mod copy;
mod counts;
mod diagnosis;
mod leg;
mod readings;
#[cfg(test)]
mod request_tests;
mod requests;
mod snapshot;
mod support;
#[cfg(test)]
mod support_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod timing_tests;
mod walking;
#[cfg(test)]
mod walking_tests;

use crate::Real;
use crate::estimator::{
    Active, COLUMNS, DEFAULT_ACTIVE, DeviceDescent, DeviceSolver, Gather, LEG_INERTIAL, MAX_EFFECTS,
};
use crate::go2::{JOINTS_PER_LEG, LEGS, Leg};
use crate::slot::Slot;
use crate::wire::{
    self, Action, Answer, Belief, BodyPrior, Capacities, Counters, DeviceMessage, EffectAt,
    Estimate, Hello, HostMessage, LegCounters, Load, Losses, Outcome, Reset, SCHEMA, Solution,
};
pub use alignment::Alignment;
use copy::FactorCopy;
use diagnosis::{Diagnosis, Verdict};
use embedded_storage::nor_flash::NorFlash;
use heapless::{String, Vec};
use leg::{FOLDING_EFFORT, LegData, LegLine, SETTINGS, STEP_EFFORT};
use requests::Requests;
pub use snapshot::SNAPSHOT_US;
use snapshot::{Snapshots, Source};
use support::{HOLD_US, carries};
pub use walking::{WALK_US, WalkingApp, WalkingMemory};

/// Time between two estimates, each of the next leg in turn, µs.
pub const ESTIMATE_US: u64 = 250_000;
/// Time between two reports of the counters, µs.
pub const REPORT_US: u64 = 100_000;
/// Time between two unasked hellos, µs.
pub const HELLO_US: u64 = 1_000_000;

/// Steps without a window to fold that rest after one with work for solution or diagnosis: what keeps the mean cost of a
/// step within its budget.
const REST: u8 = 2;

/// All legs, bit n for the n-th in SDK order.
const ALL_LEGS: u8 = (1 << LEGS) - 1;

/// What listening may cost in a step that solves or diagnoses as well, instructions by estimate: all that four legs polled at
/// 1 kHz bring.
const LISTENING: usize = 40_000;

/// Who the device is and what it may do; an argument, so that all logic runs anywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// Version of the firmware; 24 bytes at most are told.
    pub firmware: &'static str,
    /// Name of the board; 24 bytes at most are told.
    pub board: &'static str,
    /// Why it runs, and what.
    pub start: Start,
    /// What [`App::record_cost`] is told; 16 bytes at most.
    pub load_unit: &'static str,
    /// A step that costs more is counted as over budget.
    pub budget: u32,
    /// Time between two bytes that follow each other on a motor bus, ns: 2500 at 4 Mbit/s; 0 where all bytes that come at once
    /// have one time, as in replay.
    pub byte_ns: u32,
}

/// What a board knows of its start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Start {
    /// The commit that the firmware was built of; 16 bytes at most are told.
    pub git: &'static str,
    /// Why it started.
    pub reset: Reset,
    /// What ended the run before, if that was a panic or a fault; 64 bytes at most are told.
    pub crash: &'static str,
}

impl Start {
    /// Nothing is known of it.
    pub const UNKNOWN: Self = Self {
        git: "",
        reset: Reset::Unknown,
        crash: "",
    };
}

/// Of an application that has not been told who it is.
const NOBODY: Identity = Identity {
    firmware: "",
    board: "",
    start: Start::UNKNOWN,
    load_unit: "",
    budget: u32::MAX,
    byte_ns: 0,
};

/// What is told without a host: sums that grow, and wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Samples of all legs.
    pub samples: u32,
    /// What was lost or refused of all buses, of the IMU and of the host link, and steps over budget.
    pub losses: u32,
}

/// The legs' data, beside the application: all zeros at first, so that a microcontroller keeps no copy of it in flash.
pub struct Memory<T: Real>([LegData<T>; LEGS], FactorCopy<T>);

impl<T: Real> Memory<T> {
    /// No data, a constant.
    pub const fn new() -> Self {
        Self([const { LegData::new() }; LEGS], FactorCopy::new())
    }
}

impl<T: Real> Default for Memory<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// A leg that is being solved.
#[derive(Clone, Copy)]
struct Solving {
    which: Leg,
    /// When its data end.
    time_us: u64,
    phase: Phase,
    /// [`App::settings`] when its data were gathered.
    settings: u32,
}

/// How far a leg's solution is.
#[derive(Clone, Copy, PartialEq)]
enum Phase {
    /// Its data are being gathered.
    Gather,
    /// Least squares alone.
    Solve,
    /// Is that one that could be?
    Judge,
    /// The likeliest of those that could.
    Descend,
}

/// The application: four legs' lines and the solver that serves them in turn.
pub struct App<T: Real> {
    identity: Slot<Identity>,
    begun: bool,
    /// Legs that are listened to, bit n for the n-th.
    listens_to: u8,
    legs: [LegLine<T>; LEGS],
    solver: DeviceSolver<T>,
    gather: Gather<T>,
    diagnosis: Diagnosis<T>,
    /// The feet are taken to carry the robot until then, µs.
    carried_until: u64,
    was_carried: bool,
    /// Steps left of the rest after one with work.
    rest: u8,
    descent: DeviceDescent<T>,
    /// What is being solved.
    solving: Slot<Solving>,
    /// The diagnosis was the last to go on beside a consistent solution.
    diagnosed: bool,
    /// The leg to solve next, and when.
    next: (Leg, u64),
    /// A solution to be told.
    solved: Slot<(Leg, u64, Solution)>,
    requests: Requests,
    snapshots: Snapshots,
    /// Another number after each change that the host has made.
    settings: u32,
    hello_at: u64,
    counters_at: u64,
    load: Load,
    losses: Losses,
}

impl<T: Real> App<T> {
    /// An application that has seen nothing. It says hello in its first step.
    pub const fn new(identity: Identity) -> Self {
        let mut app = Self::unset();
        app.identity = Slot::Full(identity);
        app
    }

    /// An application that is nobody yet, a constant of zeros: a microcontroller keeps no copy of it in flash.
    /// [`begin`](Self::begin) says who it is.
    pub const fn unset() -> Self {
        Self {
            identity: Slot::Empty,
            begun: false,
            listens_to: 0,
            legs: [const { LegLine::new() }; LEGS],
            solver: DeviceSolver::empty(),
            gather: Gather::new(),
            diagnosis: Diagnosis::new(),
            carried_until: 0,
            was_carried: false,
            rest: 0,
            descent: DeviceDescent::empty(),
            solving: Slot::Empty,
            diagnosed: false,
            next: (Leg::FR, 0),
            solved: Slot::Empty,
            requests: Requests::new(),
            snapshots: Snapshots::new(),
            settings: 0,
            hello_at: 0,
            counters_at: 0,
            load: Load::ZERO,
            losses: Losses::ZERO,
        }
    }

    /// Becomes the application of `identity`, and forgets all data.
    pub fn begin(&mut self, memory: &mut Memory<T>, identity: Identity) {
        self.identity = Slot::Full(identity);
        self.reset(memory);
    }

    /// Forgets all data and counts, in place. The first step does it; a board that counts the cost of steps does it before.
    pub fn reset(&mut self, memory: &mut Memory<T>) {
        self.begun = true;
        self.listens_to = ALL_LEGS;
        let lines = self.legs.iter_mut().zip(&mut memory.0);
        for ((line, data), which) in lines.zip(Leg::ALL) {
            line.reset(which, data, self.solver.storage_mut());
        }
        self.solving = Slot::Empty;
        self.next = (Leg::FR, 0);
        self.solved = Slot::Empty;
        self.diagnosis.restart();
        self.rest = 0;
        (self.carried_until, self.was_carried) = (0, false);
        self.hello_at = 0;
        self.counters_at = 0;
        self.load = Load::ZERO;
    }

    /// Takes what the host says; the next steps obey, one request each. [`HostMessage::Advance`] is for the loop around the
    /// application and does nothing here.
    pub fn handle(&mut self, memory: &mut Memory<T>, message: &HostMessage) {
        match message {
            HostMessage::RequestHello => self.hello_at = 0,
            HostMessage::Request(request) => self.requests.push(*request),
            HostMessage::ReadFactor(read) => memory.1.ask(*read),
            // The IMU is for a robot that walks: [`WalkingApp`].
            HostMessage::Advance(_) | HostMessage::Imu(_) => {}
        }
    }

    /// Obeys the request that has waited longest.
    fn obey(&mut self, memory: &mut Memory<T>) {
        let Some(request) = self.requests.next() else {
            return;
        };
        let outcome = self.outcome(memory, request.action);
        let id = request.id;
        self.requests.answer(Answer { id, outcome });
    }

    /// Does what is asked.
    fn outcome(&mut self, memory: &mut Memory<T>, action: Action) -> Outcome {
        if action == Action::Keep {
            return match self.snapshots.want() {
                true => Outcome::Accepted,
                false => Outcome::NoStorage,
            };
        }
        self.settings = self.settings.wrapping_add(1);
        match action {
            Action::Keep => Outcome::Accepted,
            Action::Reset => {
                self.reset(memory);
                // Else the next start would bring back what was to be forgotten.
                self.snapshots.want();
                Outcome::Accepted
            }
            Action::AddEffect(at) => self.change(true, at),
            Action::DropEffect(at) => self.change(false, at),
            Action::SetMemory(seconds) => {
                self.legs.iter_mut().for_each(|leg| leg.set_memory(seconds));
                Outcome::Accepted
            }
            Action::SetEffectPrior(at, belief) => self.believe(at, belief),
            Action::SetBodyPrior(prior) => self.know_body(memory, prior),
            Action::SetLegs(legs) if legs & !ALL_LEGS != 0 => Outcome::NoSuchLeg,
            Action::SetLegs(legs) => {
                self.listens_to = legs;
                // Who listens is told by the hello.
                self.hello_at = 0;
                Outcome::Accepted
            }
        }
    }

    /// Becomes what it was when the newest whole snapshot in `flash` was made, if that is of the same schema, robot and model; the
    /// hello says what became of it. From then on [`keep`](Self::keep) writes snapshots there.
    ///
    /// For the start, after [`begin`](Self::begin) and before the first step: it takes as long as reading the flash does.
    pub fn restore(&mut self, memory: &mut Memory<T>, flash: &mut impl NorFlash) {
        if !self.begun {
            self.reset(memory);
        }
        self.snapshots.open(flash, &mut self.legs, &mut memory.0);
    }

    // A symbol of its own, like `step`.
    /// Does a step of the snapshot that is due, if one is: every [`SNAPSHOT_US`], after a reset, and when the host asks for one. To be called after
    /// each step, with the flash of [`restore`](Self::restore); four words of 32 bytes at most are written, or one erasure begun.
    ///
    /// A flash that is busy, or erases in the background, returns any error: the same is tried with the next call.
    #[inline(never)]
    pub fn keep(&mut self, memory: &Memory<T>, flash: &mut impl NorFlash, now_us: u64) {
        let source = Source {
            lines: &self.legs,
            data: &memory.0,
            settings: self.settings,
        };
        self.snapshots.advance(flash, &source, now_us);
    }

    /// The leg, the joint's place in it, and the effect's in [`COLUMNS`].
    fn place(&mut self, at: EffectAt) -> Result<(&mut LegLine<T>, usize, usize), Outcome> {
        let (joint, effect) = (usize::from(at.joint), usize::from(at.effect));
        match self.legs.get_mut(usize::from(at.leg)) {
            None => Err(Outcome::NoSuchLeg),
            Some(_) if joint >= JOINTS_PER_LEG => Err(Outcome::NoSuchJoint),
            Some(_) if effect >= COLUMNS.len() => Err(Outcome::NoSuchEffect),
            Some(leg) => Ok((leg, joint, effect)),
        }
    }

    /// Adds an effect to a joint's model or drops it.
    fn change(&mut self, add: bool, at: EffectAt) -> Outcome {
        let (leg, joint, effect) = match self.place(at) {
            Ok(place) => place,
            Err(outcome) => return outcome,
        };
        match (leg.set_effect(joint, effect, add), add) {
            (true, _) => Outcome::Accepted,
            (false, true) => Outcome::AlreadyActive,
            (false, false) => Outcome::NotActive,
        }
    }

    /// Sets what is known of an effect's parameter before any data.
    fn believe(&mut self, at: EffectAt, belief: Belief) -> Outcome {
        let (leg, joint, effect) = match self.place(at) {
            Ok(place) => place,
            Err(outcome) => return outcome,
        };
        match leg.believe(joint, effect, belief.mean - neutral(effect), belief.std) {
            true => Outcome::Accepted,
            false => Outcome::OutOfRange,
        }
    }

    /// Sets how well a body is known before any data.
    fn know_body(&mut self, memory: &mut Memory<T>, prior: BodyPrior) -> Outcome {
        let (leg, body) = (usize::from(prior.leg), usize::from(prior.body));
        match (self.legs.get_mut(leg), memory.0.get_mut(leg)) {
            (Some(_), Some(_)) if body >= JOINTS_PER_LEG => Outcome::NoSuchJoint,
            (Some(leg), Some(data)) => match leg.know_body(data, body, prior.uncertainty) {
                true => Outcome::Accepted,
                false => Outcome::OutOfRange,
            },
            _ => Outcome::NoSuchLeg,
        }
    }

    /// Whether a leg is listened to.
    fn listens_to(&self, leg: usize) -> bool {
        u32::from(self.listens_to)
            .checked_shr(leg as u32)
            .unwrap_or(0)
            & 1
            == 1
    }

    /// Takes note of what the last step cost, in the identity's unit, and of the deepest stack so far.
    pub fn record_cost(&mut self, cost: u32, stack_bytes: u32) {
        self.load.record(cost, stack_bytes, self.identity().budget);
    }

    /// Takes note of what was lost around the application since the start; a reset does not forget it.
    pub fn record_losses(&mut self, losses: Losses) {
        self.losses = losses;
    }

    /// Everything counted up to `now_us`.
    pub fn counters(&self, memory: &Memory<T>, now_us: u64) -> Counters {
        let [snapshots, snapshots_failed] = self.snapshots.counts();
        Counters {
            time_us: now_us,
            legs: core::array::from_fn(|leg| match (self.legs.get(leg), memory.0.get(leg)) {
                (Some(line), Some(data)) => line.counters(data),
                _ => LegCounters::ZERO,
            }),
            host_frames_bad: self.losses.host_frames_bad,
            host_frames_missed: self.losses.host_frames_missed,
            frames_dropped: self.losses.frames_dropped,
            buses: self.losses.buses,
            host_line: self.losses.host_line,
            imu: self.losses.imu,
            snapshots,
            snapshots_failed,
            load: self.load,
        }
    }

    /// What a board's lights tell.
    pub fn health(&self) -> Health {
        let legs = self.legs.iter().map(LegLine::counted);
        counts::health(legs, &self.losses, &self.load)
    }

    /// Takes what a leg's bus brought without a pause, `end_us` being when its last byte came: on the clock of the steps. It waits
    /// for the next steps. What finds no room is counted, and so is what a leg's bus brings that is not listened to.
    pub fn hear(&mut self, memory: &mut Memory<T>, leg: usize, bytes: &[u8], end_us: u64) {
        if !self.begun {
            self.reset(memory);
        }
        if !self.listens_to(leg) {
            if let Some(line) = self.legs.get_mut(leg) {
                line.count_unheard(bytes.len());
            }
        } else if let Some(data) = memory.0.get_mut(leg) {
            LegLine::hear(data, bytes, end_us, self.identity().byte_ns);
        }
    }

    // A symbol of its own: a test looks whether anything that it reaches can panic (tests/tests/no_panic.rs).
    /// One step at `now_us`, whatever its origin. `out` gets the messages to the host. A clock that goes back is survived: no window
    /// bridges that ([`crate::window::Window::push`]), and what was due within a period of the old time still is.
    #[inline(never)]
    pub fn step(
        &mut self,
        memory: &mut Memory<T>,
        now_us: u64,
        out: &mut impl FnMut(&DeviceMessage),
    ) {
        if !self.begun {
            self.reset(memory);
        }
        self.keep_up(now_us);
        self.obey(memory);
        self.feel_ground(now_us);
        let folded = self.fold(memory);
        let effort = if folded { FOLDING_EFFORT } else { STEP_EFFORT };
        let lines = self.legs.iter_mut().zip(&mut memory.0);
        let listening: usize = lines.map(|(leg, data)| leg.listen(data, effort)).sum();
        if !folded && listening <= LISTENING {
            self.work(memory, now_us);
        }
        if let Some(message) = self.message(memory, now_us) {
            out(&message);
        }
    }

    /// Brings forward what is due further ahead than it ever is, where the clock has gone back.
    fn keep_up(&mut self, now_us: u64) {
        let within = |due: u64, period: u64| due.min(now_us.saturating_add(period));
        self.hello_at = within(self.hello_at, HELLO_US);
        self.counters_at = within(self.counters_at, REPORT_US);
        self.next.1 = within(self.next.1, ESTIMATE_US);
        self.carried_until = within(self.carried_until, HOLD_US);
    }

    /// Judges whether the feet carry the robot; the next hello, which comes at once, says if that is new.
    fn feel_ground(&mut self, now_us: u64) {
        if carries(self.legs.iter().map(LegLine::support), now_us) {
            self.carried_until = now_us.saturating_add(HOLD_US);
        }
        let carried = now_us < self.carried_until;
        if carried != self.was_carried {
            self.hello_at = 0;
        }
        self.was_carried = carried;
        self.legs
            .iter_mut()
            .for_each(|leg| leg.set_carried(carried));
    }

    /// Does a step of what is due to a leg's windows: there are as many as are folded in together, or a block is at its end. False
    /// if nothing is.
    fn fold(&mut self, memory: &mut Memory<T>) -> bool {
        // A leg that forgets takes many steps: the others' windows do not wait for it.
        let due = |(line, data): &(&mut LegLine<T>, &mut LegData<T>)| {
            (LegLine::is_due(data) || line.is_spoilt()) && !line.is_forgetting()
        };
        let mut lines = self.legs.iter_mut().zip(&mut memory.0);
        if let Some((line, data)) = lines.find(due) {
            line.fold_on(data);
            return true;
        }
        let mut lines = self.legs.iter_mut().zip(&mut memory.0);
        let forgetting = lines.find(|(line, _)| line.is_forgetting());
        forgetting.map(|(line, data)| line.fold_on(data)).is_some()
    }

    /// One part of a solution, or of the diagnosis where none is due; then a rest. Beside a consistent solution, which takes many parts, the
    /// diagnosis has every second one.
    fn work(&mut self, memory: &mut Memory<T>, now_us: u64) {
        if let Some(left) = self.rest.checked_sub(1) {
            self.rest = left;
            return;
        }
        self.rest = REST;
        let n = self.diagnosis.leg();
        if !self.listens_to(n) {
            self.diagnosis.skip_leg();
        }
        let descends =
            matches!(&self.solving, Slot::Full(solving) if solving.phase == Phase::Descend);
        self.diagnosed = descends && !self.diagnosed;
        if (self.diagnosed || !self.solve(memory, now_us))
            && self.listens_to(n)
            && let (Some(leg), Some(data)) = (self.legs.get(n), memory.0.get(n))
        {
            self.diagnosis.advance(&leg.evidence(data));
        }
    }

    /// One part of a solution: begins the next leg's when it is due, or goes on with the one begun; false if there is none.
    fn solve(&mut self, memory: &mut Memory<T>, now_us: u64) -> bool {
        match self.solving {
            Slot::Full(solving) => self.solve_on(memory, solving),
            Slot::Empty => return self.begin_solving(memory, now_us),
        }
        true
    }

    /// Begins the next leg's solution when it is due; false if it is not.
    fn begin_solving(&mut self, memory: &mut Memory<T>, now_us: u64) -> bool {
        let (which, due) = self.next;
        if !self.listens_to(which.index()) {
            // Its turn is the next one's, as soon as there is one to be solved.
            self.next.0 = following(which);
            return false;
        }
        let (leg, data) = (&mut self.legs[which.index()], &mut memory.0[which.index()]);
        if self.solved.get().is_some() || now_us < due || leg.is_forgetting() {
            return false;
        }
        // What waits is folded in before, in steps of its own.
        if leg.fold_on(data) {
            return true;
        }
        leg.gather(data, &mut self.gather, &mut self.solver);
        self.solving = Slot::Full(Solving {
            which,
            time_us: now_us,
            phase: Phase::Gather,
            settings: self.settings,
        });
        // A solver that cannot keep up does not try to catch up.
        let due = due
            .saturating_add(ESTIMATE_US)
            .max(now_us.saturating_sub(ESTIMATE_US));
        self.next = (following(which), due);
        true
    }

    /// Goes on with a solution.
    fn solve_on(&mut self, memory: &mut Memory<T>, solving: Solving) {
        let Solving { which, time_us, .. } = solving;
        let (leg, data) = (&mut self.legs[which.index()], &mut memory.0[which.index()]);
        let has_prior = match solving.phase {
            Phase::Gather | Phase::Solve => true,
            Phase::Judge => solving.settings == self.settings,
            Phase::Descend => solving.settings == self.settings && !leg.is_stale(),
        };
        if !has_prior {
            // The prior that it was begun with is no more: its turn is once more the next.
            self.solving = Slot::Empty;
            self.next.0 = which;
            return;
        }
        let next = match solving.phase {
            Phase::Gather => leg
                .gather_on(data, &mut self.gather, &mut self.solver)
                .map(|done| done.then_some(Phase::Solve)),
            Phase::Solve => self.solver.advance().map(|done| {
                done.then(|| {
                    leg.learn(data, &self.solver, self.gather.active());
                    Phase::Judge
                })
            }),
            Phase::Judge if leg.is_consistent(&self.solver) => {
                self.solved = Slot::Full((which, time_us, Solution::Free));
                self.solving = Slot::Empty;
                return;
            }
            Phase::Judge => {
                leg.descend(&mut self.descent, &mut self.solver);
                Ok(Some(Phase::Descend))
            }
            Phase::Descend => match leg.descend_on(&mut self.descent, &mut self.solver) {
                Ok(true) => {
                    self.solved = Slot::Full((which, time_us, Solution::Consistent));
                    self.solving = Slot::Empty;
                    return;
                }
                Ok(false) => Ok(None),
                Err(error) => Err(error),
            },
        };
        match next {
            Ok(Some(phase)) => {
                let settings = match phase {
                    // The model may have been set while its data were gathered: it is then gathered anew.
                    Phase::Solve => self.settings,
                    _ => solving.settings,
                };
                self.solving = Slot::Full(Solving {
                    phase,
                    settings,
                    ..solving
                });
            }
            Ok(None) => {}
            Err(_) => {
                self.solving = Slot::Empty;
                leg.count_unsolved();
            }
        }
    }

    /// The most urgent message that is due.
    fn message(&mut self, memory: &mut Memory<T>, now_us: u64) -> Option<DeviceMessage> {
        if now_us >= self.hello_at {
            self.hello_at = now_us.saturating_add(HELLO_US);
            return Some(DeviceMessage::Hello(self.hello()));
        }
        if let Some(answer) = self.requests.take() {
            return Some(DeviceMessage::Answer(answer));
        }
        let mut lines = self.legs.iter_mut().enumerate();
        if let Some(change) = lines.find_map(|(leg, line)| line.take_change(leg)) {
            return Some(DeviceMessage::Change(change));
        }
        if let Some((which, time_us, solution)) = self.solved.take() {
            let estimate = self.estimate(which, time_us, solution);
            return Some(DeviceMessage::Estimate(estimate));
        }
        if now_us >= self.counters_at {
            self.counters_at = now_us.saturating_add(REPORT_US);
            return Some(DeviceMessage::Counters(self.counters(memory, now_us)));
        }
        if let Some(leg) = memory.1.leg_to_copy()
            && let (Some(line), Some(data)) = (self.legs.get_mut(leg), memory.0.get_mut(leg))
        {
            // A copy has all windows that have closed, which are folded in in steps of their own.
            if line.is_forgetting() || line.fold_on(data) {
                return None;
            }
        }
        if let Some(part) = memory.1.take(&memory.0) {
            return Some(DeviceMessage::FactorPart(part));
        }
        self.diagnosis
            .take()
            .map(|verdict| DeviceMessage::Diagnosis(told(&verdict)))
    }

    fn identity(&self) -> Identity {
        self.identity.get().copied().unwrap_or(NOBODY)
    }

    fn hello(&self) -> Hello {
        let identity = self.identity();
        Hello {
            schema: SCHEMA,
            firmware: text(identity.firmware),
            git: text(identity.start.git),
            board: text(identity.board),
            reset: identity.start.reset,
            crash: text(identity.start.crash),
            capacities: Capacities {
                legs: LEGS as u8,
                joints_per_leg: JOINTS_PER_LEG as u8,
                inertial_parameters: LEG_INERTIAL as u8,
                effect_parameters: DEFAULT_ACTIVE.effects().count() as u8,
                window_us: SETTINGS.window_us as u32,
                scalar_bits: (8 * size_of::<T>()) as u8,
            },
            load_unit: text(identity.load_unit),
            listens_to: self.listens_to,
            carried: self.was_carried,
            kept: self.snapshots.status(),
            effects: fitting(COLUMNS.iter().map(|effect| text(effect.name()))),
        }
    }

    fn estimate(&self, which: Leg, time_us: u64, solution: Solution) -> Estimate {
        const {
            assert!(LEG_INERTIAL + MAX_EFFECTS <= wire::MAX_PARAMETERS);
            assert!(COLUMNS.len() <= wire::MAX_EFFECTS);
        }
        let solver = &self.solver;
        let active: &Active = self.gather.active();
        let values = solver.values().iter().copied().map(single);
        let neutral = active.effects().map(|(_, n)| neutral(n));
        let neutral = core::iter::repeat_n(0.0, LEG_INERTIAL).chain(neutral);
        Estimate {
            leg: which.index() as u8,
            time_us,
            windows: single(solver.windows()) as u32,
            effects: active.0,
            solution,
            values: fitting(values.zip(neutral).map(|(v, n)| v + n)),
            std: fitting(solver.std().iter().copied().map(single)),
            noise: solver.noise().map(single),
        }
    }
}

/// The leg after this one.
fn following(leg: Leg) -> Leg {
    Leg::ALL[(leg.index() + 1) % LEGS]
}

/// The value of effect n's parameter at which it does nothing: columns are of what goes beyond it.
fn neutral(n: usize) -> f32 {
    let parameter = COLUMNS.get(n).map(|effect| effect.description().parameters);
    parameter
        .and_then(<[_]>::first)
        .map_or(0.0, |p| p.neutral as f32)
}

/// A verdict as the wire has it.
fn told<T: Real>(verdict: &Verdict<T>) -> wire::Diagnosis {
    wire::Diagnosis {
        at: EffectAt {
            leg: verdict.leg as u8,
            joint: verdict.joint as u8,
            effect: verdict.effect as u8,
        },
        active: verdict.active,
        windows: single(verdict.windows) as u32,
        gain: single(verdict.held_out.gain()),
        gain_error: single(verdict.held_out.gain_error()),
        value: single(verdict.finding.value()) + neutral(verdict.effect),
        std: single(verdict.finding.std()),
    }
}

/// As `f32`, which the wire carries.
fn single<T: Real>(value: T) -> f32 {
    nalgebra::try_convert(value).unwrap_or(f64::NAN) as f32
}

/// As many as fit. `collect` would panic where there is no room.
fn fitting<X, const N: usize>(items: impl Iterator<Item = X>) -> Vec<X, N> {
    let mut vec = Vec::new();
    for item in items {
        let _ = vec.push(item);
    }
    vec
}

/// As much of `source` as fits.
fn text<const N: usize>(source: &str) -> String<N> {
    let mut text = String::new();
    for character in source.chars().take_while(char::is_ascii) {
        // What finds no room is left out.
        let _ = text.push(character);
    }
    text
}
