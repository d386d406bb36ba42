//! What lies between a robot's motion and its log.

use proprio_core::go2::{self, JOINTS_PER_LEG};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::SimulatedSample;

/// Standard deviation of the reported torque, in steps of the bus: its current sensor's noise is of the order of a step.
const TORQUE_NOISE: f64 = 0.5;

/// The sensors' and the recorder's faults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors {
    /// Noise of the velocity and of the torque, as a multiple of a standing Go2's.
    pub noise: f64,
    /// Whether values come in the steps of the motor bus.
    pub quantised: bool,
    /// Greatest departure of a sampling instant from its due time, as a share of the period; below one half. The stamp
    /// tells the true instant.
    pub jitter: f64,
    /// Share of samples that repeat the one before under a new stamp, as when a host reads the latest message.
    pub repeats: f64,
}

impl Default for Sensors {
    /// A Go2's noise and quanta, an even clock.
    fn default() -> Self {
        Self {
            noise: 1.0,
            quantised: true,
            jitter: 0.0,
            repeats: 0.0,
        }
    }
}

impl Sensors {
    /// The truth itself.
    pub fn ideal() -> Self {
        Self {
            noise: 0.0,
            quantised: false,
            jitter: 0.0,
            repeats: 0.0,
        }
    }

    /// When sample `k` is taken, s.
    pub(super) fn sampling_time(&self, k: u64, rate: f64, rng: &mut ChaCha8Rng) -> f64 {
        if k == 0 || self.jitter == 0.0 {
            return k as f64 / rate;
        }
        (k as f64 + rng.random_range(-self.jitter..=self.jitter)) / rate
    }

    /// What is recorded of `truth` after `previous` was.
    pub(super) fn measure(
        &self,
        truth: SimulatedSample,
        previous: Option<&SimulatedSample>,
        rng: &mut ChaCha8Rng,
    ) -> SimulatedSample {
        if let Some(previous) = previous
            && self.repeats > 0.0
            && rng.random_bool(self.repeats)
        {
            return SimulatedSample {
                t: truth.t,
                ..previous.clone()
            };
        }
        let mut measured = truth;
        for joint in 0..measured.q.len() {
            if self.noise > 0.0 {
                let sigma = self.noise * go2::VELOCITY_NOISE[joint % JOINTS_PER_LEG];
                measured.dq[joint] += sigma * rng.sample::<f64, _>(StandardNormal);
                let sigma = self.noise * TORQUE_NOISE * go2::quanta(joint)[2];
                measured.tau[joint] += sigma * rng.sample::<f64, _>(StandardNormal);
            }
            if self.quantised {
                let [q, dq, tau] = go2::quanta(joint);
                round_to(q, &mut measured.q[joint]);
                round_to(dq, &mut measured.dq[joint]);
                round_to(tau, &mut measured.tau[joint]);
            }
        }
        if let (true, Some(temperatures)) = (self.quantised, &mut measured.temp) {
            temperatures.iter_mut().for_each(|t| round_to(1.0, t));
        }
        measured
    }
}

fn round_to(step: f64, value: &mut f64) {
    *value = (*value / step).round() * step;
}
