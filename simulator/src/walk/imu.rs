//! What the trunk's and the feet's sensors make of the truth.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::super::Sensors;
use super::super::sensors::round_to;

/// Step and noise of the gyro, rad/s, and of the accelerometer, m/s² (go2.md).
const GYRO: (f64, f64) = (0.001_07, 0.005);
const ACC: (f64, f64) = (0.0012, 0.05);
/// Standard deviation of their biases from robot to robot.
const BIAS: (f64, f64) = (0.003, 0.06);
/// A foot's count: its offset, counts per N at a Go2's foot, their noise, and how late the pad of rubber and air is, s.
const OFFSET: std::ops::Range<f64> = 8.0..20.0;
const GAIN: std::ops::Range<f64> = 0.3..0.6;
const COUNT_NOISE: f64 = 1.0;
const LAG: f64 = 0.01;

/// One robot's IMU: what it adds to all that it reads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Imu {
    /// rad/s.
    pub(super) gyro_bias: Vector3<f64>,
    /// m/s².
    pub(super) acc_bias: Vector3<f64>,
}

impl Imu {
    /// Draws the biases; `sensors.noise` is how large they are, too.
    pub(super) fn new(sensors: &Sensors, rng: &mut ChaCha8Rng) -> Self {
        let mut bias = |deviation: f64| normal(sensors.noise * deviation, rng);
        Self {
            gyro_bias: bias(BIAS.0),
            acc_bias: bias(BIAS.1),
        }
    }

    /// What it reads of an angular velocity (rad/s) and a specific force (m/s²).
    pub(super) fn read(
        &self,
        gyro: &Vector3<f64>,
        acc: &Vector3<f64>,
        sensors: &Sensors,
        rng: &mut ChaCha8Rng,
    ) -> ([f64; 3], [f64; 3]) {
        let mut reading = |truth: Vector3<f64>, (step, noise): (f64, f64)| {
            let mut read: [f64; 3] = (truth + normal(sensors.noise * noise, rng)).into();
            if sensors.quantised {
                read.iter_mut().for_each(|x| round_to(step, x));
            }
            read
        };
        (
            reading(gyro + self.gyro_bias, GYRO),
            reading(acc + self.acc_bias, ACC),
        )
    }
}

/// Three numbers of this standard deviation, drawn even if it is zero: what is drawn after them stays what it is.
fn normal(deviation: f64, rng: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| deviation * rng.sample::<f64, _>(StandardNormal))
}

/// The pads at the feet's ends: uncalibrated counts that follow the force.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pads {
    offset: Vec<f64>,
    gain: Vec<f64>,
    /// The force that they show, N, and when it was, s.
    shown: Option<(f64, Vec<f64>)>,
}

impl Pads {
    /// Of so many feet of a robot that is `heavier` than a Go2 by this factor: they are made for the weight that they carry.
    pub(super) fn new(feet: usize, heavier: f64, rng: &mut ChaCha8Rng) -> Self {
        let offset = (0..feet).map(|_| rng.random_range(OFFSET)).collect();
        let gain = (0..feet)
            .map(|_| rng.random_range(GAIN) / heavier)
            .collect();
        Self {
            offset,
            gain,
            shown: None,
        }
    }

    /// The counts at time `t` (s) under these forces (N).
    pub(super) fn read(
        &mut self,
        t: f64,
        normal: &[f64],
        sensors: &Sensors,
        rng: &mut ChaCha8Rng,
    ) -> Vec<f64> {
        let (before, last) = self.shown.take().unwrap_or_else(|| (t, normal.to_vec()));
        let follow = 1.0 - ((before - t) / LAG).exp();
        let towards = |(last, now): (&f64, &f64)| last + (now - last) * follow;
        let shown: Vec<f64> = last.iter().zip(normal).map(towards).collect();
        let mut count = |n: usize| {
            let noise = sensors.noise * COUNT_NOISE * rng.sample::<f64, _>(StandardNormal);
            let mut count = self.offset[n] + self.gain[n] * shown[n] + noise;
            if sensors.quantised {
                round_to(1.0, &mut count);
            }
            count
        };
        let counts = (0..shown.len()).map(&mut count).collect();
        self.shown = Some((t, shown));
        counts
    }
}
