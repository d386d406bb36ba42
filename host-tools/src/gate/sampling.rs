//! When samples came: period, jitter, repeats, gaps. Constant memory.

use serde::Serialize;

use crate::log::{GAP_PERIODS, LEAST_RATE, Periods};

/// The longest interval that is told apart, s: one that is no gap at the lowest rate.
const LONGEST: f64 = GAP_PERIODS / LEAST_RATE;

/// How the log was sampled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SamplingReport {
    /// Samples.
    pub samples: u64,
    /// From the first sample to the last, s.
    pub duration: f64,
    /// Median time between samples, s; within 1 %.
    pub period: f64,
    /// Half the range that holds 90 % of the intervals, s.
    pub jitter: f64,
    /// Share of samples whose readings all equal the last sample's, %.
    pub repeated_percent: f64,
    /// Samples whose time is not after the last one's.
    pub late: u64,
    /// Silences that no window bridges.
    pub gaps: u64,
    /// The longest time between samples, s.
    pub longest_gap: f64,
    /// Share of the duration that lies in gaps, %.
    pub gap_percent: f64,
}

/// What a sample is to those before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Arrival {
    /// The first one, or the first after a gap.
    Anew,
    /// This long after the last used one, s.
    After(f64),
    /// Not to be used: it repeats the last one or is late.
    Skip,
}

/// Counts of arrivals.
#[derive(Debug, Clone)]
pub(super) struct Sampling {
    samples: u64,
    first_us: u64,
    /// Time of the last sample, and of the last used one.
    last_us: u64,
    used_us: u64,
    intervals: Intervals,
    periods: Periods,
    repeated: u64,
    late: u64,
    gaps: u64,
    in_gaps: f64,
    longest: f64,
}

impl Sampling {
    pub(super) fn new() -> Self {
        Self {
            samples: 0,
            first_us: 0,
            last_us: 0,
            used_us: 0,
            intervals: Intervals::new(),
            periods: Periods::default(),
            repeated: 0,
            late: 0,
            gaps: 0,
            in_gaps: 0.0,
            longest: 0.0,
        }
    }

    /// Takes a sample; `repeated`: its readings all equal the last one's.
    pub(super) fn push(&mut self, time_us: u64, repeated: bool) -> Arrival {
        self.samples += 1;
        if self.samples == 1 {
            (self.first_us, self.last_us, self.used_us) = (time_us, time_us, time_us);
            return Arrival::Anew;
        }
        if time_us <= self.last_us {
            self.late += 1;
            return Arrival::Skip;
        }
        let interval = (time_us - self.last_us) as f64 * 1e-6;
        self.last_us = time_us;
        self.longest = self.longest.max(interval);
        if self.periods.is_gap(interval) {
            self.gaps += 1;
            self.in_gaps += interval;
        } else {
            self.intervals.add(interval);
        }
        if repeated {
            self.repeated += 1;
            return Arrival::Skip;
        }
        let since = (time_us - self.used_us) as f64 * 1e-6;
        self.used_us = time_us;
        if self.periods.exceeds(since) {
            Arrival::Anew
        } else {
            Arrival::After(since)
        }
    }

    /// Time of the last sample since the first, s.
    pub(super) fn now(&self) -> f64 {
        (self.last_us - self.first_us) as f64 * 1e-6
    }

    pub(super) fn report(&self) -> SamplingReport {
        let percent = |part: f64, whole: f64| {
            if whole > 0.0 {
                100.0 * part / whole
            } else {
                0.0
            }
        };
        let [early, median, late] = [0.05, 0.5, 0.95].map(|p| self.intervals.quantile(p));
        SamplingReport {
            samples: self.samples,
            duration: self.now(),
            period: median,
            jitter: 0.5 * (late - early),
            repeated_percent: percent(self.repeated as f64, self.samples as f64),
            late: self.late,
            gaps: self.gaps,
            longest_gap: self.longest,
            gap_percent: percent(self.in_gaps, self.now()),
        }
    }
}

/// A histogram of intervals up to [`LONGEST`], in steps of 10 µs.
#[derive(Debug, Clone)]
struct Intervals {
    counts: Vec<u64>,
    total: u64,
}

const WIDTH: f64 = 1e-5;

impl Intervals {
    fn new() -> Self {
        Self {
            counts: vec![0; (LONGEST / WIDTH) as usize + 1],
            total: 0,
        }
    }

    fn add(&mut self, interval: f64) {
        let bin = (interval / WIDTH) as usize;
        let last = self.counts.len() - 1;
        self.counts[bin.min(last)] += 1;
        self.total += 1;
    }

    /// The interval below which a share `p` lies, s, interpolated within its bin; 0 without any.
    fn quantile(&self, p: f64) -> f64 {
        let rank = p * self.total as f64;
        let mut below = 0.0;
        for (bin, &count) in self.counts.iter().enumerate() {
            let count = count as f64;
            if count > 0.0 && below + count >= rank {
                return WIDTH * (bin as f64 + (rank - below) / count);
            }
            below += count;
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_gaps_and_late_samples_are_counted() {
        let mut sampling = Sampling::new();
        assert_eq!(sampling.push(5_000, false), Arrival::Anew);
        assert_eq!(sampling.push(7_000, false), Arrival::After(0.002));
        assert_eq!(sampling.push(9_000, true), Arrival::Skip);
        assert_eq!(sampling.push(11_000, false), Arrival::After(0.004));
        assert_eq!(sampling.push(11_000, false), Arrival::Skip);
        assert_eq!(sampling.push(111_000, false), Arrival::Anew);
        let report = sampling.report();
        assert_eq!((report.samples, report.late, report.gaps), (6, 1, 1));
        assert!((report.longest_gap - 0.1).abs() < 1e-12);
        assert!((report.repeated_percent - 100.0 / 6.0).abs() < 1e-9);
        assert!((report.gap_percent - 100.0 * 0.1 / 0.106).abs() < 1e-9);
        assert!((report.period - 0.002).abs() < 2e-5);
    }

    #[test]
    fn jitter_is_half_of_the_middle_nine_tenths() {
        let mut sampling = Sampling::new();
        let mut t = 0;
        for k in 0..10_000 {
            sampling.push(t, false);
            // Uniform between 1.5 and 2.5 ms.
            t += 1500 + (k * 7919) % 1000;
        }
        let report = sampling.report();
        assert!((report.period - 2.0e-3).abs() < 2e-5, "{report:?}");
        assert!((report.jitter - 0.45e-3).abs() < 2e-5, "{report:?}");
    }
}
