//! Can this log be trusted? What is wrong with the samples themselves, before any model is blamed.
//!
//! [`DataGates`] takes raw samples one by one, as they were recorded, repeats included, and says in the end how they were
//! sampled ([`SamplingReport`]), what each joint's readings are worth ([`JointReport`]) and, in words, what is wrong and
//! what to do about it ([`Finding`]). Memory does not grow with the log.
//!
//! Files beside:
//!
//! - `blocks`: sums over blocks of time, in memory that does not grow with the log
//! - `quantum`: the step in which a signal is reported, found from the data
//! - `sampling`: when samples came: period, jitter, repeats, gaps
//! - `saturation`: torque at its limit: at the actuator's effort limit, or at a plateau below it
//! - `velocity`: does the reported velocity belong to the reported position?

mod blocks;
pub(super) mod quantum;
mod sampling;
mod saturation;
mod text;
pub(super) mod velocity;

use serde::Serialize;

pub use sampling::SamplingReport;
pub use saturation::{Plateau, Saturation};
pub use text::{Finding, Gate};
pub use velocity::{FALSE_ALARM, TOLERATED_GAIN, VelocityGain};

use quantum::Differences;
use sampling::{Arrival, Sampling};
use saturation::Torques;
use velocity::{Parabola, Times, VelocityCheck};

/// A joint whose readings are to be judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// What to call it.
    pub name: String,
    /// The actuator's effort limit, joint side, N m.
    pub effort: f64,
}

/// What a sample holds of a joint; SI, joint side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Position, rad.
    pub q: f64,
    /// Velocity, rad/s.
    pub dq: f64,
    /// Torque, N m.
    pub tau: f64,
    /// Motor temperature, degrees Celsius.
    pub temperature: Option<f64>,
}

/// What a joint's readings are worth.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointReport {
    /// Which joint.
    pub joint: String,
    /// Share of time in which it moves faster than 0.1 rad/s (rms over 50 ms), %.
    pub moving_percent: f64,
    /// Least and greatest position, rad.
    pub range: [f64; 2],
    /// Least and greatest motor temperature, degrees Celsius.
    pub temperature: Option<[f64; 2]>,
    /// Steps in which position (rad), velocity (rad/s) and torque (N m) are reported; none where there is no step.
    pub quantum: [Option<f64>; 3],
    /// Greatest |τ|, N m.
    pub largest_torque: f64,
    /// Torque at its limit.
    pub saturation: Saturation,
    /// The reported velocity against the reported position; none where the joint hardly moves.
    pub velocity: Option<VelocityGain>,
}

/// What is wrong with a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GateReport {
    /// How it was sampled.
    pub sampling: SamplingReport,
    /// Each joint's readings.
    pub joints: Vec<JointReport>,
    /// What is wrong, in words; empty for good data.
    pub findings: Vec<Finding>,
}

/// Judges samples as they come.
#[derive(Debug, Clone)]
pub struct DataGates {
    sampling: Sampling,
    times: Times,
    joints: Vec<JointGate>,
}

#[derive(Debug, Clone)]
struct JointGate {
    joint: Joint,
    last: Option<Reading>,
    velocity: VelocityCheck,
    differences: [Differences; 3],
    torques: Torques,
    motion: Motion,
    range: [f64; 2],
    largest_torque: f64,
    temperature: Option<[f64; 2]>,
}

/// Mean square velocity between the ends of stretches.
#[derive(Debug, Clone, Copy, Default)]
struct Motion {
    square: f64,
    samples: f64,
    moving: u64,
    all: u64,
}

/// The first length of a block of the velocity check, s: several times the correlation time of anything a leg does.
const BLOCK: f64 = 2.0;

/// A joint slower than this, rad/s, rests: three times the noise of a Go2's velocity.
pub(crate) const AT_REST: f64 = 0.1;

impl DataGates {
    /// For these joints, in the order in which samples name them.
    pub fn new(joints: impl IntoIterator<Item = Joint>) -> Self {
        Self {
            sampling: Sampling::new(),
            times: Times::default(),
            joints: joints.into_iter().map(JointGate::new).collect(),
        }
    }

