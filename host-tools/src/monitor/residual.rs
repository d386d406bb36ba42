//! A joint's residual of the last second against what it was before.

use std::collections::VecDeque;

/// How many past residuals a band is made of: about one a second.
const REMEMBERED: usize = 120;
/// The newest ones are judged by the band and are not in it.
const JUDGED: usize = 3;
/// A band of fewer would say nothing.
const LEAST: usize = 8;
/// Half the band's width in standard deviations of the past residuals.
const WIDTH: f64 = 4.0;
/// Windows of which a residual is told.
const WINDOWS: f64 = 20.0;
/// Windows before the first: until then the fit itself takes much of the sum of squares.
const SETTLED: f64 = 200.0;

/// Where residuals lie when nothing changes, N m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Lower end.
    pub lower: f64,
    /// Upper end.
    pub upper: f64,
}

/// What is left of a joint's torque, as it went.
///
/// A device tells the noise s of all w windows so far. The sum of squares w s² grows with each window by the square of what the
/// model did not foresee, so its growth tells the residual of the newest windows alone.
#[derive(Debug, Clone, Default)]
pub struct Residual {
    last: Option<(f64, f64)>,
    recent: VecDeque<f64>,
}

impl Residual {
    /// Takes in the noise (N m) of so many windows; fewer windows than before are a new beginning.
    pub fn hear(&mut self, windows: f64, noise: f64) {
        let sum = windows * noise * noise;
        match self.last {
            Some((before, _)) if windows < before => *self = Self::default(),
            _ if windows < SETTLED => return,
            Some((before, _)) if windows < before + WINDOWS => return,
            Some((before, sum_before)) => {
                let mean = (sum - sum_before) / (windows - before);
                self.recent.push_back(mean.max(0.0).sqrt());
                if self.recent.len() > REMEMBERED {
                    self.recent.pop_front();
                }
            }
            None => {}
        }
        self.last = Some((windows, sum));
    }

    /// Residual of the newest windows, N m.
    pub fn newest(&self) -> Option<f64> {
        self.recent.back().copied()
    }

    /// The residuals that are remembered, N m, the newest last: about one a second.
    pub fn recent(&self) -> impl Iterator<Item = f64> + '_ {
        self.recent.iter().copied()
    }

    /// Where it should lie; none before enough was heard.
    pub fn band(&self) -> Option<Band> {
        let n = self.recent.len().checked_sub(JUDGED)?;
        if n < LEAST {
            return None;
        }
        let past = || self.recent.iter().take(n);
        let mean = past().sum::<f64>() / n as f64;
        let square = past().map(|r| (r - mean).powi(2)).sum::<f64>() / (n - 1) as f64;
        let half = WIDTH * square.sqrt();
        Some(Band {
            lower: (mean - half).max(0.0),
            upper: mean + half,
        })
    }

    /// Whether the newest residual is above its band.
    pub fn is_above(&self) -> bool {
        match (self.newest(), self.band()) {
            (Some(newest), Some(band)) => newest > band.upper,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Windows of noise 0.2 N m, then of 0.4: the device's own number hardly moves, the newest residual doubles at once.
    #[test]
    fn a_change_is_seen_at_once() {
        let mut residual = Residual::default();
        let (mut windows, mut sum) = (0.0, 0.0);
        let mut told = 0.0;
        for second in 0..40 {
            let noise: f64 = if second < 38 { 0.2 } else { 0.5 };
            let wobble = 1.0 + 0.05 * f64::from(second % 3);
            windows += 50.0;
            sum += 50.0 * (noise * wobble).powi(2);
            told = (sum / windows).sqrt();
            residual.hear(windows, told);
            assert_eq!(residual.is_above(), second >= 38, "{second}: {residual:?}");
        }
        assert!(told < 0.24);
        assert!((residual.newest().unwrap() - 0.5).abs() < 0.05);
        residual.hear(50.0, 0.3);
        assert_eq!((residual.newest(), residual.band()), (None, None));
    }
}
