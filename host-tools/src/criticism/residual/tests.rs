//! Error rates of the whole, by seeded Monte Carlo.

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

/// Share of seeds for which something holds.
fn rate(seeds: u64, noise: Noise, holds: impl Fn(&Joint, &Runs) -> bool) -> f64 {
    let holds = |&seed: &u64| {
        let joint = Joint::new(1000, seed, noise);
        holds(&joint, &Runs::of(&joint.t))
    };
    (0..seeds).filter(holds).count() as f64 / seeds as f64
}

#[test]
fn print_rates() {
    let noises = [
        ("white", WHITE),
        ("edge", Noise { edge: 1.0, ..WHITE }),
        ("half", Noise { edge: 0.5, ..WHITE }),
        ("coloured", COLOURED),
        (
            "red",
            Noise {
                memory: 0.8,
                ..WHITE
            },
        ),
    ];
    for (name, noise) in noises {
        let seeds = 1000;
        let w = rate(seeds, noise, |j, r| {
            !correlation::whiteness(&j.series(), r).unwrap().white
        });
        let mut out = [0.0; 4];
        let mut ins = [0.0; 4];
        let mut pats = std::collections::BTreeMap::<String, f64>::new();
        let mut any = 0.0;
        for seed in 0..seeds {
            let joint = Joint::new(1000, seed, noise);
            let runs = Runs::of(&joint.t);
            for (i, ind) in correlation::independence(&joint.series(), &runs)
                .iter()
                .enumerate()
            {
                out[i] += f64::from(!ind.independent);
                ins[i] += ind
                    .correlation
                    .iter()
                    .filter(|c| c.value.abs() > c.band)
                    .count() as f64
                    / 21.0;
            }
            if seed < 300 {
                let c = joint.criticise();
                any += f64::from(c.patterns.iter().any(|p| p.significant));
                for p in &c.patterns {
                    *pats.entry(format!("{:?}", p.variable)).or_default() +=
                        f64::from(p.p < 0.05) / 300.0;
                }
            }
        }
        let n = seeds as f64;
        println!(
            "{name}: whiteness alarms {w:.4}; independence {:?} bands {:?}",
            out.map(|o| o / n),
            ins.map(|o| o / n)
        );
        println!("   any significant {:.4} p<0.05 {pats:?}", any / 300.0);
    }
    for (name, noise) in noises {
        let floors: Vec<NoiseFloor> = (0..500)
            .map(|seed| {
                let j = Joint::new(1000, seed, noise);
                noise::floor(&j.series(), &Runs::of(&j.t)).unwrap()
            })
            .collect();
        let mean = floors.iter().map(|f| f.rms).sum::<f64>() / 500.0;
        let std = (floors.iter().map(|f| (f.rms - mean).powi(2)).sum::<f64>() / 500.0).sqrt();
        let said = floors.iter().map(|f| f.rms_std).sum::<f64>() / 500.0;
        println!(
            "{name}: floor {mean:.4} ± {std:.4} said {said:.4} g1 {} {:?}",
            noise.neighbours(),
            floors[0].method
        );
    }
}
