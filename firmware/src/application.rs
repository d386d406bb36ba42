//! The two applications, as the boards' loops need them: each an image of its own, for both at once would take more RAM than a
//! microcontroller has.

use crate::Scalar;
use embedded_storage::nor_flash::NorFlash;
use proprio_core::app::{App, Health, Identity, Memory, WalkingApp, WalkingMemory};
use proprio_core::wire::{DeviceMessage, HostMessage, Imu, Losses};
use static_cell::ConstStaticCell;

/// An application and its memory.
pub trait Application {
    /// Becomes the application of `identity`, and goes on from what is in `flash` if it keeps anything there.
    fn begin(&mut self, identity: Identity, flash: &mut impl NorFlash);
    /// Takes what the host says.
    fn handle(&mut self, message: &HostMessage);
    /// Takes a reading of the board's own IMU.
    fn feel(&mut self, imu: &Imu, time_us: u64);
    /// Takes what a leg's bus brought without a pause, and when the last of it came.
    fn hear(&mut self, leg: usize, bytes: &[u8], end_us: u64);
    /// Does one step.
    fn step(&mut self, now_us: u64, out: &mut impl FnMut(&DeviceMessage));
    /// Does a step of keeping what it knows.
    fn keep(&mut self, flash: &mut impl NorFlash, now_us: u64);
    /// What is told without a host.
    fn health(&self) -> Health;
    /// Takes note of what a step cost.
    fn record_cost(&mut self, cost: u32, stack_bytes: u32);
    /// Takes note of what was lost around it.
    fn record_losses(&mut self, losses: Losses);
}

/// That of a robot that hangs: its legs.
pub struct Hanging {
    app: &'static mut App<Scalar>,
    memory: &'static mut Memory<Scalar>,
}

impl Hanging {
    /// The application; once.
    pub fn take() -> Self {
        // All zeros at first: no copies of them lie in flash.
        static APP: ConstStaticCell<App<Scalar>> = ConstStaticCell::new(App::unset());
        static MEMORY: ConstStaticCell<Memory<Scalar>> = ConstStaticCell::new(Memory::new());
        Self {
            app: APP.take(),
            memory: MEMORY.take(),
        }
    }
}

impl Application for Hanging {
    fn begin(&mut self, identity: Identity, flash: &mut impl NorFlash) {
        self.app.begin(self.memory, identity);
        self.app.restore(self.memory, flash);
    }

    fn handle(&mut self, message: &HostMessage) {
        self.app.handle(self.memory, message);
    }

    fn feel(&mut self, _: &Imu, _: u64) {
        // It hangs still.
    }

    fn hear(&mut self, leg: usize, bytes: &[u8], end_us: u64) {
        self.app.hear(self.memory, leg, bytes, end_us);
    }

    fn step(&mut self, now_us: u64, out: &mut impl FnMut(&DeviceMessage)) {
        self.app.step(self.memory, now_us, out);
    }

    fn keep(&mut self, flash: &mut impl NorFlash, now_us: u64) {
        self.app.keep(self.memory, flash, now_us);
    }

    fn health(&self) -> Health {
        self.app.health()
    }

    fn record_cost(&mut self, cost: u32, stack_bytes: u32) {
        self.app.record_cost(cost, stack_bytes);
    }

    fn record_losses(&mut self, losses: Losses) {
        self.app.record_losses(losses);
    }
}

/// That of a robot that walks: all of it.
pub struct Walking {
    app: &'static mut WalkingApp<Scalar>,
    memory: &'static mut WalkingMemory<Scalar>,
}

impl Walking {
    /// The application; once.
    pub fn take() -> Self {
        static APP: ConstStaticCell<WalkingApp<Scalar>> = ConstStaticCell::new(WalkingApp::unset());
        static MEMORY: ConstStaticCell<WalkingMemory<Scalar>> =
            ConstStaticCell::new(WalkingMemory::new());
        Self {
            app: APP.take(),
            memory: MEMORY.take(),
        }
    }
}

impl Application for Walking {
    fn begin(&mut self, identity: Identity, flash: &mut impl NorFlash) {
        let mounting = identity.start.setup.mounting();
        // Of the Go2's constants the priors can be made: a test does.
        let _ = self.app.begin(self.memory, identity, &mounting);
        self.app.restore(flash);
    }

    fn handle(&mut self, message: &HostMessage) {
        self.app.handle(message);
    }

    fn feel(&mut self, imu: &Imu, time_us: u64) {
        self.app.feel(imu, time_us);
    }

    fn hear(&mut self, leg: usize, bytes: &[u8], end_us: u64) {
        self.app.hear(self.memory, leg, bytes, end_us);
    }

    fn step(&mut self, now_us: u64, out: &mut impl FnMut(&DeviceMessage)) {
        self.app.step(self.memory, now_us, out);
    }

    fn keep(&mut self, flash: &mut impl NorFlash, _: u64) {
        self.app.keep(flash);
    }

    fn health(&self) -> Health {
        self.app.health(self.memory)
    }

    fn record_cost(&mut self, cost: u32, stack_bytes: u32) {
        self.app.record_cost(cost, stack_bytes);
    }

    fn record_losses(&mut self, losses: Losses) {
        self.app.record_losses(losses);
    }
}
