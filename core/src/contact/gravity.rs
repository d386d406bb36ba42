//! Gravity's direction in the IMU's axes, from gyro and accelerometer.

use crate::{Real, scalar::real};
use nalgebra::Vector3;

/// A complementary filter (Mahony, Hamel & Pflimlin 2008, without its integral): the gyro turns the direction from sample to
/// sample, the accelerometer pulls it to the mean of the specific force.
///
/// Only the direction to a foot's lowest point depends on it: 0.1 rad move the contact point by a tenth of the foot's radius.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GravityDirection<T: Real> {
    /// Minus the mean specific force, m/s².
    gravity: Vector3<T>,
}

impl<T: Real> GravityDirection<T> {
    /// From a first specific force (m/s²), which a body at rest shows against gravity.
    pub fn new(specific_force: &Vector3<T>) -> Self {
        Self {
            gravity: -specific_force,
        }
    }

    /// After `dt` (s) with angular velocity `gyro` (rad/s) and the specific force now; the mean forgets over `time_constant`
    /// (s): some steps of a gait, so that their accelerations average out.
    pub fn update(
        &mut self,
        gyro: &Vector3<T>,
        specific_force: &Vector3<T>,
        dt: T,
        time_constant: T,
    ) {
        // A direction that is fixed in the world turns against the body: over half a step twice, for second order.
        let rate = |g: &Vector3<T>| -gyro.cross(g) - (specific_force + g) / time_constant;
        let middle = self.gravity + rate(&self.gravity) * (dt * real(0.5));
        self.gravity += rate(&middle) * dt;
    }

    /// Unit vector along gravity; zero if nothing is known of it.
    pub fn down(&self) -> Vector3<T> {
        self.gravity
            .try_normalize(T::default_epsilon())
            .unwrap_or_else(Vector3::zeros)
    }

    /// The mean of gravity as the accelerometer shows it, m/s².
    pub fn mean(&self) -> Vector3<T> {
        self.gravity
    }
}
