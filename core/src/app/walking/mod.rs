//! The line of a robot that walks, one bounded step at a time: the bytes of four buses and an IMU's readings in, messages out.
//!
//! A firmware of its own beside [`App`](super::App), which identifies legs of a robot that hangs: both at once would take more RAM than a
//! microcontroller has (540 of 512 KiB in `f64`), and a robot does one or the other. [`WalkingApp::step`]
//!
//! 1. decodes what the buses have brought and, of each leg, takes the last polling cycle (`line`);
//! 2. once all four legs have a new one, makes the whole robot's sample of them and, in the next step, gives it with what the IMU read around
//!    its time ([`readings`](super::readings)) to the [`Walker`]: one in a step at most;
//! 3. folds or solves a part ([`Walker::step`]);
//! 4. says at most one message (`messages`).
//!
//! The sensor of a foot is told by its calf's replies; one that is always the same is not asked.

mod line;
mod messages;

use super::counts;
use super::readings::Readings;
use super::requests::Requests;
use super::setup::SetupRecord;
use super::{HELLO_US, Health, Identity, NOBODY, REPORT_US};
use crate::Real;
use crate::factor::FactorError;
use crate::go2::{JOINTS, LEGS, Leg};
use crate::scalar::real;
use crate::slot::Slot;
use crate::spatial::Transform;
use crate::walk::{WalkMemory, WalkSample, Walker};
use crate::window::{Sample, microseconds};
use crate::wire::{Action, Answer, DeviceMessage, HostMessage, Imu, Load, Losses, Outcome};
use embedded_storage::nor_flash::NorFlash;
use line::Line;
use nalgebra::Vector3;

/// Time between two solutions, µs.
pub const WALK_US: u64 = 3_000_000;
/// Legs' samples further apart than this are not of one time, µs.
const APART_US: u64 = 2_000;

/// What is known of the robot, beside the application: all zeros at first.
pub struct WalkingMemory<T: Real> {
    lines: [Line<T>; LEGS],
    walk: WalkMemory<T>,
}

impl<T: Real> WalkingMemory<T> {
    /// No data, a constant.
    pub const fn new() -> Self {
        Self {
            lines: [const { Line::new() }; LEGS],
            walk: WalkMemory::new(),
        }
    }
}

impl<T: Real> Default for WalkingMemory<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// The application of a robot that walks.
pub struct WalkingApp<T: Real> {
    identity: Slot<Identity>,
    walker: Walker<T>,
    /// What the host said of the IMU: of the time of the step after it.
    imu: Slot<Imu>,
    readings: Readings,
    requests: Requests,
    setup: SetupRecord,
    /// A sample that waits for the IMU's readings after its time.
    pending: Slot<WalkSample<T>>,
    without_imu: u32,
    solve_at: u64,
    solving_us: u64,
    solved: bool,
    hello_at: u64,
    counters_at: u64,
    pub(super) load: Load,
    losses: Losses,
}

impl<T: Real> WalkingApp<T> {
    /// An application that is nobody yet, a constant of zeros; [`begin`](Self::begin) says who it is.
    pub const fn unset() -> Self {
        Self {
            identity: Slot::Empty,
            walker: Walker::unset(),
            imu: Slot::Empty,
            readings: Readings::new(),
            requests: Requests::new(),
            setup: SetupRecord::new(),
            pending: Slot::Empty,
            without_imu: 0,
            solve_at: 0,
            solving_us: 0,
            solved: false,
            hello_at: 0,
            counters_at: 0,
            load: Load::ZERO,
            losses: Losses::ZERO,
        }
    }

    /// Becomes the application of `identity` on a robot whose trunk carries the IMU at `mounting`: its origin in the trunk's frame, and the
    /// rotation from its axes to the trunk's. Forgets all data. For the start: the priors take some millions of instructions.
    ///
    /// # Errors
    /// None with the Go2's constants: as [`Walker::begin`].
    pub fn begin(
        &mut self,
        memory: &mut WalkingMemory<T>,
        identity: Identity,
        mounting: &Transform<T>,
    ) -> Result<(), FactorError> {
        self.identity = Slot::Full(identity);
        memory
            .lines
            .iter_mut()
            .for_each(|line| line.begin(&identity));
        self.imu = Slot::Empty;
        self.readings.clear();
        self.pending = Slot::Empty;
        self.without_imu = 0;
        self.solve_at = WALK_US;
        self.solved = false;
        self.hello_at = 0;
        self.counters_at = 0;
        self.load = Load::ZERO;
        self.walker.begin(&mut memory.walk, mounting)
    }

