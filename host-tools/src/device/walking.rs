//! The application of a robot that walks, in this process.

use proprio_core::Real;
use proprio_core::app::{WalkingApp, WalkingMemory};
use proprio_core::wire::{DeviceMessage, Hello, HostMessage};

use super::desktop::identity;
use super::{BusStep, Device, DeviceError};

/// The application fed directly, of a Go2 with its IMU where a board that is not set up takes it to be. What the IMU reads is said before a step
/// ([`HostMessage::Imu`]), as to an emulated board.
pub struct WalkingDesktop<T: Real> {
    app: Box<WalkingApp<T>>,
    memory: Box<WalkingMemory<T>>,
    hello: Hello,
}

impl<T: Real> WalkingDesktop<T> {
    /// A device that has seen nothing.
    pub fn new() -> Self {
        let mut app = Box::new(WalkingApp::unset());
        let mut memory = Box::new(WalkingMemory::new());
        let identity = identity();
        let mounting = identity.start.setup.mounting();
        app.begin(&mut memory, identity, &mounting)
            .expect("of the Go2's constants the priors can be made");
        // Every board does one step at time 0, and it says hello.
        let mut hello = None;
        app.step(&mut memory, 0, &mut |message| {
            if let DeviceMessage::Hello(said) = message {
                hello = Some(said.clone());
            }
        });
        let hello = hello.expect("the application says hello in its first step");
        Self { app, memory, hello }
    }
}

impl<T: Real> Default for WalkingDesktop<T> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real> Device for WalkingDesktop<T> {
    fn hello(&self) -> &Hello {
        &self.hello
    }

    fn command(&mut self, message: &HostMessage) -> Result<(), DeviceError> {
        self.app.handle(message);
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
        Ok(())
    }

    fn losses(&self) -> (u32, u32) {
        (0, 0)
    }

    fn settle(&mut self, _: &mut dyn FnMut(DeviceMessage)) -> Result<(), DeviceError> {
        Ok(())
    }
}
