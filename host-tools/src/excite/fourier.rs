//! Motions as finite Fourier series of the acceleration (Swevers et al. 1997), integrated exactly.
//!
//! With ω = 2π / period, for one joint
//!
//! ```text
//! q̈(t) = Σ a_j cos jωt + b_j sin jωt
//! q̇(t) = Σ (a_j sin jωt + b_j (1 − cos jωt)) / jω        with Σ b_j / j = 0
//! q(t) = q₀ + Σ (a_j (1 − cos jωt) − b_j sin jωt) / (jω)²
//! ```
//!
//! A constant term a₀ in q̈ would leave the joint in motion after a period, and Σ b_j / j one in q̇ would carry it away: both
//! are zero for a motion that begins and ends at rest in the same pose. Σ a_j = 0 besides, so that the acceleration, and with
//! it the torque, does not jump where the motion begins. A motion is a point x in the space that is left: the unknowns of a
//! design are these numbers, and no constraint has to say so.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};

/// One joint's series.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// Position at the start, rad.
    pub start: f64,
    /// Velocity at the start beyond what the sines ask for, rad/s; zero for a motion at rest there.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drift: f64,
    /// The constant part of the acceleration, rad/s²; zero for a periodic motion.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub constant: f64,
    /// a_j of the cosines of the acceleration, rad/s², j from 1.
    pub cosines: Vec<f64>,
    /// b_j of the sines, rad/s².
    pub sines: Vec<f64>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_zero(x: &f64) -> bool {
    *x == 0.0
}

impl Series {
    /// A joint that rests at `start`.
    fn rest(start: f64, harmonics: usize) -> Self {
        Self {
            start,
            drift: 0.0,
            constant: 0.0,
            cosines: vec![0.0; harmonics],
            sines: vec![0.0; harmonics],
        }
    }

    /// Position (rad), velocity (rad/s), acceleration (rad/s²) and its rate (rad/s³) at `t` seconds.
    pub fn at(&self, period: f64, t: f64) -> [f64; 4] {
        let mut q = [
            self.start + t * (self.drift + 0.5 * t * self.constant),
            self.drift + t * self.constant,
            self.constant,
            0.0,
        ];
        for (n, (a, b)) in self.cosines.iter().zip(&self.sines).enumerate() {
            let w = TAU * (n + 1) as f64 / period;
            let (sin, cos) = (w * t).sin_cos();
            q[0] += (a * (1.0 - cos) - b * sin) / (w * w);
            q[1] += (a * sin + b * (1.0 - cos)) / w;
            q[2] += a * cos + b * sin;
            q[3] += w * (b * cos - a * sin);
        }
        // b (1 − cos) / w integrates to b t / w − …, whose sum over j is zero for a periodic motion.
        let carried: f64 = self
            .sines
            .iter()
            .enumerate()
            .map(|(n, b)| b / (n + 1) as f64)
            .sum();
        q[0] += t * carried * period / TAU;
        q
    }

    /// Bounds that hold at all times on the size of the d-th derivative of the position, d ≥ 1: the sum of the amplitudes.
    pub(super) fn derivative_bound(&self, period: f64, d: i32) -> f64 {
        let waves = self.cosines.iter().zip(&self.sines).enumerate();
        let sum: f64 = waves
            .map(|(n, (a, b))| a.hypot(*b) * (TAU * (n + 1) as f64 / period).powi(d - 2))
            .sum();
        match d {
            1 => {
                let carried = self
                    .sines
                    .iter()
                    .enumerate()
                    .map(|(n, b)| b / (n + 1) as f64);
                let carried: f64 = carried.sum::<f64>() * period / TAU;
                sum + (self.drift + carried).abs() + self.constant.abs() * period
            }
            2 => sum + self.constant.abs(),
            _ => sum,
        }
    }
}

/// The motion of a limb's joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Its period, s.
    pub period: f64,
    /// How often it is repeated.
    pub repeats: u32,
    /// Joint by joint.
    pub joints: Vec<Series>,
}

impl Motion {
    /// Length, s.
    pub fn duration(&self) -> f64 {
        self.period * f64::from(self.repeats)
    }

    /// Position (rad), velocity (rad/s), acceleration (rad/s²) and its rate (rad/s³) of a joint at `t` seconds; at rest before
    /// the start and after the end.
    pub fn at(&self, joint: usize, t: f64) -> [f64; 4] {
        let series = &self.joints[joint];
        if t < 0.0 || t > self.duration() {
            let end = if t < 0.0 { 0.0 } else { self.period };
            return [series.at(self.period, end)[0], 0.0, 0.0, 0.0];
        }
        // The end of the last period belongs to it.
        let periods = (t / self.period).floor().min(f64::from(self.repeats) - 1.0);
        series.at(self.period, t - periods * self.period)
    }
}

