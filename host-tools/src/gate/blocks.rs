//! Sums over blocks of time, in memory that does not grow with the log.
//!
//! The error of an estimate comes from its spread over blocks of time, since neighbouring samples are not independent.
//! When there are too many blocks, neighbours are merged and the length of a block doubles; a long log has long blocks.

/// Sums that can be added up.
pub(super) trait Merge: Default + Clone {
    /// Adds `other` to this one.
    fn merge(&mut self, other: &Self);
}

/// Blocks held at most; even. Half as many already give a standard error to 13 %.
const MOST: usize = 64;

/// Sums over contiguous blocks of time.
#[derive(Debug, Clone)]
pub(super) struct Blocks<S> {
    length: f64,
    blocks: Vec<S>,
}

impl<S: Merge> Blocks<S> {
    /// Blocks of `length` s at first.
    pub(super) fn of_length(length: f64) -> Self {
        Self {
            length,
            blocks: Vec::new(),
        }
    }

    /// The sums that time `t` (s since the log's first sample, ≥ 0) belongs to.
    pub(super) fn at(&mut self, t: f64) -> &mut S {
        while t >= self.length * MOST as f64 {
            self.blocks = self.blocks.chunks(2).map(merged).collect();
            self.length *= 2.0;
        }
        let index = (t / self.length) as usize;
        if index >= self.blocks.len() {
            self.blocks.resize(index + 1, S::default());
        }
        &mut self.blocks[index]
    }

    /// Everything added up.
    pub(super) fn total(&self) -> S {
        merged(&self.blocks)
    }

    /// Each block for which `is_empty` does not hold, and all others added up.
    pub(super) fn each_and_rest(&self, is_empty: impl Fn(&S) -> bool) -> Vec<(S, S)> {
        let used: Vec<S> = self
            .blocks
            .iter()
            .filter(|&s| !is_empty(s))
            .cloned()
            .collect();
        (0..used.len())
            .map(|b| {
                let mut rest = merged(&used[..b]);
                rest.merge(&merged(&used[b + 1..]));
                (used[b].clone(), rest)
            })
            .collect()
    }

    /// An estimate from everything, its standard error by the delete-one-block jackknife (Efron 1982), and the number of
    /// blocks it comes from. Blocks for which `is_empty` holds do not count; none without an estimate or with fewer than
    /// three blocks.
    pub(super) fn jackknife<const N: usize>(
        &self,
        is_empty: impl Fn(&S) -> bool,
        estimate: impl Fn(&S) -> Option<[f64; N]>,
    ) -> Option<([f64; N], [f64; N], usize)> {
        let blocks = self.each_and_rest(is_empty);
        let count = blocks.len();
        if count < 3 {
            return None;
        }
        let value = estimate(&self.total())?;
        let without: Option<Vec<[f64; N]>> =
            blocks.iter().map(|(_, rest)| estimate(rest)).collect();
        let without = without?;
        let error = std::array::from_fn(|i| {
            let mean = without.iter().map(|v| v[i]).sum::<f64>() / count as f64;
            let spread: f64 = without.iter().map(|v| (v[i] - mean).powi(2)).sum();
            (spread * (count - 1) as f64 / count as f64).sqrt()
        });
        Some((value, error, count))
    }
}

fn merged<S: Merge>(blocks: &[S]) -> S {
    let mut sum = S::default();
    for block in blocks {
        sum.merge(block);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LENGTH: f64 = 2.0;

    #[derive(Debug, Clone, Default, PartialEq)]
    struct Mean {
        count: f64,
        sum: f64,
    }

    impl Merge for Mean {
        fn merge(&mut self, other: &Self) {
            self.count += other.count;
            self.sum += other.sum;
        }
    }

    proptest! {
        /// Merging loses nothing, and the memory stays bounded.
        #[test]
        fn the_total_is_that_of_all_samples(mut times in prop::collection::vec(0.0..20_000.0, 1..200)) {
            times.sort_by(f64::total_cmp);
            let mut blocks = Blocks::<Mean>::of_length(LENGTH);
            for &t in &times {
                blocks.at(t).merge(&Mean { count: 1.0, sum: t.round() });
            }
            prop_assert!(blocks.blocks.len() <= MOST);
            let sum = times.iter().map(|t| t.round()).sum();
            prop_assert_eq!(blocks.total(), Mean { count: times.len() as f64, sum });
        }
    }

    /// For a mean over equal blocks the jackknife is the textbook standard error.
    #[test]
    fn the_error_of_a_mean_is_its_standard_error() {
        let values = [1.0, 4.0, 2.0, 8.0, 5.0];
        let mut blocks = Blocks::<Mean>::of_length(LENGTH);
        for (b, &sum) in values.iter().enumerate() {
            *blocks.at(LENGTH * (b as f64 + 0.5)) = Mean { count: 1.0, sum };
        }
        let mean = |s: &Mean| Some([s.sum / s.count]);
        let ([value], [error], _) = blocks.jackknife(|s| s.count == 0.0, mean).unwrap();
        let variance = values.iter().map(|v| (v - 4.0f64).powi(2)).sum::<f64>() / 4.0;
        assert!((value - 4.0).abs() < 1e-12);
        assert!((error - (variance / 5.0).sqrt()).abs() < 1e-12);
    }
}
