//! The step in which a signal is reported, found from the data.

/// Differences kept; enough to see single steps of a signal whose noise spans some ten steps.
const KEPT: usize = 1024;

/// Differences between successive distinct readings: a sample of them, spread evenly over the log.
#[derive(Debug, Clone)]
pub(in super::super) struct Differences {
    kept: Vec<f64>,
    /// One of this many is kept.
    stride: u32,
    skipped: u32,
}

impl Differences {
    pub(in super::super) fn new() -> Self {
        Self {
            kept: Vec::new(),
            stride: 1,
            skipped: 0,
        }
    }

    pub(in super::super) fn push(&mut self, difference: f64) {
        if difference == 0.0 {
            return;
        }
        self.skipped += 1;
        if self.skipped < self.stride {
            return;
        }
        self.skipped = 0;
        if self.kept.len() == KEPT {
            let mut keep = false;
            self.kept.retain(|_| {
                keep = !keep;
                keep
            });
            self.stride *= 2;
        }
        self.kept.push(difference.abs());
    }

    /// The largest step of which all differences are multiples; none where there is no such step.
    pub(in super::super) fn quantum(&self) -> Option<f64> {
        let mut sorted = self.kept.clone();
        sorted.sort_by(f64::total_cmp);
        if sorted.len() < LEAST {
            return None;
        }
        // The smallest difference is a step or a few of them.
        (1..=4).find_map(|steps| lattice(&sorted, sorted[0] / f64::from(steps)))
    }
}

/// Differences below this tell nothing.
const LEAST: usize = 30;

/// Steps up to which differences are used: further out, an error of the step would blur the lattice.
const REACH: f64 = 40.0;

/// Rms distance from the lattice, in steps, up to which it is one. Without a step it is 1/√12 = 0.29; readings printed
/// with seven digits reach 0.05.
const OFF_LATTICE: f64 = 0.12;

/// Refines a step over ever larger differences; none if they do not lie on its multiples.
fn lattice(sorted: &[f64], first: f64) -> Option<f64> {
    let mut step = first;
    for reach in [4.0, 8.0, 16.0, REACH] {
        let near = || sorted.iter().take_while(|&&d| d < reach * first);
        let (sum, squares) = near().fold((0.0, 0.0), |(sum, squares), d| {
            let n = (d / step).round();
            (sum + n * d, squares + n * n)
        });
        // No difference within reach: the next reach has some.
        if squares > 0.0 {
            step = sum / squares;
        }
    }
    let near = sorted.iter().take_while(|&&d| d < REACH * first);
    let (count, off) = near.fold((0.0, 0.0), |(count, off), d| {
        let n = d / step;
        (count + 1.0, off + (n - n.round()).powi(2))
    });
    let on_lattice = count >= LEAST as f64 && off < count * OFF_LATTICE * OFF_LATTICE;
    on_lattice.then_some(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn differences(seed: u64, spread: f64, report: impl Fn(f64) -> f64) -> Differences {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut differences = Differences::new();
        let mut last = 0.0;
        for _ in 0..5000 {
            let value = report(random.random_range(-spread..spread));
            differences.push(value - last);
            last = value;
        }
        differences
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// A step is found to a thousandth of it, also in digits that a text log rounds.
        #[test]
        fn the_step_is_found(seed in 0u64..1000, step in 1e-5..0.1f64, spread in 2.0..20.0f64) {
            let digits = step / 20.0;
            let found = differences(seed, spread * step, |x| {
                ((x / step).round() * step / digits).round() * digits
            }).quantum();
            prop_assert!(found.is_some_and(|found| (found / step - 1.0).abs() < 2e-3), "{found:?} for {step}");
        }

        /// A signal without steps has none.
        #[test]
        fn a_smooth_signal_has_no_step(seed in 0u64..1000, spread in 1e-3..10.0f64) {
            prop_assert_eq!(differences(seed, spread, |x| x).quantum(), None);
        }
    }
}
