//! Statistics that the rules are made of: how unlikely a fall of the sum of squares is, and what an estimate's spread over folds and the memory
//! of its residuals make of its error.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Chance that anything is named on a complete model: once in a hundred logs, over all candidates that were tried.
pub(crate) const FALSE_ALARM: f64 = 0.01;
/// No effect counts that is smaller than this, in standard deviations, however few were tried: residuals are never quite as normal
/// and independent as the chance supposes.
pub(crate) const LEAST_Z: f64 = 4.0;
/// Longest memory of a noise, s: five times that of a first-order filter of 8 Hz, and a tenth of the slowest motion that an exciting
/// log is made of. What residuals remember longer is no noise.
pub(crate) const NOISE_MEMORY: f64 = 0.1;

/// A sum of squares in units of its variance: χ² of `freedom` if nothing is there, the best of `tried`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Squared {
    pub(crate) size: f64,
    pub(crate) freedom: f64,
    pub(crate) tried: f64,
}

impl Squared {
    /// Two effects taken together.
    pub(crate) fn and(self, other: Self) -> Self {
        Self {
            size: self.size + other.size,
            freedom: self.freedom + other.freedom,
            tried: self.tried * other.tried,
        }
    }

    /// As far from zero as a normal variable that is as unlikely.
    pub(crate) fn z(&self) -> f64 {
        if self.size <= self.freedom {
            return 0.0;
        }
        let chance = ChiSquared::new(self.freedom).map_or(1.0, |chi| chi.sf(self.size));
        let chance = (chance * self.tried).min(1.0);
        if chance < 1e-14 {
            // So far out the tails have the same slope: √ of what is beyond the freedom and the tries (Laurent & Massart 2000).
            let beyond = self.size - self.freedom - 2.0 * self.tried.ln();
            let near = (self.freedom - 1.0) * (self.size / self.freedom).ln();
            return (beyond - near).max(49.0).sqrt();
        }
        // Of the lower tail: near one, digits are lost.
        (-Normal::standard().inverse_cdf(0.5 * chance)).max(0.0)
    }
}

/// From which size on an effect counts, standard deviations, the best of `tried` candidates (Bonferroni 1936).
pub(crate) fn least_z(tried: usize) -> f64 {
    let chance = FALSE_ALARM / tried.max(1) as f64;
    Normal::standard()
        .inverse_cdf(1.0 - 0.5 * chance)
        .max(LEAST_Z)
}

/// Standard deviation of an estimate from its values without each fold in turn, with each of them its standard deviation there over that of all
/// data. What a fold tells alone is wild without it: (v₋ − v)² is σ²/I₋ − σ²/I on average, with the information I of all data and I₋ of the
/// rest, so that the sum of I₋/I (v₋ − v)² is the variance σ²/I however the folds share the information (CV2 of Bell & McCaffrey 2002; of equal
/// folds the jackknife, Efron & Tibshirani 1993, ch. 11).
pub(crate) fn jackknife(values: impl Iterator<Item = (f64, f64)>, centre: f64) -> f64 {
    let square = |(value, looser): (f64, f64)| ((value - centre) / looser.max(1.0)).powi(2);
    values.map(square).sum::<f64>().sqrt()
}

/// A sum over folds, and its standard error from their spread.
pub(crate) fn sum_and_error(folds: &[f64]) -> (f64, f64) {
    let n = folds.len() as f64;
    let sum: f64 = folds.iter().sum();
    let spread: f64 = folds.iter().map(|x| (x - sum / n).powi(2)).sum();
    (sum, (spread * n / (n - 1.0)).sqrt())
}

/// How many windows of this length (s) a noise remembers at most.
pub(crate) fn noise_lags(window: f64) -> usize {
    (NOISE_MEMORY / window).ceil().max(2.0) as usize
}

/// How many neighbours say the same thing because their noise remembers: the autocorrelation time of fewer than `lags` lags, less
/// what goes on as long again, which is no noise.
pub(crate) fn noise_memory(x: &[f64], lags: usize) -> f64 {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    let at_lag = |lag: usize| -> f64 {
        let pairs = x.iter().zip(x.iter().skip(lag));
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    let variance = at_lag(0);
    if x.len() < 4 * lags || variance <= 0.0 {
        return 1.0;
    }
    let lasting = (lags..2 * lags).map(at_lag).sum::<f64>() / lags as f64;
    let short: f64 = (1..lags).map(|lag| at_lag(lag) - lasting).sum();
    (1.0 + 2.0 * short / variance).max(1.0)
}

/// The integrated autocorrelation time of a series, at least one: so many neighbours say the same thing (Geyer 1992, initial
/// positive sequence).
pub(crate) fn autocorrelation_time(x: &[f64]) -> f64 {
    const MOST_LAG: usize = 100;
    let n = x.len();
    let mean = x.iter().sum::<f64>() / n.max(1) as f64;
    let at_lag = |lag: usize| -> f64 {
        let pairs = x.iter().zip(x.iter().skip(lag));
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum()
    };
    let variance = at_lag(0);
    if n < 2 * MOST_LAG || variance <= 0.0 {
        return 1.0;
    }
    let mut time = 1.0;
    for pair in 0..MOST_LAG / 2 {
        let sum = (at_lag(2 * pair + 1) + at_lag(2 * pair + 2)) / variance;
        if sum <= 0.0 {
            break;
        }
        time += 2.0 * sum;
    }
    time.max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One degree of freedom is the normal variable squared; far out the approximation goes on where the exact tail ends.
    #[test]
    fn z_is_that_of_a_normal_variable() {
        let z = |size: f64, freedom: f64| {
            Squared {
                size,
                freedom,
                tried: 1.0,
            }
            .z()
        };
        for x in [2.0f64, 4.0, 6.0, 7.0] {
            assert!((z(x * x, 1.0) - x).abs() < 1e-6);
        }
        assert!((z(400.0, 1.0) - 20.0).abs() < 0.1);
        assert!(z(60.0, 5.0) < z(60.0, 1.0) && z(90.0, 5.0) > z(60.0, 5.0));
        assert!(least_z(300) > 4.1 && least_z(1) == LEAST_Z);
    }
}
