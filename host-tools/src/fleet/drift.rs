//! Whether a series drifts, from when on and by how much.
//!
//! What all joints of a robot do together is no joint's drift: of each joint's series the part in proportion to the median of the others' is taken out, and, where
//! temperatures are recorded, the part in proportion to its own. The rest is judged by the greatest of its cumulative sums (the CUSUM of ordinary
//! residuals: Ploberger & Krämer, Econometrica 60, 1992), whose distribution is that of a Brownian bridge's maximum. Its scale comes from differences of neighbours
//! (von Neumann 1941), which a drift hardly enlarges.

use super::memory::Memory;
use crate::robust;

/// How improbable a drift must be by chance: of 100 000 series without one, one is reported.
const CHANCE: f64 = 1e-5;
/// Fewest blocks of a series.
pub const LEAST_BLOCKS: usize = 8;
/// Fewest other joints whose median is what all do together.
const LEAST_OTHERS: usize = 3;

/// A drift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// The last block before it, by place in the series.
    pub last_before: usize,
    /// Mean after it less mean before it, in the series' unit.
    pub size: f64,
    /// Its standard deviation.
    pub std: f64,
    /// How probable so large a sum is without a drift.
    pub chance: f64,
}

/// x without its part in proportion to y, both about their means. The proportion is that of their differences from block to block: over levels, a drift would look
/// like a part of whatever persists (spurious regression: Granger & Newbold, J. Econometrics 2, 1974).
fn without(x: &[f64], y: &[f64]) -> Vec<f64> {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let (mx, my) = (mean(x), mean(y));
    let differences = || {
        let pairs = x.windows(2).zip(y.windows(2));
        pairs.map(|(x, y)| [x[1] - x[0], y[1] - y[0]])
    };
    let products: f64 = differences().map(|[x, y]| x * y).sum();
    let squares: f64 = differences().map(|[_, y]| y * y).sum();
    let slope = match squares > 0.0 {
        true => products / squares,
        false => 0.0,
    };
    let pairs = x.iter().zip(y);
    pairs.map(|(x, y)| x - mx - slope * (y - my)).collect()
}

/// What of each of a robot's joints' series, aligned block by block, is its own: without its temperature's part (`None` where not recorded) and what the
/// others do together.
pub fn own_part(series: &[Vec<f64>], temperatures: &[Option<Vec<f64>>]) -> Vec<Vec<f64>> {
    let cooled: Vec<Vec<f64>> = (series.iter().zip(temperatures))
        .map(|(x, temperature)| match temperature {
            Some(temperature) => without(x, temperature),
            None => x.clone(),
        })
        .collect();
    let scaled: Vec<Vec<f64>> = cooled.iter().map(|x| in_own_units(x)).collect();
    let of = |j: usize| {
        let others = || scaled.iter().enumerate().filter(|(k, _)| *k != j);
        if others().count() < LEAST_OTHERS {
            return cooled[j].clone();
        }
        let common = (0..cooled[j].len()).map(|b| {
            let now = others().filter_map(|(_, x)| x.get(b).copied());
            robust::median(now).unwrap_or(0.0)
        });
        without(&cooled[j], &common.collect::<Vec<_>>())
    };
    (0..series.len()).map(of).collect()
}

/// About the median, in units of the robust scale.
fn in_own_units(x: &[f64]) -> Vec<f64> {
    let centre = robust::median(x.iter().copied()).unwrap_or(0.0);
    let scale = robust::scale(x.iter().map(|x| x - centre)).unwrap_or(0.0);
    let scale = if scale > 0.0 { scale } else { 1.0 };
    x.iter().map(|x| (x - centre) / scale).collect()
}

/// Half the mean square of neighbours' differences: the variance of independent blocks, whatever drifts slowly.
pub fn by_differences(x: &[f64]) -> f64 {
    let squares: f64 = x.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
    0.5 * squares / (x.len().max(2) - 1) as f64
}

/// Judges a series whose neighbours' differences have this `variance` ([`by_differences`]), and that remembers so.
pub fn judge(x: &[f64], variance: f64, memory: Memory) -> Option<Drift> {
    let n = x.len();
    if n < LEAST_BLOCKS || variance.is_nan() || variance <= 0.0 {
        return None;
    }
    let long_run = variance / (1.0 - memory.correlation(1)).max(0.05) * memory.long_run();
    let mean = x.iter().sum::<f64>() / n as f64;
    let (mut sum, mut best) = (0.0, (0, 0.0f64));
    for (k, x) in x.iter().take(n - 1).enumerate() {
        sum += x - mean;
        if sum.abs() > best.1.abs() {
            best = (k, sum);
        }
    }
    let chance = chance_of(best.1.abs() / (long_run * n as f64).sqrt());
    if chance > CHANCE {
        return None;
    }
    let (before, after) = x.split_at(best.0 + 1);
    let of = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let parts = 1.0 / before.len() as f64 + 1.0 / after.len() as f64;
    Some(Drift {
        last_before: best.0,
        size: of(after) - of(before),
        std: (long_run * parts).sqrt(),
        chance,
    })
}

/// How probable it is that a Brownian bridge goes beyond x: 2 Σ (−1)ᵏ⁺¹ exp(−2 k² x²) (Kolmogorov 1933).
fn chance_of(x: f64) -> f64 {
    let term = |k: i32| {
        let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
        sign * (-2.0 * f64::from(k * k) * x * x).exp()
    };
    match x > 0.2 {
        true => (2.0 * (1..=20).map(term).sum::<f64>()).clamp(0.0, 1.0),
        false => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    #[test]
    fn the_bridges_maximum_has_kolmogorovs_distribution() {
        // Table of Smirnov 1948: P(K > 1.36) = 0.05, P(K > 1.63) = 0.01.
        assert!((chance_of(1.358) - 0.05).abs() < 1e-3 && (chance_of(1.628) - 0.01).abs() < 3e-4);
        assert_eq!(chance_of(0.0), 1.0);
    }

    #[test]
    fn a_step_is_dated_and_sized_and_what_joints_do_together_is_none() {
        let wave = |k: usize, j: usize| (1.0 + 0.2 * j as f64) * (0.7 * k as f64).sin();
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut noise = move || -> f64 { StandardNormal.sample(&mut random) };
        let mut series: Vec<Vec<f64>> = (0..6)
            .map(|j| (0..40).map(|k| wave(k, j) + 0.05 * noise()).collect())
            .collect();
        series[2][25..].iter_mut().for_each(|x| *x += 0.5);
        let own = own_part(&series, &vec![None; 6]);
        let found: Vec<_> = own
            .iter()
            .map(|x| judge(x, by_differences(x), Memory::default()))
            .collect();
        let drift = found[2].expect("the step");
        assert_eq!(drift.last_before, 24);
        assert!((drift.size - 0.5).abs() < 3.0 * drift.std, "{drift:?}");
        assert!(
            found
                .iter()
                .enumerate()
                .all(|(j, found)| j == 2 || found.is_none()),
            "{found:?}"
        );
    }
}
