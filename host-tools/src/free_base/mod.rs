//! Trunk and legs of a robot that walks, from encoders, motor torques, gyro and accelerometer alone: what `identify --free-base`,
//! `diagnose --free-base` and `compare --free-base` share.
//!
//! 1. `walk`: the log, what gravity's length tells of the accelerometer. `gravity`: its direction. `speed`: joint velocities from the quieter of
//!    two channels, a quieter gyro. `rest`: joints that friction may hold.
//! 2. `stance`: which feet may carry a force; those are projected out.
//!    `held`: whether something beyond them carries the robot.
//! 3. `columns`: which column is what. `rows`: the core's windows ([`proprio_core::window::FreeBaseWindow`]), row by row.
//!    `projection`: columns of any effect's torque in them.
//!    `sensors`: what these get wrong, in columns of their own. `residual`: what windows leave at known parameters, which these are differences of.
//! 4. `data`: the rows as one factor per block of time.
//!    `outside`: windows that no model of the catalogue explains. `unseen`: those of a foot that is taken to be in the air and is not.
//! 5. `structure`: which effects a model has, and how well its bodies are known. `fit`: its 13 bodies, their joints' effects and what
//!    sensors get wrong. `expected`: what a motion would tell before it is played.

pub(crate) mod columns;
pub(crate) mod coordinates;
pub(crate) mod data;
mod error;
pub(crate) mod expected;
pub(crate) mod fit;
mod gravity;
mod held;
mod imu;
mod moved_readings;
mod outside;
pub(crate) mod projection;
mod residual;
mod rest;
mod row_setup;
mod rows;
pub(crate) mod sensors;
mod speed;
mod stance;
pub(crate) mod structure;
mod unseen;
pub(crate) mod walk;
mod walks;
mod windows;

pub use error::FreeBaseError;
pub use imu::has_imu;
pub use stance::{FootEpisode, Reason, StanceShares};
pub use unseen::UnseenFoot;
pub(crate) use walks::Walks;
pub use windows::Windows;

#[cfg(test)]
mod tests;
