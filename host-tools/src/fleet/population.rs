//! What robots have in common in one parameter, and which of them differ.

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::robust;

/// Fewest robots of which one can differ from the others.
pub const LEAST_ROBOTS: usize = 4;
/// How improbable it must be that one of all robots and columns differs so by chance.
const CHANCE: f64 = 0.01;
/// Standard error of a median over that of a mean, of normal values: √(π/2).
const MEDIAN_OVER_MEAN: f64 = 1.2533;

/// A parameter over all robots.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Common {
    /// How many robots tell it.
    pub robots: usize,
    /// Their median.
    pub centre: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Standard deviation between robots beyond the values' own ±.
    pub spread: f64,
}

/// What values, each with its ±, have in common: their median, and the robust scale about it less their own ±.
pub fn common(values: &[(f64, f64)]) -> Option<Common> {
    let centre = robust::median(values.iter().map(|(value, _)| *value))?;
    let own = robust::median(values.iter().map(|(_, std)| std * std))?;
    let n = values.len() as f64;
    // The median of few is one of them: n over n − 1 as for a mean.
    let scale = robust::scale(values.iter().map(|(value, _)| value - centre))?;
    let square = scale * scale * n / (n - 1.0).max(1.0);
    let spread = (square - own).max(0.0).sqrt();
    Some(Common {
        robots: values.len(),
        centre,
        std: MEDIAN_OVER_MEAN * (spread * spread + own).sqrt() / n.sqrt(),
        spread,
    })
}

impl Common {
    /// By how many standard deviations, of its own and between robots, a value differs.
    pub fn away(&self, (value, std): (f64, f64)) -> f64 {
        (value - self.centre) / (self.spread * self.spread + std * std + self.std * self.std).sqrt()
    }

    /// How far away a value must be to be one of `tests` that differs: by Student's distribution of the robots that the spread is known by.
    pub fn threshold(&self, tests: usize) -> f64 {
        // A robust scale of n values is as sure as a usual one of 0.37 n (Huber & Ronchetti 2009, §5.1).
        let freedom = (0.37 * self.robots as f64).max(1.0);
        let tail = 1.0 - 0.5 * CHANCE / tests.max(1) as f64;
        StudentsT::new(0.0, 1.0, freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(tail))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_of_many_is_away_and_moves_nothing() {
        let mut values: Vec<(f64, f64)> = (0..41)
            .map(|k| (1.0 + 0.01 * f64::from(k - 20), 0.01))
            .collect();
        let before = common(&values).unwrap();
        values[0].0 = 100.0;
        let after = common(&values).unwrap();
        assert!(
            (before.centre - after.centre).abs() < 0.02
                && (after.spread / before.spread - 1.0).abs() < 0.2
        );
        let far = after.threshold(values.len());
        let away = values
            .iter()
            .filter(|value| after.away(**value).abs() > far);
        assert_eq!(away.count(), 1);
        assert!(common(&[]).is_none());
    }

    #[test]
    fn the_threshold_is_students() {
        let common = Common {
            robots: 1_000_000,
            centre: 0.0,
            std: 0.0,
            spread: 1.0,
        };
        // Normal: 2.5758 leaves 0.5 % on either side.
        assert!((common.threshold(1) - 2.5758).abs() < 1e-3);
    }
}
