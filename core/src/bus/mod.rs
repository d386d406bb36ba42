//! The Go2's motor bus: GO-M8010-6 commands and replies on RS-485.
//!
//! Each leg has a half-duplex bus on which the master polls three motors: a 17-byte [`Command`], answered by a 16-byte
//! [`Reply`]. A listener sees both. [`Decoder`] takes the bytes one at a time and gives the frames back, whatever lies
//! between them; [`Command::encode`] and [`Reply::encode`] make the bytes of a replay. Frames keep the integers of the
//! wire, so that nothing is lost by decoding; accessors convert to SI units on the joint side.
//!
//! A frame is a two-byte header, a body and a CRC-16 whose starting value, the *seed*, depends on the motor's firmware:
//! 0 on motors sold alone, 0x2CBB on a Go2's commands, unknown on a Go2's replies. [`crc`] says how a listener finds it.
//!
//! Facts, quanta and captured frames: `go2.md`, "Motor bus".

pub mod crc;
mod decoder;
mod frame;
#[cfg(test)]
mod tests;

pub use decoder::{Decoder, DecoderCounters, Frame};
pub use frame::{Command, EncodeError, Mode, Reply, Status};
