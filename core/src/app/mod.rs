//! The whole line, one bounded step at a time: bus bytes in, messages out.
//!
//! [`App::step`] is the same synchronous function on a board, in emulation and on the desktop; who calls it says what time
//! it is and who it is ([`Identity`]). A step
//!
//! 1. obeys at most one request of the host (`requests`);
//! 2. folds one leg's windows into its factors (`leg`), if six of them wait; or closes a block of 2 s, looks whether the leg has
//!    changed in it ([`crate::estimator::BlockTest`]), and forgets what no longer holds, bit by bit;
//! 3. decodes what each leg's bus has brought ([`App::hear`]) and makes samples of it ([`crate::bus::Listener`], `alignment`):
//!    two of a leg at most, and no more bytes than a step has time for, fewer if it folded; the rest waits;
//! 4. puts the samples into the legs' windows; the rows of a window that closes wait to be folded;
//! 5. if it did not fold, does one part of a solution or of the diagnosis; a solution that could not be is followed by the likeliest that
//!    could ([`crate::consistent`]), which is told in its place (`solution`);
//! 6. says at most one message (`messages`).
//!
//! So the legs, whose windows close in the same step, share the work of the steps that follow, and a step's cost has a
//! bound. Apart from part 3, which is cheaper where less came, it does not depend on the data; a step whose listening was dear
//! leaves the solution and the diagnosis to the next.
//! A leg whose zeros are unknown (`zeros`) is listened to and counted, and no more; one whose zeros were set is on trial before it is
//! identified (`wiring`).
//! What the board is set up for outlives all of that (`setup`).
//! Nothing is dropped without being counted ([`crate::wire::LegCounters`]).

mod alignment;
#[cfg(test)]
mod change_tests;
#[cfg(test)]
mod consistent_tests;
mod copy;
mod counts;
mod diagnosis;
mod identity;
mod leg;
mod messages;
mod readings;
#[cfg(test)]
mod request_tests;
mod requests;
mod setup;
#[cfg(test)]
mod setup_tests;
mod snapshot;
mod solution;
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
mod wiring;
mod zeros;
#[cfg(test)]
mod zeros_tests;

use crate::Real;
use crate::estimator::{DeviceDescent, DeviceSolver, Gather};
use crate::go2::{LEGS, Leg};
use crate::slot::Slot;
use crate::wire::{DeviceMessage, HostMessage, Load, Losses, Solution};
pub use alignment::Alignment;
use copy::FactorCopy;
pub use counts::Health;
use diagnosis::Diagnosis;
use embedded_storage::nor_flash::NorFlash;
use identity::NOBODY;
pub use identity::{Identity, Start};
use leg::{FOLDING_EFFORT, LegData, LegLine, STEP_EFFORT};
use requests::Requests;
pub use setup::{SETUP_SECTORS, setup_in};
pub use snapshot::SNAPSHOT_US;
use snapshot::{Snapshots, Source};
use solution::Solving;
use support::{HOLD_US, carries};
pub use walking::{WALK_US, WalkingApp, WalkingMemory};
pub use zeros::rest;

/// Time between two estimates, each of the next leg in turn, µs.
pub const ESTIMATE_US: u64 = 250_000;
/// Time between two reports of the counters, µs.
pub const REPORT_US: u64 = 100_000;
/// Time between two unasked hellos, µs.
pub const HELLO_US: u64 = 1_000_000;

/// All legs, bit n for the n-th in SDK order.
const ALL_LEGS: u8 = (1 << LEGS) - 1;

/// What listening may cost in a step that solves or diagnoses as well, instructions by estimate: all that four legs polled at
/// 1 kHz bring.
const LISTENING: usize = 40_000;

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
        self.begun = false;
        self.reset(memory);
    }

    /// Forgets all data and counts, in place, but not where the joints' zeros are. The first step does it; a board that counts the cost of
    /// steps does it before.
    pub fn reset(&mut self, memory: &mut Memory<T>) {
        let identity = self.identity();
        if !core::mem::replace(&mut self.begun, true) {
            self.legs.iter_mut().for_each(|leg| leg.begin(&identity));
        }
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

    /// Becomes what it was when the newest whole snapshot in `flash` was made, if that is of the same schema, robot and model; the
    /// hello says what became of it. From then on [`keep`](Self::keep) writes snapshots there.
    ///
    /// For the start, after [`begin`](Self::begin) and before the first step: it takes as long as reading the flash does.
    pub fn restore(&mut self, memory: &mut Memory<T>, flash: &mut impl NorFlash) {
        if !self.begun {
            self.reset(memory);
        }
        let setup = self.identity().start.setup;
        self.snapshots
            .open(flash, setup, &mut self.legs, &mut memory.0);
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

    /// Whether a leg is identified: it is listened to, its zeros are known, and its wiring is right.
    fn identifies(&self, leg: usize) -> bool {
        self.listens_to(leg) && self.legs.get(leg).is_some_and(LegLine::is_cleared)
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
        self.obey(memory, now_us);
        self.feel_ground(now_us);
        let folded = self.fold(memory);
        let effort = if folded { FOLDING_EFFORT } else { STEP_EFFORT };
        let lines = self.legs.iter_mut().zip(&mut memory.0);
        let listening: usize = lines.map(|(leg, data)| leg.listen(data, effort)).sum();
        if listening > LISTENING {
            // A zero that is void made listening dear; the hello says so.
            self.tell_voided();
        } else if !folded {
            self.work(memory, now_us);
        }
        if let Some(message) = self.message(memory, now_us) {
            out(&message);
        }
    }

    /// Has the hello come at once if a zero is void that was not.
    #[cold]
    #[inline(never)]
    fn tell_voided(&mut self) {
        let mut voided = false;
        self.legs
            .iter_mut()
            .for_each(|leg| voided |= leg.take_voided());
        if voided {
            self.hello_at = 0;
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

    fn identity(&self) -> Identity {
        self.identity.get().copied().unwrap_or(NOBODY)
    }
}
