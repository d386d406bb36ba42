//! What of a residual lasts: correlated over longer than noise remembers.
//!
//! A drive's torque is measured with noise that remembers for some milliseconds (filters, current loops), and no model is to blame for
//! that. What a model lacks follows the motion, or time, and both are slow: there the residual's autocorrelation goes on. So
//! lags from [`NOISE_MEMORY`] on tell of structure, whatever happens below. Under noise of a shorter memory the sum of products
//! e(t) e(t + τ) has the variance Σ R_e(k)² over all k (Bartlett 1946), with R_e cut off at that memory.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

use super::correlation::{LEVEL, window};
use super::series::{Runs, Series, centred, square};
use crate::select::criteria::NOISE_MEMORY;

/// Longest lag, s.
const LONGEST: f64 = 1.0;
/// Fewer windows than this cannot be judged.
const LEAST: usize = 200;

/// What of a residual is correlated over longer than noise remembers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Persistence {
    /// The lag of the largest correlation, s.
    pub lag: f64,
    /// The correlation's size there: the share of the variance that lasts.
    pub share: f64,
    /// Probability of one as large in noise of a short memory.
    pub p: f64,
}

impl Persistence {
    /// Whether it is beyond chance.
    pub fn is_real(&self) -> bool {
        self.p < LEVEL
    }
}

/// The largest correlation at lags that noise does not reach; none for fewer than 200 windows.
pub(super) fn persistence(series: &Series, runs: &Runs) -> Option<Persistence> {
    let n = series.t.len();
    let step = window(series.t, runs);
    if n < LEAST || step <= 0.0 {
        return None;
    }
    let e = centred(series.residual);
    let e2: Vec<f64> = e.iter().map(|e| e * e).collect();
    let variance = square(&e);
    // Windows side by side share a reading: two at least.
    let shortest = ((NOISE_MEMORY / step).ceil() as usize).max(2);
    let longest = ((LONGEST / step) as usize).clamp(shortest, n / 4);
    let short = (1..shortest).map(|lag| (runs.product(&e, &e, lag).0 / variance).powi(2));
    let inflation = 1.0 + 2.0 * short.sum::<f64>();
    let at = |lag: usize| {
        let (product, _) = runs.product(&e, &e, lag);
        // Joints are noisier when they move: the spread is that of the products (Lobato, Nankervis & Savin 2001).
        let (spread, _) = runs.product(&e2, &e2, lag);
        let std = (inflation * spread).sqrt();
        (std > 0.0).then(|| (lag, product.abs() / variance, product.abs() / std))
    };
    let (lag, share, z) = (shortest..=longest)
        .filter_map(at)
        .max_by(|a, b| a.2.total_cmp(&b.2))?;
    let tried = (longest - shortest + 1) as f64;
    Some(Persistence {
        lag: step * lag as f64,
        share,
        p: (2.0 * Normal::standard().sf(z) * tried).min(1.0),
    })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    const STEP: f64 = 0.02;

    /// First-order noise of a memory (s), and `more` at each time.
    fn judged(memory: f64, seed: u64, more: impl Fn(f64) -> f64) -> Persistence {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let keep = if memory > 0.0 {
            f64::exp(-STEP / memory)
        } else {
            0.0
        };
        let t: Vec<f64> = (0..1000).map(|k| STEP * f64::from(k)).collect();
        let mut noise = normal();
        let residual: Vec<f64> = (t.iter())
            .map(|&t| {
                noise = keep * noise + (1.0 - keep * keep).sqrt() * normal();
                noise + more(t)
            })
            .collect();
        let series = Series {
            joint: "x",
            t: &t,
            q: &t,
            dq: &t,
            tau: &residual,
            residual: &residual,
            temperature: None,
            contact: None,
            slides: false,
            noise: None,
        };
        persistence(&series, &Runs::of(&t)).unwrap()
    }

    /// One in a hundred: of two hundred five at most, but for one chance in fifty.
    #[test]
    fn noise_with_a_memory_does_not_last() {
        for memory in [0.0, 0.01, 0.02] {
            let alarms = (0..200).filter(|&seed| judged(memory, seed, |_| 0.0).is_real());
            let alarms = alarms.count();
            assert!(alarms <= 5, "{alarms} of memory {memory}");
        }
    }

    #[test]
    fn a_wave_lasts_with_its_share() {
        for seed in 0..10 {
            let wave = judged(0.02, seed, |t| (20.0 * t).sin());
            assert!(
                wave.is_real() && (wave.share - 1.0 / 3.0).abs() < 0.1,
                "{wave:?}"
            );
        }
    }
}
