//! What a window takes of a sample, and where the base is in the frame that falls freely from its beginning.

use crate::go2::JOINTS;
use crate::spatial::Transform;
use crate::{Real, scalar::real};
use nalgebra::{Matrix3, Vector3};

/// One measurement of the whole robot, made ready: velocities smoothed, feet judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ready<T: Real> {
    pub(super) time_us: u64,
    pub(super) q: [T; JOINTS],
    pub(super) dq: [T; JOINTS],
    pub(super) tau: [T; JOINTS],
    /// Angular velocity (rad/s), specific force (m/s²) and the unit vector along gravity, in the IMU's axes.
    pub(super) gyro: Vector3<T>,
    pub(super) acc: Vector3<T>,
    pub(super) down: Vector3<T>,
}

/// Where the base is in the window's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose<T: Real> {
    pub(super) rotation: Matrix3<T>,
    /// The IMU's velocity (m/s) and displacement (m).
    pub(super) velocity: Vector3<T>,
    pub(super) moved: Vector3<T>,
}

impl<T: Real> Pose<T> {
    pub(super) fn start() -> Self {
        Self {
            rotation: Matrix3::identity(),
            velocity: Vector3::zeros(),
            moved: Vector3::zeros(),
        }
    }

    /// The base's origin, m.
    pub(super) fn place(&self, imu: &Transform<T>) -> Vector3<T> {
        self.moved + imu.translation - self.rotation * imu.translation
    }

    /// From one sample to the next, twice `half` (s) later.
    pub(super) fn advance(&mut self, imu: &Transform<T>, last: &Ready<T>, now: &Ready<T>, half: T) {
        let axes = &imu.rotation;
        let before = self.rotation * (axes * last.acc);
        self.rotation *= turned(&(axes * ((last.gyro + now.gyro) * half)));
        let after = self.rotation * (axes * now.acc);
        let gained = (before + after) * half;
        self.moved += (self.velocity * real::<T>(2.0) + gained) * half;
        self.velocity += gained;
    }
}

/// The rotation by a vector of up to 0.2 rad, to 1e-10.
pub(super) fn turned<T: Real>(angle: &Vector3<T>) -> Matrix3<T> {
    let square = angle.dot(angle);
    let a = T::one() - square * (real::<T>(1.0 / 6.0) - square * real(1.0 / 120.0));
    let b = real::<T>(0.5) - square * (real::<T>(1.0 / 24.0) - square * real(1.0 / 720.0));
    let cross = angle.cross_matrix();
    Matrix3::identity() + cross * a + cross * cross * b
}