    /// Finds what `flash` says that the board is set up for; from then on [`keep`](Self::keep) writes that there. For the start, after
    /// [`begin`](Self::begin).
    pub fn restore(&mut self, flash: &mut impl NorFlash) {
        let setup = self.identity().start.setup;
        self.setup.open(flash, setup);
    }

    /// Does a step of writing what the host set the board up for. A walk itself is short, and is not kept over the power.
    #[inline(never)]
    pub fn keep(&mut self, flash: &mut impl NorFlash) {
        let _ = self.setup.advance(flash);
    }

    /// Takes what the host says. Of requests those about the joints' zeros and the board are obeyed, one a step; the others are of legs that hang, and get
    /// no answer.
    pub fn handle(&mut self, message: &HostMessage) {
        match message {
            HostMessage::RequestHello => self.hello_at = 0,
            HostMessage::Imu(imu) => self.imu = Slot::Full(*imu),
            HostMessage::Request(request) => match request.action {
                Action::SetPositions(_)
                | Action::SetZero(_)
                | Action::TrustZeros
                | Action::TrustWiring
                | Action::SetUp(_) => {
                    self.requests.push(*request);
                }
                _ => {}
            },
            HostMessage::ReadFactor(_) | HostMessage::Advance(_) => {}
        }
    }

    /// Takes a reading of the board's own IMU, measured at `time_us` on the clock of the steps.
    pub fn feel(&mut self, imu: &Imu, time_us: u64) {
        self.readings.push(time_us, imu);
    }

    /// Takes what a leg's bus brought without a pause, `end_us` being when its last byte came.
    pub fn hear(&mut self, memory: &mut WalkingMemory<T>, leg: usize, bytes: &[u8], end_us: u64) {
        let byte_ns = self.identity().byte_ns;
        if let Some(line) = memory.lines.get_mut(leg) {
            line.queue.push(bytes, end_us, byte_ns);
        }
    }

    /// Takes note of what the last step cost, in the identity's unit, and of the deepest stack so far.
    pub fn record_cost(&mut self, cost: u32, stack_bytes: u32) {
        self.load.record(cost, stack_bytes, self.identity().budget);
    }

    /// Takes note of what was lost around the application since the start.
    pub fn record_losses(&mut self, losses: Losses) {
        self.losses = losses;
    }

    // A symbol of its own, like [`App::step`](super::App::step).
    /// One step at `now_us`. `out` gets the messages to the host.
    #[inline(never)]
    pub fn step(
        &mut self,
        memory: &mut WalkingMemory<T>,
        now_us: u64,
        out: &mut impl FnMut(&DeviceMessage),
    ) {
        self.keep_up(now_us);
        if let Some(imu) = self.imu.take() {
            self.readings.push(now_us, &imu);
        }
        self.give();
        self.obey(memory, now_us);
        memory.lines.iter_mut().for_each(Line::listen);
        for line in &mut memory.lines {
            if core::mem::take(&mut line.voided) {
                self.hello_at = 0;
            }
        }
        if memory.lines.iter().all(|line| line.fresh) {
            self.sample(memory);
        }
        if now_us >= self.solve_at {
            self.solve_at = now_us.saturating_add(WALK_US);
            self.solving_us = now_us;
            self.walker.solve();
        }
        self.solved |= self.walker.step(&mut memory.walk);
        if let Some(message) = self.message(memory, now_us) {
            out(&message);
        }
    }

    /// Brings forward what is due further ahead than it ever is, where the clock has gone back.
    fn keep_up(&mut self, now_us: u64) {
        let within = |due: u64, period: u64| due.min(now_us.saturating_add(period));
        self.hello_at = within(self.hello_at, HELLO_US);
        self.counters_at = within(self.counters_at, REPORT_US);
        self.solve_at = within(self.solve_at, WALK_US);
    }