/// What a series may do at its ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ends {
    /// At rest in a given pose, without a jump of the acceleration.
    Rest,
    /// At rest in a given pose at the start alone, with any acceleration: for comparison with designs that leave coming to rest
    /// to the user (2 waves + 1 unknowns per joint, as RAPTOR has).
    RestAtStart,
}

/// The space of the motions: each joint's series is its pose plus the sum of x_k times mode k times the joint's scale.
#[derive(Debug, Clone)]
pub(super) struct Basis {
    pub(super) period: f64,
    harmonics: usize,
    modes: Vec<Series>,
    /// `values[k][s]`: position, velocity and acceleration of mode k at sample s.
    values: Vec<Vec<[f64; 3]>>,
}

impl Basis {
    /// The motions of `harmonics` waves, at `samples` instants evenly spread over a period.
    ///
    /// A mode moves at a speed of about 1 rad/s, whatever its frequency, so that no unknown is much stronger than another.
    pub(super) fn new(period: f64, harmonics: usize, ends: Ends, samples: usize) -> Self {
        let speed = |j: usize| TAU * (j + 1) as f64 / period;
        let mut modes = Vec::new();
        match ends {
            Ends::Rest => {
                // In units of speed: Σ jω u_j = 0 for the cosines, Σ u_j = 0 for the sines.
                let rates: Vec<f64> = (0..harmonics).map(speed).collect();
                for u in complement(&rates) {
                    let mut mode = Series::rest(0.0, harmonics);
                    mode.cosines = (0..harmonics).map(|j| u[j] * speed(j)).collect();
                    modes.push(mode);
                }
                for u in complement(&vec![1.0; harmonics]) {
                    let mut mode = Series::rest(0.0, harmonics);
                    mode.sines = (0..harmonics).map(|j| u[j] * speed(j)).collect();
                    modes.push(mode);
                }
            }
            Ends::RestAtStart => {
                let rest = Series::rest(0.0, harmonics);
                modes.push(Series {
                    constant: 0.1,
                    ..rest.clone()
                });
                for j in 0..harmonics {
                    let mut mode = rest.clone();
                    mode.cosines[j] = speed(j);
                    modes.push(mode);
                    let mut mode = rest.clone();
                    mode.sines[j] = speed(j);
                    modes.push(mode);
                }
            }
        }
        let instants = |mode: &Series| {
            let at = |s: usize| {
                let [q, dq, ddq, _] = mode.at(period, period * s as f64 / samples as f64);
                [q, dq, ddq]
            };
            (0..samples).map(at).collect()
        };
        Self {
            period,
            harmonics,
            values: modes.iter().map(instants).collect(),
            modes,
        }
    }

    /// Unknowns per joint.
    pub(super) fn modes(&self) -> usize {
        self.modes.len()
    }

    /// Waves of a series.
    pub(super) fn harmonics(&self) -> usize {
        self.harmonics
    }

    pub(super) fn samples(&self) -> usize {
        self.values.first().map_or(0, Vec::len)
    }

    /// Position, velocity and acceleration at sample s of a joint that starts from `pose`, for its own unknowns.
    pub(super) fn at(&self, x: &[f64], pose: f64, s: usize) -> [f64; 3] {
        let mut sum = [pose, 0.0, 0.0];
        for (x, values) in x.iter().zip(&self.values) {
            for (sum, value) in sum.iter_mut().zip(values[s]) {
                *sum += x * value;
            }
        }
        sum
    }

    /// Adds to the slopes by a joint's unknowns what its slopes by position, velocity and acceleration at sample s make.
    pub(super) fn pull_back(&self, s: usize, by: [f64; 3], slopes: &mut [f64]) {
        for (slope, values) in slopes.iter_mut().zip(&self.values) {
            let value = values[s];
            *slope += by[0] * value[0] + by[1] * value[1] + by[2] * value[2];
        }
    }

    /// The series of a joint's unknowns.
    pub(super) fn series(&self, x: &[f64], pose: f64) -> Series {
        let mut series = Series::rest(pose, self.harmonics);
        for (x, mode) in x.iter().zip(&self.modes) {
            series.start += x * mode.start;
            series.drift += x * mode.drift;
            series.constant += x * mode.constant;
            for j in 0..self.harmonics {
                series.cosines[j] += x * mode.cosines[j];
                series.sines[j] += x * mode.sines[j];
            }
        }
        series
    }
}

/// An orthonormal basis of what is orthogonal to `normal`: the columns but the first of the Householder reflection that
/// takes it to the first axis.
fn complement(normal: &[f64]) -> Vec<Vec<f64>> {
    let norm = normal.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut v: Vec<f64> = normal.iter().map(|x| x / norm).collect();
    v[0] += 1.0;
    let square: f64 = v.iter().map(|x| x * x).sum();
    (1..normal.len())
        .map(|c| {
            let entry = |r: usize| f64::from(u8::from(r == c)) - 2.0 * v[r] * v[c] / square;
            (0..normal.len()).map(entry).collect()
        })
        .collect()
}
