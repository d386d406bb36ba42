//! The IMU of a Go2: where it is, and whether a log has it.

use std::path::Path;

use nalgebra::Vector3;
use proprio_core::go2;
use proprio_core::spatial::Transform;

use crate::log::Log;

/// Whether a Go2's log has `gyro/` and `acc/` columns, which a moving base needs; no of one that cannot be read.
pub fn has_imu(log: &Path) -> bool {
    Log::read(log).is_ok_and(|log| log.imu.gyro.is_some() && log.imu.acc.is_some())
}

/// The IMU in the base.
pub(super) fn imu() -> Transform<f64> {
    Transform::from_translation(Vector3::from(go2::IMU))
}
