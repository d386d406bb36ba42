//! How the NUCLEO's IMU is mounted on the robot: to be measured and written here before the image is built.

use crate::Scalar;
use nalgebra::{Rotation3, Vector3};
use proprio_core::spatial::Transform;

/// Where the LSM6DSO's package is in the trunk's frame, m: from the middle between the hips, x forward, y left, z up. The middle of the back
/// until it is measured.
pub const POSITION: [f64; 3] = [0.0, 0.0, 0.07];

/// How its axes (the arrows on the breakout board; DS12140, figure 2) are turned against the trunk's: roll about x, then pitch about y, then yaw
/// about z, each about the trunk's axis, rad. Zeros: its x points forward, its z up. Chip face down, x forward: `[PI, 0.0, 0.0]`.
pub const ROLL_PITCH_YAW: [f64; 3] = [0.0, 0.0, 0.0];

/// From the IMU's axes to the trunk's.
pub fn mounting() -> Transform<Scalar> {
    let [roll, pitch, yaw] = ROLL_PITCH_YAW.map(|angle| angle as Scalar);
    Transform {
        rotation: Rotation3::from_euler_angles(roll, pitch, yaw).into_inner(),
        translation: Vector3::from(POSITION.map(|x| x as Scalar)),
    }
}
