//! Trunk and legs of a robot that walks, from encoders, motor torques, gyro and accelerometer alone: what `identify --free-base`,
//! `diagnose --free-base` and `compare --free-base` share.
//!
//! A file uses only files above it in this list, and none uses this one.
//!
//! 1. `channels`: numbers of each joint, sample by sample. `windows`: what became of a
//!    log's windows, and their samples. `error`: why no parameters come out. `legged`: the robot, as its model has it: tree, feet, IMU, and all thresholds
//!    in units of its own size and weight. `projector`: takes forces at feet out of the equations.
//! 2. `stiction`: joints that friction may hold. `walk`: the log, what gravity's length tells of the accelerometer. `speed`: joint velocities from the
//!    quieter of two channels, a quieter gyro. `imu`: whether gyro and accelerometer read what such sensors read. `supported`: whether something beyond the feet carries the robot. `transmitted`: the torques that gears transmit, by the motion. `stance`: which feet may carry a force;
//!    those are projected out.
//! 3. `columns`: which column is what. `sensors`: what the sensors get wrong. `gravity`: its direction, and its length as rows.
//!    `walks`: all logs, with velocities, gravity and stance.
//! 4. `row_setup`: the parameters that rows are made at. `projection`: columns of any effect's torque. `residual`: what windows leave at known
//!    parameters. `moved_readings`: columns of what sensors get wrong, differences of these. `window`: the equations of
//!    one window, as [`proprio_core::window::FreeBaseWindow`] has them. `rows`: of all, row by row.
//! 5. `structure`: which effects a model has, and how well its bodies are known. `outside`: windows that no model of the catalogue explains.
//!    `unseen`: those of a foot that is taken to be in the air and is not. `data`: the rows as one factor per block of time.
//! 6. `fit`: a model's bodies, their joints' effects and what sensors get wrong. `shapes`: nonlinear parameters. `doubtful`: sensors that are found farther
//!    off than is believed of them. `refinement`: rows made near the fit, without the windows that
//!    are outside, and without priors that they refute. `rungs`: what every result is held against. `expected`: what a motion would tell before it is played.

pub(crate) mod channels;
pub(crate) mod columns;
pub(crate) mod data;
pub(crate) mod doubtful;
mod error;
pub(crate) mod expected;
pub(crate) mod fit;
mod gravity;
mod imu;
pub(crate) mod legged;
mod moved_readings;
mod outside;
pub(crate) mod projection;
mod projector;
mod refinement;
mod residual;
mod row_setup;
mod rows;
pub(crate) mod rungs;
pub(crate) mod sensors;
pub(crate) mod shapes;
mod speed;
mod stance;
mod stiction;
pub(crate) mod structure;
mod supported;
mod transmitted;
mod unseen;
pub(crate) mod walk;
mod walks;
mod window;
mod windows;

pub use error::FreeBaseError;
pub use stance::{FootEpisode, Reason, StanceShares};
pub use unseen::UnseenFoot;
pub(crate) use walks::Walks;

use crate::log::{LogReader, Selection};
pub use windows::Windows;

/// Whether a Go2's log has `gyro/` and `acc/` columns, which a moving base needs; no of one that cannot be read.
pub fn has_imu(log: &std::path::Path) -> bool {
    let log = LogReader::open(log, Selection::Everything);
    log.is_ok_and(|log| log.columns().has_gyro() && log.columns().has_acc())
}

#[cfg(test)]
mod tests;
