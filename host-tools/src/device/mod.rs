//! Devices that run proprio's application: the firmware in an emulator, the firmware on a board, the same code in-process.
//!
//! All three take [`BusStep`]s, the bytes of the motor buses between two moments, and tell [`DeviceMessage`]s. The emulated
//! and the in-process device live in the time of the steps; a board lives in its own, so that steps are sent when they are
//! due ([`serial`]).
//!
//! Files beside:
//!
//! - `desktop`: the application in this process, for comparison with a device's
//! - `image`: the firmware image, built by `firmware/build` of the clone that this program is from
//! - `link`: messages over a byte stream
//! - `names`: what a device's numbers mean: which joint, which effect, which parameter
//! - `poses`: poses in which joints are against their stops
//! - `power_up`: from where a simulated robot's motors count
//! - `ports`: serial ports, and what is likely behind them
//! - `programmer`: programs that flash a NUCLEO-H743ZI2
//! - `pull`: whole factors read from a device, part by part
//! - `qemu`: the firmware on an emulated Cortex-M7
//! - `replay`: a log's samples as motor-bus bytes, played into a device
//! - `requests`: a host's requests, asked again until they are answered
//! - `robot`: a simulated robot on four motor buses, for devices that have none
//! - `rows`: rows of a log, whole or still growing, as steps of motor buses
//! - `walking`: the application of a robot that walks, in this process

mod desktop;
pub mod image;
mod link;
pub mod names;
pub mod ports;
pub mod poses;
pub mod power_up;
pub mod programmer;
pub mod pull;
pub mod qemu;
pub mod replay;
mod requests;
mod robot;
mod rows;
pub mod serial;
mod walking;

pub use desktop::Desktop;
pub use qemu::Qemu;
pub use requests::Requests;
pub use robot::{Robot, RobotError};
pub use rows::{Played, RowSteps};
pub use walking::WalkingDesktop;

use std::path::PathBuf;

use proprio_core::go2::LEGS;
use proprio_core::wire::{DeviceMessage, Hello, HostMessage, Imu, WireError};

/// What the four buses carry between the last step and this one.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BusStep {
    /// Time of the step, µs.
    pub time_us: u64,
    /// Bytes of each leg's bus, in SDK order.
    pub buses: [Vec<u8>; LEGS],
}

/// A step of a device that listens to a robot that walks: what its IMU reads, then what its buses bring.
#[derive(Clone, Debug, PartialEq)]
pub struct WalkStep {
    /// The reading.
    pub imu: Imu,
    /// A polling cycle of each leg.
    pub bus: BusStep,
}

/// Something that listens to motor buses.
pub trait Device {
    /// What the device said of itself.
    fn hello(&self) -> &Hello;

    /// Sends a command; the device obeys before the next step is done.
    ///
    /// # Errors
    /// [`DeviceError`] if the device cannot be reached any more.
    fn command(&mut self, message: &HostMessage) -> Result<(), DeviceError>;

    /// Plays one step. What the device says meanwhile, to this or an earlier step, goes to `told`.
    ///
    /// # Errors
    /// [`DeviceError`] if the device cannot be reached any more.
    fn play(
        &mut self,
        step: &BusStep,
        told: &mut dyn FnMut(DeviceMessage),
    ) -> Result<(), DeviceError>;

    /// Frames from the device that were damaged, and that never came.
    fn losses(&self) -> (u32, u32);

    /// Waits until all steps are done.
    ///
    /// # Errors
    /// As [`Self::play`].
    fn settle(&mut self, told: &mut dyn FnMut(DeviceMessage)) -> Result<(), DeviceError>;
}

/// Why a device cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DeviceError {
    /// The firmware's sources are not where this program was built, nor above the current directory.
    #[error("the firmware's sources are not here: run this inside a clone of proprio")]
    NoSources,
    /// The firmware did not build; the compiler has said why.
    #[error("the firmware did not build: {0}")]
    Build(String),
    /// The image to be flashed cannot be read.
    #[error("{}: {source}", .image.display())]
    Image {
        /// Its path.
        image: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The image to be flashed is none of a Cortex-M.
    #[error("{}: no program for an Arm core", .0.display())]
    NotAnImage(PathBuf),
    /// No program that flashes boards is installed.
    #[error("none of {} is installed", programmer::names())]
    NoProgrammer,
    /// The program that flashes boards failed; it has said why.
    #[error("{0} failed: {1}")]
    Programmer(&'static str, String),
    /// The emulator is not installed.
    #[error("qemu-system-arm is not installed: on Debian, apt-get install qemu-system-arm")]
    NoEmulator,
    /// The emulator ended or never came up.
    #[error("the emulator ended ({0}); its output: {1}")]
    Emulator(String, String),
    /// The firmware panicked or faulted; it has begun anew, and what was played is lost.
    #[error("the firmware crashed: {0}")]
    Crashed(String),
    /// The device says nothing.
    #[error("the device has sent nothing for {0} s")]
    Silent(u64),
    /// The device speaks another language.
    #[error(transparent)]
    Wire(#[from] WireError),
    /// The device was built when some messages of a host were others, or none.
    #[error("the device's firmware does not take this program's {0}")]
    OtherLayout(&'static str),
    /// A serial port cannot be opened or set.
    #[error("{port}: {source}")]
    Port {
        /// Its name.
        port: String,
        /// What the operating system says.
        source: serialport::Error,
    },
    /// The device has no factors to read, or of a shape that this program does not know.
    #[error("the device's factors are none that this program knows")]
    NoFactor,
    /// A link failed.
    #[error("the link to the device: {0}")]
    Link(#[from] std::io::Error),
}
