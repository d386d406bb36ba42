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
//! Where the IMU is, a drawing says to a centimetre. The velocity of the base's origin is the IMU's and that of turning about it: 10 cm elsewhere
//! made the mass of a trot 2.3 % too low and moved the trunk's centre of mass by 50 mm.
//!
//! A force is projected out at a point: the lowest of the foot's sphere. Rubber gives way, the ground does, and the force acts somewhat
//! higher. A millimetre is 0.25 % of the mass of a robot that sways and 0.08 % of one that trots.

use nalgebra::{DVector, Rotation3, Vector3};
use proprio_core::spatial::Transform;

use super::channels::Channels;
use super::columns::{SENSORS, WalkColumns};
use super::legged::{Legged, Point};
use super::walk::Walk;
use crate::equation::column::Column;

/// The first of the sensors' columns that are of moved readings.
pub(super) const MOVED: usize = 3;
/// Where each of [`NAMES`] begins.
pub(super) const MOUNTING: usize = MOVED;
const DELAYS: usize = 6;
pub(super) const RADIUS: usize = 9;
pub(super) const GYRO_BIAS: usize = 10;
pub(super) const GYRO_SCALE: usize = 13;
pub(super) const ACC_SCALE: usize = 14;
pub(super) const PLACE: usize = 15;

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
    ("place.x:imu", "m"),
    ("place.y:imu", "m"),
    ("place.z:imu", "m"),
];

/// Standard deviations before any data. An accelerometer's bias is tenths of m/s² (data sheets of the LSM6DSO and BMI088); a board is mounted by
/// hand within three degrees; readings that a host polls fifty times a second are half of that time apart; the filters of one chip, of 50 to 500 Hz, lag by
/// 0.3 to 3 ms; rubber and ground give way by a millimetre or two, and the force acts in between. A gyro reads up to a degree per second where nothing turns, and
/// the scales of both are right within 1 % (the same data sheets, where that is the tolerance: two deviations).
pub(crate) const STD: [f64; SENSORS] = [
    0.2, 0.2, 0.2, 0.05, 0.05, 0.05, 0.01, 0.01, 0.002, 0.001, 0.01, 0.01, 0.01, 0.005, 0.005,
    0.01, 0.01, 0.01,
];

/// What the sensors get wrong.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Sensors {
    /// In the order of [`NAMES`].
    pub(super) values: [f64; SENSORS],
    /// What each joint's encoder reads too much, rad, of a model that has such an effect.
    pub(super) offsets: Vec<f64>,
}

impl Sensors {
    /// Of all parameters of a walk.
    pub(super) fn of(theta: &DVector<f64>, columns: &WalkColumns) -> Self {
        let mut sensors = Self {
            values: std::array::from_fn(|k| theta[columns.acc() + k]),
            offsets: vec![0.0; columns.robot.joints()],
        };
        for (k, joint) in offsets(columns) {
            sensors.offsets[joint] = theta[k];
        }
        sensors
    }

    /// All of it that is taken off the readings, each with its column.
    pub(super) fn taken<'a>(
        &'a self,
        columns: &'a WalkColumns,
    ) -> impl Iterator<Item = (usize, f64)> + 'a {
        let values = self.values.into_iter().enumerate();
        let offsets = offsets(columns).map(|(k, joint)| (k, self.offsets[joint]));
        values
            .map(|(n, value)| (columns.acc() + n, value))
            .chain(offsets)
    }

    /// The accelerometer's bias, m/s².
    pub(super) fn acc_bias(&self) -> Vector3<f64> {
        self.vector(0)
    }

    /// Three that belong together.
    fn vector(&self, first: usize) -> Vector3<f64> {
        Vector3::from_fn(|n, _| self.values[first + n])
    }

    /// What touches the ground of the feet that may carry a force.
    pub(super) fn points(&self, robot: &Legged, loaded: &[bool]) -> Vec<Point> {
        robot.points(loaded, self.values[RADIUS])
    }

    /// Whether joints are where others do not have them.
    pub(super) fn moves_joints(&self, others: &Self) -> bool {
        self.values[DELAYS] != others.values[DELAYS] || self.offsets != others.offsets
    }

    /// The IMU in the base, in the axes that its readings are turned to.
    pub(super) fn imu(&self, robot: &Legged) -> Transform<f64> {
        Transform {
            translation: robot.imu.translation + self.vector(PLACE),
            ..robot.imu
        }
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
            q: Channels::from_fn(walk.len(), walk.q.width(), position),
            dq: Channels::from_fn(walk.len(), walk.q.width(), joint),
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
            path: walk.path.clone(),
            imu: walk.imu,
            time_us: walk.time_us.clone(),
            tau: walk.tau.clone(),
            gyro_read: Vec::new(),
            count: None,
            samples: walk.samples,
            period: walk.period,
            rest: walk.rest.clone(),
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