    /// Takes a sample: its time, µs since any moment, and the readings of every joint.
    ///
    /// # Panics
    /// If there are not as many readings as joints.
    pub fn push(&mut self, time_us: u64, readings: &[Reading]) {
        assert_eq!(readings.len(), self.joints.len(), "one reading per joint");
        let mut pairs = self.joints.iter().zip(readings);
        // Without a joint nothing can repeat.
        let repeated = !readings.is_empty() && pairs.all(|(joint, reading)| joint.repeats(reading));
        let (since, anew) = match self.sampling.push(time_us, repeated) {
            Arrival::Skip => return,
            Arrival::Anew => (0.0, true),
            Arrival::After(since) => (since, false),
        };
        let end = self.times.push(self.sampling.now(), anew);
        for (joint, reading) in self.joints.iter_mut().zip(readings) {
            joint.push(since, reading);
            if anew {
                joint.interrupt();
            }
            if let Some(around) = &end {
                joint.end_stretch(around);
            }
        }
    }

    /// What there is to say so far.
    pub fn report(&self) -> GateReport {
        let sampling = self.sampling.report();
        let joints: Vec<_> = self.joints.iter().map(JointGate::report).collect();
        let findings = text::findings(&sampling, &joints);
        GateReport {
            sampling,
            joints,
            findings,
        }
    }
}

impl JointGate {
    fn new(joint: Joint) -> Self {
        Self {
            torques: Torques::new(joint.effort),
            joint,
            last: None,
            velocity: VelocityCheck::over_blocks_of(BLOCK),
            differences: std::array::from_fn(|_| Differences::new()),
            motion: Motion::default(),
            range: [f64::INFINITY, f64::NEG_INFINITY],
            largest_torque: 0.0,
            temperature: None,
        }
    }

    /// Whether all readings equal the last one's. The temperature changes too rarely to tell.
    fn repeats(&self, reading: &Reading) -> bool {
        self.last
            .is_some_and(|last| (last.q, last.dq, last.tau) == (reading.q, reading.dq, reading.tau))
    }

    fn push(&mut self, since: f64, reading: &Reading) {
        self.velocity.push(since, reading.q, reading.dq);
        if let Some(last) = self.last {
            self.differences[0].push(reading.q - last.q);
            self.differences[1].push(reading.dq - last.dq);
            self.differences[2].push(reading.tau - last.tau);
        }
        self.last = Some(*reading);
        self.torques.push(reading.tau, reading.dq);
        self.motion.square += reading.dq * reading.dq;
        self.motion.samples += 1.0;
        widen(&mut self.range, reading.q);
        self.largest_torque = self.largest_torque.max(reading.tau.abs());
        if let Some(temperature) = reading.temperature {
            widen(
                self.temperature.get_or_insert([temperature; 2]),
                temperature,
            );
        }
    }

    fn interrupt(&mut self) {
        self.velocity.interrupt();
        (self.motion.square, self.motion.samples) = (0.0, 0.0);
    }

    fn end_stretch(&mut self, around: &Parabola) {
        self.velocity.end_stretch(around);
        let Motion {
            square, samples, ..
        } = self.motion;
        self.motion.all += 1;
        self.motion.moving += u64::from(square > samples * AT_REST * AT_REST);
        (self.motion.square, self.motion.samples) = (0.0, 0.0);
    }

    fn report(&self) -> JointReport {
        let quantum = [0, 1, 2].map(|channel| self.differences[channel].quantum());
        JointReport {
            joint: self.joint.name.clone(),
            moving_percent: 100.0 * self.motion.moving as f64 / self.motion.all.max(1) as f64,
            range: self.range,
            temperature: self.temperature,
            quantum,
            largest_torque: self.largest_torque,
            saturation: self.torques.report(),
            velocity: self.velocity.result(quantum[0].unwrap_or(0.0)),
        }
    }
}

fn widen(range: &mut [f64; 2], value: f64) {
    *range = [range[0].min(value), range[1].max(value)];
}
