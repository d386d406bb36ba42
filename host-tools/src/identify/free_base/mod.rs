//! What `proprio identify --free-base` does: trunk and legs of a robot that walks, from encoders, motor torques, gyro and
//! accelerometer alone.
//!
//! 1. `walk`: the log, gravity's direction, what its length tells of the accelerometer.
//! 2. `speed`: joint velocities from the quieter of two channels.
//! 3. `stance`: which feet may carry a force; those are projected out.
//! 4. `rows`: the core's windows ([`proprio_core::window::FreeBaseWindow`]) into one factor per block of time.
//! 5. `fit`: one problem of 13 bodies, 48 effects and the accelerometer's bias on the CAD's prior.
//! 6. `result`: in words and numbers.

mod fit;
mod result;
mod rows;
mod speed;
mod stance;
mod walk;

use std::path::PathBuf;

use nalgebra::Vector3;
use proprio_core::go2;
use proprio_core::spatial::Transform;

use crate::estimate::Constraint;
use crate::log::LogError;
pub use result::{FreeBaseIdentification, Quantity};
pub use rows::Windows;
use stance::Stance;
pub use stance::StanceShares;
use walk::Walk;

/// Why no parameters come out of a walk.
#[derive(Debug, thiserror::Error)]
pub enum FreeBaseError {
    /// A log is bad.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A log lacks what a moving base needs.
    #[error("{}: a free base needs {what}, and the log does not have it", .path.display())]
    Missing {
        /// The log.
        path: PathBuf,
        /// What it lacks.
        what: &'static str,
    },
    /// Nothing is left between gaps, touch-downs and faults.
    #[error(
        "no window is left: {} were cut by touch-downs and lift-offs, {} lost to impacts, {} to gaps; {} samples cannot be true",
        .0.cut, .0.impact, .0.gap, .0.rejected
    )]
    NoWindows(Windows),
    /// The linear algebra refused; the data passed every check before it.
    #[error("the parameters cannot be solved for: the logs' numbers overflow")]
    Unsolvable,
}

/// Identifies a Go2 from logs of it walking, taken together. `progress` hears of logs read, and of how many in all.
///
/// # Errors
/// [`FreeBaseError`]; the first bad log stops the work.
pub fn identify_free_base(
    logs: &[PathBuf],
    constraint: Constraint,
    mut progress: impl FnMut(u64, u64),
) -> Result<FreeBaseIdentification, FreeBaseError> {
    let imu = Transform::from_translation(Vector3::from(go2::IMU));
    let (mut walks, mut warnings) = (Vec::new(), Vec::new());
    for (n, path) in logs.iter().enumerate() {
        let (walk, told) = Walk::read(path)?;
        warnings.extend(told);
        let stance = Stance::of(&walk, &imu);
        walks.push((walk, stance));
        progress(n as u64 + 1, logs.len() as u64);
    }
    let fit = fit::fit(&walks, constraint)?;
    Ok(FreeBaseIdentification::new(logs, &walks, &fit, warnings))
}

#[cfg(test)]
mod tests;
