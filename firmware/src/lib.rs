//! The motor-bus listener's boards.
//!
//! A [board](board::Board) brings bytes and time, the [loop](listener) hands them to an [application](application), and its messages to the board.
//! A board listens to the motor buses and never transmits on them.
#![no_std]

pub mod application;
pub mod board;
pub mod crash;
pub mod listener;
pub mod stack;

/// What the firmware computes with: both work; feature `single` picks the smaller.
#[cfg(not(feature = "single"))]
pub type Scalar = f64;
/// What the firmware computes with.
#[cfg(feature = "single")]
pub type Scalar = f32;

/// The commit that this was built of, with a `+` behind it if the sources were others; empty where there was no git.
pub const GIT: &str = env!("PROPRIO_GIT");

/// Version told to the host.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");
