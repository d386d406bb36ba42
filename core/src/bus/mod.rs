//! The Go2's motor bus: GO-M8010-6 commands and replies on RS-485.
//!
//! Each leg has a half-duplex bus on which the master polls its motors, three unless said otherwise: a 17-byte [`Command`], answered by a 16-byte
//! [`Reply`]. A listener sees both. [`Queue`] keeps the bytes and when they came; [`Decoder`] gives the frames back, whatever
//! lies between them; [`Listener`] makes polling cycles of them. [`Command::encode`] and [`Reply::encode`] make the bytes of a
//! replay. Frames keep the integers of the wire, so that nothing is lost by decoding; accessors convert to SI units on the
//! joint side.
//!
//! A frame is a two-byte header, a body and a CRC-16 whose starting value, the *seed*, depends on the motor's firmware:
//! 0 on motors sold alone, 0x2CBB on a Go2's commands, unknown on a Go2's replies. [`crc`] says how a listener finds it,
//! [`Schedule`] what else it finds.
//!
//! Facts, quanta and captured frames: `go2.md`, "Motor bus".

mod assembly;
pub mod crc;
mod decoder;
mod encoder;
mod frame;
mod listener;
#[cfg(test)]
mod listener_tests;
mod queue;
mod schedule;
#[cfg(test)]
mod tests;

pub use assembly::{AssemblyCounters, Breaks, Cycle, Heard};
pub use decoder::{Decoder, DecoderCounters, Frame};
pub use encoder::MotorState;
#[cfg(feature = "app")]
pub(crate) use frame::joint_side;
pub use frame::{Command, EncodeError, Mode, Reply, Status, position_counts};
pub use listener::Listener;
pub use queue::Queue;
pub use schedule::Schedule;

/// Motors on a bus, where nothing else is said.
pub const MOTORS: usize = 3;
