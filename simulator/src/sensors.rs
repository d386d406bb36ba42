//! What lies between a robot's motion and its log.

use proprio_core::go2::{self, JOINTS_PER_LEG};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use super::SimulatedSample;

/// Standard deviation of the reported torque, in steps of the bus: its current sensor's noise is of the order of a step.
const TORQUE_NOISE: f64 = 0.5;

/// What a joint's own sensors are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct JointSensors {
    /// Standard deviation of the velocity at standstill, rad/s.
    pub(crate) velocity_noise: f64,
    /// Steps of position (rad), velocity (rad/s) and torque (N m).
    pub(crate) quanta: [f64; 3],
}

impl JointSensors {
    /// Those of a Go2's joint, by its number or its place in the leg.
    pub(crate) fn go2(joint: usize) -> Self {
        Self {
            velocity_noise: go2::VELOCITY_NOISE[joint % JOINTS_PER_LEG],
            quanta: go2::quanta(joint),
        }
    }
}

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
    /// Further noise of the torque: its standard deviation, N m.
    pub torque_noise: f64,
    /// For how long that noise remembers itself, s: a first-order autoregression; zero is white.
    pub torque_memory: f64,
    /// Further white noise of the velocity: its standard deviation, rad/s.
    pub velocity_noise: f64,
}

impl Default for Sensors {
    /// A Go2's noise and quanta, an even clock.
    fn default() -> Self {
        Self {
            noise: 1.0,
            quantised: true,
            jitter: 0.0,
            repeats: 0.0,
            torque_noise: 0.0,
            torque_memory: 0.0,
            velocity_noise: 0.0,
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
            torque_noise: 0.0,
            torque_memory: 0.0,
            velocity_noise: 0.0,
        }
    }

    /// When sample `k` is taken, s.
    pub(super) fn sampling_time(&self, k: u64, rate: f64, rng: &mut ChaCha8Rng) -> f64 {
        if k == 0 || self.jitter == 0.0 {
            return k as f64 / rate;
        }
        (k as f64 + rng.random_range(-self.jitter..=self.jitter)) / rate
    }

    /// The further noise of the torque of `joints` joints at the next of `rate` samples a second, after `last`: nothing at first.
    pub(super) fn torque_noise_after(
        &self,
        last: &[f64],
        joints: usize,
        rate: f64,
        rng: &mut ChaCha8Rng,
    ) -> Vec<f64> {
        if self.torque_noise == 0.0 {
            return vec![0.0; joints];
        }
        let keep = if self.torque_memory > 0.0 && !last.is_empty() {
            (-1.0 / (rate * self.torque_memory)).exp()
        } else {
            0.0
        };
        // The standard deviation stays what it is.
        let new = self.torque_noise * (1.0 - keep * keep).sqrt();
        (0..joints)
            .map(|joint| {
                let white: f64 = rng.sample(StandardNormal);
                keep * last.get(joint).copied().unwrap_or(0.0) + new * white
            })
            .collect()
    }

    /// What is recorded of `truth` after `previous` was, with the further noise `torque` of the torques.
    pub(super) fn measure(
        &self,
        truth: SimulatedSample,
        torque: &[f64],
        previous: Option<&SimulatedSample>,
        rng: &mut ChaCha8Rng,
    ) -> SimulatedSample {
        match previous.filter(|_| self.repeated(rng)) {
            Some(previous) => SimulatedSample {
                t: truth.t,
                ..previous.clone()
            },
            None => self.measure_anew(truth, torque, JointSensors::go2, rng),
        }
    }

    /// Whether a sample is the one before once more.
    pub(super) fn repeated(&self, rng: &mut ChaCha8Rng) -> bool {
        self.repeats > 0.0 && rng.random_bool(self.repeats)
    }

    /// What joints with these `sensors` record of `truth`, with the further noise `torque` of the torques.
    pub(super) fn measure_anew(
        &self,
        truth: SimulatedSample,
        torque: &[f64],
        sensors: impl Fn(usize) -> JointSensors,
        rng: &mut ChaCha8Rng,
    ) -> SimulatedSample {
        let mut measured = truth;
        for joint in 0..measured.q.len() {
            let own = sensors(joint);
            if self.noise > 0.0 {
                let sigma = self.noise * own.velocity_noise;
                measured.dq[joint] += sigma * rng.sample::<f64, _>(StandardNormal);
                let sigma = self.noise * TORQUE_NOISE * own.quanta[2];
                measured.tau[joint] += sigma * rng.sample::<f64, _>(StandardNormal);
            }
            measured.tau[joint] += torque[joint];
            if self.velocity_noise > 0.0 {
                measured.dq[joint] += self.velocity_noise * rng.sample::<f64, _>(StandardNormal);
            }
            if self.quantised {
                let [q, dq, tau] = own.quanta;
                round_to(q, &mut measured.q[joint]);
                round_to(dq, &mut measured.dq[joint]);
                round_to(tau, &mut measured.tau[joint]);
                if let Some(q_link) = &mut measured.q_link {
                    round_to(q, &mut q_link[joint]);
                }
            }
        }
        if let (true, Some(temperatures)) = (self.quantised, &mut measured.temp) {
            temperatures.iter_mut().for_each(|t| round_to(1.0, t));
        }
        measured
    }
}

pub(super) fn round_to(step: f64, value: &mut f64) {
    *value = (*value / step).round() * step;
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// The standard deviation asked for, and exp(−1/(rate × memory)) from one sample to the next.
    #[test]
    fn coloured_noise_has_its_size_and_its_memory() {
        for (memory, correlation) in [(0.0, 0.0), (0.01, (-0.2f64).exp())] {
            let sensors = Sensors {
                torque_noise: 0.4,
                torque_memory: memory,
                ..Sensors::ideal()
            };
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let (mut last, mut square, mut product) = (Vec::new(), 0.0, 0.0);
            const COUNT: usize = 200_000;
            for _ in 0..COUNT {
                let new = sensors.torque_noise_after(&last, 1, 500.0, &mut rng);
                square += new[0] * new[0] / COUNT as f64;
                product += new[0] * last.first().copied().unwrap_or(0.0) / COUNT as f64;
                last = new;
            }
            assert!((square.sqrt() / 0.4 - 1.0).abs() < 0.01, "{square}");
            assert!((product / square - correlation).abs() < 0.01, "{product}");
        }
    }
}
