//! A board on serial ports.
//!
//! A board lives in its own time, so steps are sent when they are due. One port is the host link; each leg that is to be
//! played needs an RS-485 adapter of its own at [`BUS_BAUD`], wired to that leg's input.

use std::io::{Read, Write};
use std::time::{Duration, Instant};

use proprio_core::go2::{Go2, JOINTS_PER_LEG, LEGS};
use proprio_core::robot::Robot;
use proprio_core::wire::{DeviceMessage, HOST_BAUD, Hello, HostMessage};
use serialport::SerialPort;

use super::link::Link;
use super::{BusStep, Device, DeviceError};

/// Baud rate of the motor bus.
pub const BUS_BAUD: u32 = <Go2 as Robot<JOINTS_PER_LEG>>::BAUD;

/// A board.
pub struct SerialDevice {
    link: Link<Box<dyn SerialPort>>,
    buses: [Option<Box<dyn SerialPort>>; LEGS],
    hello: Hello,
    /// When the first step was sent and what its time was.
    start: Option<(Instant, u64)>,
}

impl SerialDevice {
    /// Opens the host link and the adapters, and asks the board who it is.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn open(host: &str, buses: [Option<&str>; LEGS]) -> Result<Self, DeviceError> {
        let mut link = Link::new(open(host, HOST_BAUD)?);
        let mut adapters = [const { None }; LEGS];
        for (adapter, port) in adapters.iter_mut().zip(buses) {
            *adapter = port.map(|port| open(port, BUS_BAUD)).transpose()?;
        }
        link.send(&HostMessage::RequestHello)?;
        let hello = link.hello()?;
        Ok(Self {
            link,
            buses: adapters,
            hello,
            start: None,
        })
    }

    /// What has come since the last call, waiting up to a millisecond.
    ///
    /// # Errors
    /// [`DeviceError`].
    pub fn listen(&mut self, told: &mut dyn FnMut(DeviceMessage)) -> Result<(), DeviceError> {
        self.link.receive(told).map(drop)
    }
}

/// A serial port, 8N1, whose reads give up after a millisecond.
///
/// # Errors
/// [`DeviceError::Port`].
fn open(port: &str, baud: u32) -> Result<Box<dyn SerialPort>, DeviceError> {
    serialport::new(port, baud)
        .timeout(Duration::from_millis(1))
        .open()
        .map_err(|source| DeviceError::Port {
            port: port.to_owned(),
            source,
        })
}

/// Opens a serial port to listen to: nothing can be sent through what is given.
///
/// # Errors
/// [`DeviceError::Port`].
pub fn listen(port: &str, baud: u32) -> Result<Box<dyn Read + Send>, DeviceError> {
    Ok(Box::new(open(port, baud)?))
}

impl Device for SerialDevice {
    fn hello(&self) -> &Hello {
        &self.hello
    }

    fn command(&mut self, message: &HostMessage) -> Result<(), DeviceError> {
        self.link.send(message)
    }

    fn play(
        &mut self,
        step: &BusStep,
        told: &mut dyn FnMut(DeviceMessage),
    ) -> Result<(), DeviceError> {
        let (started, first_us) = *self.start.get_or_insert((Instant::now(), step.time_us));
        let due = started + Duration::from_micros(step.time_us.saturating_sub(first_us));
        while Instant::now() < due {
            self.listen(told)?;
        }
        for (bus, bytes) in self.buses.iter_mut().zip(&step.buses) {
            if let Some(bus) = bus {
                bus.write_all(bytes)?;
            }
        }
        Ok(())
    }

    fn losses(&self) -> (u32, u32) {
        self.link.losses()
    }

    fn settle(&mut self, told: &mut dyn FnMut(DeviceMessage)) -> Result<(), DeviceError> {
        let until = Instant::now() + Duration::from_millis(200);
        while Instant::now() < until {
            self.listen(told)?;
        }
        Ok(())
    }
}
