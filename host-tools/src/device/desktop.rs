//! The application in this process, for comparison with a device's.

use proprio_core::Real;
use proprio_core::app::{App, Identity, Memory, SETUP_SECTORS, Start, setup_in};
use proprio_core::storage::{RamFlash, SECTOR};
use proprio_core::wire::{DeviceMessage, Hello, HostMessage, Positions};

use super::{BusStep, Device, DeviceError};

/// The application fed directly.
pub struct Desktop<T: Real> {
    app: Box<App<T>>,
    memory: Box<Memory<T>>,
    hello: Hello,
    flash: RamFlash<Vec<u8>>,
}

/// Who an application in this process is.
pub(super) const fn identity() -> Identity {
    Identity {
        firmware: env!("CARGO_PKG_VERSION"),
        board: "desktop",
        start: Start::UNKNOWN,
        load_unit: "nothing",
        budget: u32::MAX,
        byte_ns: 0,
        // What it hears is a log's or a simulator's.
        positions: Positions::Absolute,
    }
}

/// Snapshots that the flash has room for.
const SLOTS: usize = 2;

impl<T: Real> Desktop<T> {
    /// A device that has seen nothing.
    pub fn new() -> Self {
        Self::start(RamFlash::new(vec![0xFF; (SLOTS + SETUP_SECTORS) * SECTOR]))
    }

    /// The same device after its power was off: what is in its flash is all that is left.
    pub fn restarted(self) -> Self {
        Self::start(self.flash)
    }

    fn start(mut flash: RamFlash<Vec<u8>>) -> Self {
        let mut identity = identity();
        identity.start.setup = setup_in(&mut flash, identity.start.setup);
        let mut app = Box::new(App::new(identity));
        let mut memory = Box::new(Memory::new());
        app.restore(&mut memory, &mut flash);
        // Every board does one step at time 0, and it says hello.
        let mut hello = None;
        app.step(&mut memory, 0, &mut |message| {
            if let DeviceMessage::Hello(said) = message {
                hello = Some(said.clone());
            }
        });
        let hello = hello.expect("the application says hello in its first step");
        Self {
            app,
            memory,
            hello,
            flash,
        }
    }
}

impl<T: Real> Default for Desktop<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Device for Desktop<T> {
    fn hello(&self) -> &Hello {
        &self.hello
    }

    fn command(&mut self, message: &HostMessage) -> Result<(), DeviceError> {
        self.app.handle(&mut self.memory, message);
        Ok(())
    }

    fn play(
        &mut self,
        step: &BusStep,
        told: &mut dyn FnMut(DeviceMessage),
    ) -> Result<(), DeviceError> {
        for (leg, bytes) in step.buses.iter().enumerate() {
            self.app.hear(&mut self.memory, leg, bytes, step.time_us);
        }
        self.app
            .step(&mut self.memory, step.time_us, &mut |message| {
                told(message.clone())
            });
        self.app.keep(&self.memory, &mut self.flash, step.time_us);
        Ok(())
    }

    fn losses(&self) -> (u32, u32) {
        (0, 0)
    }

    fn settle(&mut self, _: &mut dyn FnMut(DeviceMessage)) -> Result<(), DeviceError> {
        Ok(())
    }
}
