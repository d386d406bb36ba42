//! Driver of the LSM6DSO, an accelerometer and gyroscope of STMicroelectronics, over SPI: no allocation, no panic.
//!
//! [`Lsm6dso::begin`] resets the chip, says how it is to measure and reads back whether it took that; [`Lsm6dso::read`] is one burst of
//! 16 registers, refused if it is not a new measurement; [`Lsm6dso::self_test`] has the chip push its own masses, while it rests. Any
//! [`SpiDevice`](embedded_hal::spi::SpiDevice) of mode 3 and at most 10 MHz will do.
//!
//! What the chip does is by its data sheet (ST, DS12140 rev. 2) and application note (ST, AN5192). No crate did this when it was
//! written: `lsm6dso` 0.2 speaks I²C alone, and those of the BMI270 load 8 KiB into their chip at each start.
//! **Tried against a simulated chip (`simulated.rs`), not against a real one.**
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

mod lsm6dso;
mod registers;
mod self_test;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod tests;

pub use lsm6dso::{Fault, Lsm6dso, Reading};
pub use registers::{AccRange, GyroRange, Rate, Settings};
pub use self_test::SelfTest;
