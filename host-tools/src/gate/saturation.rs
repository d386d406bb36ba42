//! Torque at its limit: at the actuator's effort limit, or at a plateau below it.

use super::AT_REST;
use serde::Serialize;

/// Bins of |τ| from 0 to a fifth above the effort limit.
const BINS: usize = 1200;
const PER_LIMIT: f64 = 1000.0;

/// At the limit: from this share of it on. Below the last per cents a motor's own limit is not exact.
const AT_LIMIT: f64 = 0.99;

/// Torque at its limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Saturation {
    /// Share of samples at the effort limit or beyond, %.
    pub at_limit_percent: f64,
    /// The largest torque, where samples pile up at it as a limit below the effort limit would make them.
    pub plateau: Option<Plateau>,
}

/// A torque that is reached often and never exceeded.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Plateau {
    /// |τ|, N m.
    pub torque: f64,
    /// Share of the samples in motion that lie there, %.
    pub percent: f64,
}

/// A histogram of |τ| in motion.
#[derive(Debug, Clone)]
pub(super) struct Torques {
    effort: f64,
    samples: u64,
    at_limit: u64,
    moving: u64,
    counts: Vec<u32>,
}

impl Torques {
    /// `effort`: the actuator's limit, N m.
    pub(super) fn new(effort: f64) -> Self {
        Self {
            effort,
            samples: 0,
            at_limit: 0,
            moving: 0,
            counts: vec![0; BINS],
        }
    }

    pub(super) fn push(&mut self, tau: f64, dq: f64) {
        let share = tau.abs() / self.effort;
        self.samples += 1;
        self.at_limit += u64::from(share >= AT_LIMIT);
        // Of a joint at rest the same torque for long is no plateau.
        if dq.abs() > AT_REST {
            self.moving += 1;
            let bin = ((share * PER_LIMIT) as usize).min(BINS - 1);
            self.counts[bin] = self.counts[bin].saturating_add(1);
        }
    }

    pub(super) fn report(&self) -> Saturation {
        Saturation {
            at_limit_percent: 100.0 * self.at_limit as f64 / self.samples.max(1) as f64,
            plateau: self.plateau(),
        }
    }

    /// The tail of a torque that nothing limits thins out; one that is cut piles up in its last bins.
    fn plateau(&self) -> Option<Plateau> {
        let last = self.counts.iter().rposition(|&count| count > 0)?;
        // A limit and its quantisation fall into two bins; the tail below is judged over as many as are still its tail.
        let below = last.checked_sub(2 + TAIL)?;
        let sum = |counts: &[u32]| counts.iter().map(|&count| f64::from(count)).sum::<f64>();
        let top = sum(&self.counts[last - 1..=last]);
        let tail = sum(&self.counts[below..last - 1]) / TAIL as f64 * 2.0;
        let share = top / self.moving as f64;
        (top >= 20.0 && share >= 0.002 && top > 6.0 * tail).then(|| Plateau {
            torque: (last as f64 + 0.5) / PER_LIMIT * self.effort,
            percent: 100.0 * share,
        })
    }
}

/// Bins below the top to compare with: 2 % of the effort limit.
const TAIL: usize = 20;

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    fn report(tau: impl Fn(f64, f64) -> f64) -> Saturation {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let noise = Normal::new(0.0, 0.05).unwrap();
        let mut torques = Torques::new(23.7);
        for k in 0..10_000 {
            let phase = f64::from(k) * 2e-3 * 7.0;
            torques.push(tau(phase.sin(), noise.sample(&mut random)), phase.cos());
        }
        torques.report()
    }

    #[test]
    fn a_cut_torque_has_a_plateau_and_an_uncut_one_has_none() {
        let quantised = |tau: f64| (tau / 0.02474).round() * 0.02474;
        let cut = report(|sine, noise| quantised((12.0 * sine + noise).clamp(-8.0, 8.0)));
        let plateau = cut.plateau.unwrap();
        assert!((plateau.torque - 8.0).abs() < 0.05, "{plateau:?}");
        assert!((10.0..70.0).contains(&plateau.percent), "{plateau:?}");
        assert_eq!(cut.at_limit_percent, 0.0);
        // A sine dwells at its crest, and noise rounds the crest off.
        let free = report(|sine, noise| quantised(12.0 * sine + noise));
        assert_eq!(free.plateau, None);
    }

    #[test]
    fn the_effort_limit_is_counted() {
        let report = report(|sine, _| 40.0 * sine);
        // |sin| ≥ 0.99 · 23.7/40 for 60 % of the time.
        let expected = 100.0 * (1.0 - (0.99f64 * 23.7 / 40.0).asin() * 2.0 / std::f64::consts::PI);
        assert!(
            (report.at_limit_percent - expected).abs() < 1.0,
            "{report:?}"
        );
    }

    #[test]
    fn a_torque_held_at_rest_is_no_plateau() {
        let mut torques = Torques::new(23.7);
        for _ in 0..1000 {
            torques.push(5.0, 0.01);
        }
        assert_eq!(torques.report().plateau, None);
    }
}
