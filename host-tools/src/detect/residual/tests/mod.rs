//! A joint's simulated windows, for tests of the whole.

mod patterns;
mod rates;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;

/// Windows of 20 ms of a chirp from 0.1 to 5 Hz, and a residual.
struct Joint {
    t: Vec<f64>,
    q: Vec<f64>,
    dq: Vec<f64>,
    tau: Vec<f64>,
    residual: Vec<f64>,
    temperature: Vec<f64>,
}

/// A residual's noise.
#[derive(Clone, Copy, Debug)]
struct Noise {
    std: f64,
    /// Share of window-edge noise: each edge's reading enters two windows with opposite signs.
    edge: f64,
    /// AR(1) coefficient of the rest.
    memory: f64,
}

const WHITE: Noise = Noise {
    std: 0.1,
    edge: 0.0,
    memory: 0.0,
};

impl Noise {
    fn series(self, n: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
        let mut normal = || -> f64 { StandardNormal.sample(random) };
        let (mut edge, mut slow) = (normal(), normal());
        (0..n)
            .map(|_| {
                let next = normal();
                let step = (next - edge) * 0.5f64.sqrt();
                edge = next;
                slow = self.memory * slow + (1.0 - self.memory * self.memory).sqrt() * normal();
                self.std * (self.edge.sqrt() * step + (1.0 - self.edge).sqrt() * slow)
            })
            .collect()
    }

    /// γ0 and γ1 over the variance.
    fn neighbours(self) -> f64 {
        -0.5 * self.edge + (1.0 - self.edge) * self.memory
    }
}

impl Joint {
    fn new(n: usize, seed: u64, noise: Noise) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let duration = 0.02 * n as f64;
        let t: Vec<f64> = (0..n).map(|k| 0.02 * (k as f64 + 0.5)).collect();
        let rate = |t: f64| 0.6 + 30.0 * t / duration;
        let phase = |t: f64| 0.6 * t + 15.0 * t * t / duration + seed as f64;
        let residual = noise.series(n, &mut random);
        let q: Vec<f64> = t.iter().map(|&t| 0.3 * phase(t).sin()).collect();
        let predicted = t
            .iter()
            .map(|&t| 2.0 * phase(t).sin() + 0.5 * phase(t).cos());
        Self {
            tau: predicted.zip(&residual).map(|(p, e)| p + e).collect(),
            dq: t.iter().map(|&t| 0.3 * rate(t) * phase(t).cos()).collect(),
            temperature: t
                .iter()
                .map(|t| 30.0 + 10.0 * (1.0 - (-t / 5.0).exp()))
                .collect(),
            q,
            t,
            residual,
        }
    }

    /// Adds to the residual and to the measured torque.
    fn with(mut self, error: impl Fn(&Self, usize) -> f64) -> Self {
        let errors: Vec<f64> = (0..self.t.len()).map(|k| error(&self, k)).collect();
        for (k, error) in errors.into_iter().enumerate() {
            self.residual[k] += error;
            self.tau[k] += error;
        }
        self
    }

    fn series(&self) -> Series<'_> {
        Series {
            joint: "FR_calf",
            t: &self.t,
            q: &self.q,
            dq: &self.dq,
            tau: &self.tau,
            residual: &self.residual,
            temperature: Some(&self.temperature),
            contact: None,
            slides: false,
            noise: None,
        }
    }

    fn criticise(&self) -> Criticism {
        criticise(&[self.series()]).remove(0)
    }
}

const COLOURED: Noise = Noise {
    std: 0.1,
    edge: 0.4,
    memory: 0.6,
};

const EDGE: Noise = Noise { edge: 1.0, ..WHITE };
const HALF: Noise = Noise { edge: 0.5, ..WHITE };