    /// Obeys the request that has waited longest. A zero that is set anew leaves what was learnt: a walk is short, and is begun anew.
    #[inline(never)]
    fn obey(&mut self, memory: &mut WalkingMemory<T>, now_us: u64) {
        let Some(request) = self.requests.next() else {
            return;
        };
        let outcome = match request.action {
            Action::SetPositions(positions) => {
                let lines = memory.lines.iter_mut();
                lines.for_each(|line| line.set_positions(positions));
                Outcome::Accepted
            }
            Action::SetZero(asked) => {
                let leg = usize::from(asked.leg);
                match (Leg::ALL.get(leg), memory.lines.get_mut(leg)) {
                    (Some(which), Some(line)) => line.set_zero(*which, &asked, now_us),
                    _ => Outcome::NoSuchLeg,
                }
            }
            Action::SetUp(setup) => self.setup.want(setup),
            // Nothing is kept of a walk.
            _ => Outcome::NoStorage,
        };
        self.hello_at = 0;
        self.requests.answer(Answer {
            id: request.id,
            outcome,
        });
    }

    /// Gives the walker the sample that waits, with what the IMU read.
    #[inline(never)]
    fn give(&mut self) {
        let Slot::Full(sample) = &mut self.pending else {
            return;
        };
        match self.readings.at(sample.joints.time_us) {
            Some(imu) => {
                let vector = |x: [f32; 3]| Vector3::from(x.map(|x| real(f64::from(x))));
                (sample.gyro, sample.acc) = (vector(imu.gyro), vector(imu.acc));
                self.walker.push(sample);
            }
            None => self.without_imu = self.without_imu.wrapping_add(1),
        }
        self.pending = Slot::Empty;
    }

    /// Makes the robot's sample of the legs', at the time of the last of them: positions go on with their velocities.
    #[inline(never)]
    fn sample(&mut self, memory: &mut WalkingMemory<T>) {
        let times = memory.lines.iter().map(|line| line.latest.time_us);
        let (first, last) = times.fold((u64::MAX, 0), |(first, last), time| {
            (first.min(time), last.max(time))
        });
        if last.saturating_sub(first) > APART_US {
            // The leg that is behind has lost a cycle.
            for line in &mut memory.lines {
                line.fresh = line.latest.time_us.saturating_add(APART_US) >= last;
            }
            return;
        }
        memory.lines.iter_mut().for_each(|line| line.fresh = false);
        let nothing = Vector3::new(T::ZERO, T::ZERO, T::ZERO);
        let mut sample = WalkSample {
            gyro: nothing,
            acc: nothing,
            count: memory.lines.each_ref().map(|line| line.count),
            joints: Sample {
                time_us: last,
                q: [T::zero(); JOINTS],
                dq: [T::zero(); JOINTS],
                tau: [T::zero(); JOINTS],
            },
        };
        let joints = &mut sample.joints;
        let places = joints.q.iter_mut().zip(&mut joints.dq).zip(&mut joints.tau);
        let readings = memory.lines.iter().flat_map(|line| {
            let own = &line.latest;
            let late = microseconds::<T>(last.saturating_sub(own.time_us));
            let values = own.q.iter().zip(&own.dq).zip(&own.tau);
            values.map(move |((q, dq), tau)| (*q + *dq * late, *dq, *tau))
        });
        for (((q, dq), tau), from) in places.zip(readings) {
            (*q, *dq, *tau) = from;
        }
        self.pending = Slot::Full(sample);
    }

    /// What is told without a host.
    pub fn health(&self, memory: &WalkingMemory<T>) -> Health {
        let legs = memory.lines.iter().map(Line::counters);
        let mut health = counts::health(legs, &self.losses, &self.load);
        let refused = self.without_imu.wrapping_add(self.walker.counts().rejected);
        health.losses = health.losses.wrapping_add(refused);
        health
    }

    fn identity(&self) -> Identity {
        self.identity.get().copied().unwrap_or(NOBODY)
    }
}
