//! What the sensors of a walk get wrong: the accelerometer's bias, how the IMU is mounted, when encoders and IMU were read, and where feet touch
//! the ground.
//!
//! None of it is the robot's, so it is fitted always, whatever the model. The bias has columns of its own
//! ([`proprio_core::window::FreeBaseWindow`]). All else moves the readings (`moved_readings`).
//!
//! Delays are against the torques. A quarter of a millisecond at a swinging calf is a tenth of its viscous friction: a position that leads
//! its torque by half a step, as a simulation's may, or lags behind it by what the bus takes, shows in nothing else.
//!
//! A gyro and an accelerometer on one chip have filters of their own, and so lags of their own. Windows begin where a touch-down has just
//! passed, when the specific force still falls: there a quarter of a millisecond between the two is 0.1 to 0.2 % of the mass.
//!
//! A force is projected out at a point: the lowest of the foot's sphere. Rubber gives way, the ground does, and the force acts somewhat
//! higher. A millimetre is 0.25 % of the mass of a robot that sways and 0.08 % of one that trots.

use nalgebra::{DVector, Rotation3, Vector3};
use proprio_core::contact::Foot;
use proprio_core::go2::{self, JOINTS, LEGS};

use super::columns::{ACC, SENSORS, WalkColumns};
use super::walk::Walk;
use crate::equation::column::Column;

/// The first of the sensors' columns that are of moved readings.
pub(super) const MOVED: usize = 3;
/// Where each of [`NAMES`] begins.
const MOUNTING: usize = MOVED;
const DELAYS: usize = 6;
const RADIUS: usize = 9;
const GYRO_BIAS: usize = 10;
const GYRO_SCALE: usize = 13;
pub(super) const ACC_SCALE: usize = 14;

/// Names and units.
pub(crate) const NAMES: [(&str, &str); SENSORS] = [
    ("acc_bias.x:imu", "m/s^2"),
    ("acc_bias.y:imu", "m/s^2"),
    ("acc_bias.z:imu", "m/s^2"),
    ("mounting.x:imu", "rad"),
    ("mounting.y:imu", "rad"),
    ("mounting.z:imu", "rad"),
    ("delay:encoders", "s"),
    ("delay:imu", "s"),
    ("delay:acc", "s"),
    ("radius:feet", "m"),
    ("gyro_bias.x:imu", "rad/s"),
    ("gyro_bias.y:imu", "rad/s"),
    ("gyro_bias.z:imu", "rad/s"),
    ("gyro_scale:imu", ""),
    ("acc_scale:imu", ""),
];

/// Standard deviations before any data. An accelerometer's bias is tenths of m/s² (data sheets of the LSM6DSO and BMI088); a board is mounted by
/// hand within three degrees; readings that a host polls fifty times a second are half of that time apart; the filters of one chip, of 50 to 500 Hz, lag by
/// 0.3 to 3 ms; rubber and ground give way by a millimetre or two, and the force acts in between. A gyro reads up to a degree per second where nothing turns, and
/// the scales of both are right within 1 % (the same data sheets, where that is the tolerance: two deviations).
pub(crate) const STD: [f64; SENSORS] = [
    0.2, 0.2, 0.2, 0.05, 0.05, 0.05, 0.01, 0.01, 0.002, 0.001, 0.01, 0.01, 0.01, 0.005, 0.005,
];

/// What the sensors get wrong.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Sensors {
    /// In the order of [`NAMES`].
    pub(super) values: [f64; SENSORS],
    /// What each joint's encoder reads too much, rad, of a model that has such an effect.
    pub(super) offsets: [f64; JOINTS],
}

impl Sensors {
    /// Of all parameters of a walk.
    pub(super) fn of(theta: &DVector<f64>, columns: &WalkColumns) -> Self {
        let mut sensors = Self {
            values: std::array::from_fn(|k| theta[ACC + k]),
            ..Self::default()
        };
        for (k, joint) in offsets(columns) {
            sensors.offsets[joint] = theta[k];
        }
        sensors
    }

    /// All of it that is taken off the readings, each with its column.
    pub(super) fn taken(&self, columns: &WalkColumns) -> impl Iterator<Item = (usize, f64)> {
        let values = self.values.into_iter().enumerate();
        let offsets = offsets(columns).map(|(k, joint)| (k, self.offsets[joint]));
        values.map(|(n, value)| (ACC + n, value)).chain(offsets)
    }

    /// The accelerometer's bias, m/s².
    pub(super) fn acc_bias(&self) -> Vector3<f64> {
        self.vector(0)
    }

    /// Three that belong together.
    fn vector(&self, first: usize) -> Vector3<f64> {
        Vector3::from_fn(|n, _| self.values[first + n])
    }

    /// The feet, as they touch the ground.
    pub(super) fn feet(&self) -> [Foot<f64>; LEGS] {
        go2::feet().map(|foot: Foot<f64>| Foot {
            radius: foot.radius + self.values[RADIUS],
            ..foot
        })
    }

    /// The walk as better sensors would have read it, but for the accelerometer's bias.
    pub(super) fn corrected(&self, walk: &Walk) -> Walk {
        let mounting = Rotation3::from_scaled_axis(self.vector(MOUNTING));
        let [encoders, imu, acc] = [0, 1, 2].map(|n| self.values[DELAYS + n]);
        let [gyro_scale, acc_scale] = [GYRO_SCALE, ACC_SCALE].map(|n| 1.0 + self.values[n]);
        let gyro_bias = mounting * self.vector(GYRO_BIAS);
        let all = 0..walk.len();
        let position =
            |n: usize, j: usize| walk.q[n][j] + encoders * walk.dq[n][j] - self.offsets[j];
        let joint = |n: usize, j: usize| walk.dq[n][j] + encoders * walk.rate(n, |m| walk.dq[m][j]);
        let turned = |n: usize, of: &[Vector3<f64>], late: f64| {
            mounting * (of[n] + Vector3::from_fn(|k, _| late * walk.rate(n, |m| of[m][k])))
        };
        Walk {
            q: all
                .clone()
                .map(|n| std::array::from_fn(|j| position(n, j)))
                .collect(),
            dq: all
                .clone()
                .map(|n| std::array::from_fn::<f64, JOINTS, _>(|j| joint(n, j)))
                .collect(),
            gyro: all
                .clone()
                .map(|n| (turned(n, &walk.gyro, imu) - gyro_bias) / gyro_scale)
                .collect(),
            acc: all
                .clone()
                .map(|n| turned(n, &walk.acc, imu + acc) / acc_scale)
                .collect(),
            down: all
                .map(|n| turned(n, &walk.down, imu).normalize())
                .collect(),
            ..walk.clone()
        }
    }
}

/// The columns of encoders that are off, and whose.
pub(super) fn offsets(columns: &WalkColumns) -> impl Iterator<Item = (usize, usize)> {
    columns
        .effects()
        .filter_map(|(k, _, linear)| match linear.column {
            Column::Motion { joint, .. } => Some((k, joint)),
            _ => None,
        })
}
