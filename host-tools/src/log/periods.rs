//! Times between samples: a histogram of fixed size, and its quantiles.

/// Bins of 0.1 % width in ratio, from 10 µs to over a quarter of an hour.
const SHORTEST: f64 = 1e-5;
const RATIO: f64 = 1.001;
const BINS: usize = 18_500;

/// A histogram of times between samples.
#[derive(Debug, Clone)]
pub(crate) struct Periods {
    counts: Vec<u64>,
    total: u64,
}

impl Periods {
    pub(crate) fn new() -> Self {
        Self {
            counts: vec![0; BINS],
            total: 0,
        }
    }

    /// Takes a time between two samples, s.
    pub(crate) fn add(&mut self, period: f64) {
        let bin = (period.max(SHORTEST) / SHORTEST).ln() / RATIO.ln();
        self.counts[(bin as usize).min(BINS - 1)] += 1;
        self.total += 1;
    }

    /// The time below which a share `p` lies, s, within 0.1 %; 0 without any.
    pub(crate) fn quantile(&self, p: f64) -> f64 {
        let rank = p * self.total as f64;
        let mut below = 0.0;
        for (bin, &count) in self.counts.iter().enumerate() {
            let count = count as f64;
            if count > 0.0 && below + count >= rank {
                return SHORTEST * RATIO.powf(bin as f64 + (rank - below) / count);
            }
            below += count;
        }
        0.0
    }
}
