//! The noise floor: the error that no model can take away.
//!
//! Two ways. Where the motion repeats itself, so does all that a model could explain; what differs between periods is noise.
//! Otherwise what a model could explain is smooth from window to window, and differences remove it. A window's
//! noise is not white: the readings at its ends belong to two windows, with opposite signs, so that neighbours are
//! correlated, an MA(1) process with autocovariances γ0, γ1. The second difference d of such noise has
//!
//! ```text
//! E d(t) d(t) = 6 γ0 − 8 γ1,   lag 1: −4 γ0 + 7 γ1,   lag 2: γ0 − 4 γ1,   lag 3: γ1,
//! ```
//!
//! and what a smooth structure leaves in d is alike at lags this short: a constant s. From the four sample autocovariances γ0,
//! γ1 and s follow by least squares, weighted by their covariance in white noise (Bartlett's formula): without weights the
//! error is twice as large, without s a structure of 2 Hz and five times the noise adds 14 % to it. For 1000 windows the
//! standard error of γ0's root is 3 %, of the root of the mean square 2 %: what the mean square has above γ0 is structure only as far as it is
//! beyond the error of that. Fourth differences, six autocovariances of them, have an error of 5 %, but of a structure of 4 Hz in windows of 20 ms
//! they leave 0.3 % of the mean square where second ones leave 3 %: what second differences have above fourth ones is structure by the same rule.
//! Structure that changes within a few windows counts as noise here
//! and comes and goes with the motion, which the spread over time betrays: the value is then an upper bound. A log's floor is
//! that of what a regression on the motion leaves ([`crate::detect::floor`]).

use std::fmt;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::series::{Runs, Series, centred, square};

/// How a noise floor was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "method")]
pub enum NoiseMethod {
    /// From what differs between periods of the motion.
    RepeatedPeriods {
        /// Length of a period, s.
        period: f64,
    },
    /// From differences of neighbouring windows.
    HighFrequency {
        /// Correlation of neighbouring windows' noise, −0.5 to 0.5.
        neighbours: f64,
    },
}

/// The error that no model can take away.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NoiseFloor {
    /// Standard deviation of the noise of a window, N m.
    pub rms: f64,
    /// Its standard error, from the spread over stretches of time, N m.
    pub rms_std: f64,
    /// Whether it comes and goes more than steady noise does, so that the true floor may be lower.
    pub upper_bound: bool,
    /// How it was found.
    #[serde(flatten)]
    pub method: NoiseMethod,
}

impl fmt::Display for NoiseFloor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let at_most = if self.upper_bound { "at most " } else { "" };
        write!(
            f,
            "noise floor {at_most}{:.4} ±{:.4} N m, ",
            self.rms, self.rms_std
        )?;
        match self.method {
            NoiseMethod::RepeatedPeriods { period } => {
                write!(f, "from what differs between periods of {period:.2} s")
            }
            NoiseMethod::HighFrequency { .. } => {
                write!(f, "from differences of neighbouring windows")
            }
        }
    }
}

/// Windows per stretch whose spread gives the error.
const STRETCH: usize = 50;

/// What the mean square has above the noise of differences is structure from so many standard deviations on, and less of it is left out the
/// nearer it is to that.
const SURE: f64 = 2.0;

/// Fewer windows than this say nothing of noise.
const LEAST: usize = 100;

/// The noise floor of a residual; none for fewer than 100 windows.
pub(super) fn floor(series: &Series, runs: &Runs) -> Option<NoiseFloor> {
    if series.t.len() < LEAST {
        return None;
    }
    match period(series, runs) {
        Some(windows) => repeated(series, runs, windows),
        None => high_frequency(series.residual, runs),
    }
}

/// A difference of neighbouring windows of a series.
struct Difference {
    /// Multiples of windows that follow each other.
    of: &'static [f64],
    /// Autocovariance of it in white noise of variance 1, from lag 0 on.
    of_white: &'static [f64],
}

/// The second difference, and the fourth.
const DIFFERENCES: [Difference; 2] = [
    Difference {
        of: &[1.0, -2.0, 1.0],
        of_white: &[6.0, -4.0, 1.0],
    },
    Difference {
        of: &[1.0, -4.0, 6.0, -4.0, 1.0],
        of_white: &[70.0, -56.0, 28.0, -8.0, 1.0],
    },
];

/// The most lags that are used of a difference.
const MOST_LAGS: usize = 6;

impl Difference {
    /// Lags at which noise that neighbours share leaves anything.
    const fn lags(&self) -> usize {
        self.of_white.len() + 1
    }

    /// Autocovariance in white noise at any lag.
    fn of_white(&self, lag: i32) -> f64 {
        (self.of_white.get(lag.unsigned_abs() as usize).copied()).unwrap_or(0.0)
    }
}

/// Sums of products of a difference with itself some lags later.
#[derive(Debug, Clone, Copy, Default)]
struct Products {
    sum: [f64; MOST_LAGS],
    count: [f64; MOST_LAGS],
}

impl Products {
    fn mean(&self, lag: usize) -> f64 {
        self.sum[lag] / self.count[lag].max(1.0)
    }
}

/// Sums over a stretch.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    of: [Products; DIFFERENCES.len()],
    /// Sum of squares of the windows themselves, and how many.
    squares: [f64; 2],
}

impl Sums {
    fn plus(mut self, other: &Self, sign: f64) -> Self {
        for (products, more) in self.of.iter_mut().zip(&other.of) {
            for lag in 0..MOST_LAGS {
                products.sum[lag] += sign * more.sum[lag];
                products.count[lag] += sign * more.count[lag];
            }
        }
        for n in 0..2 {
            self.squares[n] += sign * other.squares[n];
        }
        self
    }

    /// Mean square of the windows.
    fn square(&self) -> f64 {
        self.squares[0] / self.squares[1].max(1.0)
    }

    /// Differences at the longest lag of second differences: with fewer a stretch says nothing.
    fn count(&self) -> f64 {
        self.of[0].count[DIFFERENCES[0].lags() - 1]
    }
}

/// An estimate from the sums of all stretches and its jackknife error.
fn jackknife(stretches: &[Sums], estimate: impl Fn(&Sums) -> f64) -> (f64, f64) {
    let all = stretches
        .iter()
        .fold(Sums::default(), |all, s| all.plus(s, 1.0));
    let used: Vec<&Sums> = stretches.iter().filter(|s| s.squares[1] > 0.0).collect();
    let without: Vec<f64> = used.iter().map(|s| estimate(&all.plus(s, -1.0))).collect();
    let count = without.len() as f64;
    let mean = without.iter().sum::<f64>() / count;
    let spread: f64 = without.iter().map(|v| (v - mean).powi(2)).sum();
    (estimate(&all), (spread * (count - 1.0) / count).sqrt())
}

fn high_frequency(residual: &[f64], runs: &Runs) -> Option<NoiseFloor> {
    let mut stretches = vec![Sums::default(); residual.len() / STRETCH + 1];
    for run in &runs.0 {
        let values = &residual[run.clone()];
        for (k, value) in values.iter().enumerate() {
            let stretch = &mut stretches[(run.start + k) / STRETCH];
            stretch.squares[0] += value * value;
            stretch.squares[1] += 1.0;
        }
        for (n, difference) in DIFFERENCES.iter().enumerate() {
            let d: Vec<f64> = (values.windows(difference.of.len()))
                .map(|w| w.iter().zip(difference.of).map(|(x, by)| by * x).sum())
                .collect();
            for lag in 0..difference.lags().min(d.len()) {
                for (k, (a, b)) in d.iter().zip(&d[lag..]).enumerate() {
                    let products = &mut stretches[(run.start + k) / STRETCH].of[n];
                    products.sum[lag] += a * b;
                    products.count[lag] += 1.0;
                }
            }
        }
    }
    if stretches.iter().map(Sums::count).sum::<f64>() < LEAST as f64 / 2.0 {
        return None;
    }
    let noise = [Noise::of(0), Noise::of(1)];
    let errors =
        (noise.each_ref()).map(|noise| jackknife(&stretches, |sums| noise.moments(sums)[0]).1);
    // Without structure the mean square tells the variance best, then second differences, and what differs is the error of the others (Hausman 1978).
    let variance = |sums: &Sums| {
        (noise.iter().zip(errors)).fold(sums.square(), |variance, (noise, error)| {
            let above = (variance - noise.moments(sums)[0]).max(0.0);
            let beyond = above - (SURE * error).powi(2) / above.max(f64::MIN_POSITIVE);
            variance - beyond.max(0.0)
        })
    };
    let (rms, rms_std) = jackknife(&stretches, |sums| variance(sums).max(0.0).sqrt());
    let all = stretches
        .iter()
        .fold(Sums::default(), |all, s| all.plus(s, 1.0));
    let [variance, neighbours] = noise[0].moments(&all);
    let method = NoiseMethod::HighFrequency {
        neighbours: if variance > 0.0 {
            neighbours / variance
        } else {
            0.0
        },
    };
    Some(NoiseFloor {
        rms,
        rms_std,
        upper_bound: !steady(&stretches, &noise[0], rms),
        method,
    })
}

/// The relative standard error of a floor of steady noise is this over the root of the number of windows.
const STEADY: f64 = 1.2;

/// Chance that steady noise is taken for something that comes and goes.
const UNSTEADY: f64 = 0.001;

/// Whether the noise of up to eight parts of the series is the same but for chance (chi-square test).
fn steady(stretches: &[Sums], noise: &Noise, rms: f64) -> bool {
    let parts = (stretches.len() / 2).clamp(2, 8);
    let groups = stretches.chunks(stretches.len().div_ceil(parts));
    let sums = groups.map(|group| (group.iter()).fold(Sums::default(), |all, s| all.plus(s, 1.0)));
    let (mut statistic, mut count) = (0.0, 0.0);
    for part in sums.filter(|part| part.count() >= STRETCH as f64) {
        let off = noise.moments(&part)[0].max(0.0).sqrt() / rms.max(f64::MIN_POSITIVE) - 1.0;
        statistic += off * off * part.of[0].count[0] / (STEADY * STEADY);
        count += 1.0;
    }
    let chi_square = ChiSquared::new(f64::max(count - 1.0, 1.0));
    chi_square.is_ok_and(|chi_square| chi_square.sf(statistic) >= UNSTEADY)
}

/// From the autocovariances of a difference to γ0 and γ1 of an MA(1) process: least squares weighted by the covariance of sample
/// autocovariances in white noise, each a matrix that is multiplied by them.
struct Noise {
    n: usize,
    /// To γ0, γ1, s.
    free: DMatrix<f64>,
    /// To γ0, γ1 where no structure is left.
    alone: DMatrix<f64>,
    /// To γ0, s where γ1 is −γ0/2, and where it is γ0/2.
    bound: [DMatrix<f64>; 2],
}

impl Noise {
    /// Of the n-th difference.
    fn of(n: usize) -> Self {
        let difference = &DIFFERENCES[n];
        let at = |lag| difference.of_white(lag);
        let lags = difference.lags();
        let covariance = DMatrix::from_fn(lags, lags, |i, j| {
            let (i, j) = (i as i32, j as i32);
            let term = |m: i32| at(m) * at(m + j - i) + at(m + j) * at(m - i);
            let last = 2 * lags as i32;
            (-last..=last).map(term).sum()
        });
        let root = covariance.cholesky().expect("a covariance of full rank");
        let solver = |columns: DMatrix<f64>| {
            let weighted = root.solve(&columns).transpose();
            let products = (&weighted * &columns).cholesky();
            products.expect("columns that differ").solve(&weighted)
        };
        let column = |of: &dyn Fn(i32) -> f64| DVector::from_fn(lags, |lag, _| of(lag as i32));
        let (own, beside) = (column(&at), column(&|lag| at(lag - 1) + at(lag + 1)));
        let alike = column(&|_| 1.0);
        Self {
            n,
            alone: solver(DMatrix::from_columns(&[own.clone(), beside.clone()])),
            bound: [-0.5, 0.5].map(|side| {
                solver(DMatrix::from_columns(&[
                    &own + side * &beside,
                    alike.clone(),
                ]))
            }),
            free: solver(DMatrix::from_columns(&[own, beside, alike])),
        }
    }

    /// γ0 and γ1, with |γ1| ≤ γ0/2 as every MA(1) process has it.
    fn moments(&self, sums: &Sums) -> [f64; 2] {
        let lags = DIFFERENCES[self.n].lags();
        let y = DVector::from_fn(lags, |lag, _| sums.of[self.n].mean(lag));
        let found = &self.free * &y;
        let [mut g0, mut g1] = [found[0], found[1]];
        if found[2] < 0.0 {
            // What is alike at all lags is the variance of something.
            let found = &self.alone * &y;
            [g0, g1] = [found[0], found[1]];
        }
        if g1.abs() <= 0.5 * g0 {
            return [g0, g1];
        }
        // On the bound two unknowns are left.
        let side = usize::from(g1 > 0.0);
        let g0 = f64::max((&self.bound[side] * &y)[0], 0.0);
        [g0, (side as f64 - 0.5) * g0]
    }
}

/// What differs from one period to the next, over √2.
fn repeated(series: &Series, runs: &Runs, period: usize) -> Option<NoiseFloor> {
    let mut stretches = vec![Sums::default(); series.t.len() / STRETCH + 1];
    for run in &runs.0 {
        for k in run.start..run.end.saturating_sub(period) {
            let d = series.residual[k + period] - series.residual[k];
            let stretch = &mut stretches[k / STRETCH];
            stretch.squares[0] += 0.5 * d * d;
            stretch.squares[1] += 1.0;
        }
    }
    let (rms, rms_std) = jackknife(&stretches, |sums| sums.square().sqrt());
    let first = runs.0.iter().find(|run| run.len() > period)?;
    let period = series.t[first.start + period] - series.t[first.start];
    let method = NoiseMethod::RepeatedPeriods { period };
    Some(NoiseFloor {
        rms,
        rms_std,
        upper_bound: false,
        method,
    })
}

/// Longest period looked for, windows, and over how many windows at most.
const LONGEST: usize = 3000;
const LOOKED_AT: usize = 20_000;

/// Share of the variance of q by which periods may differ.
const MISMATCH: f64 = 2e-3;

/// The period of the motion, windows: the lag at which q repeats best, if it does at all, three times or more.
fn period(series: &Series, runs: &Runs) -> Option<usize> {
    let n = series.t.len().min(LOOKED_AT);
    let q = centred(&series.q[..n]);
    let variance = square(&q) / n as f64;
    // Less than a hundredth of a radian is a joint that is held.
    if variance < 1e-4 {
        return None;
    }
    let inside: Vec<_> = runs.0.iter().filter(|run| run.end <= n).cloned().collect();
    let mismatch = |lag: usize| {
        let (mut sum, mut count) = (0.0, 0);
        for run in inside.iter().filter(|run| run.len() > lag) {
            let (a, b) = (&q[run.start..run.end - lag], &q[run.start + lag..run.end]);
            sum += a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
            count += a.len();
        }
        // Three periods: two lags' worth of pairs.
        (count >= 2 * lag).then(|| sum / (2.0 * variance * count as f64))
    };
    let mut away = false;
    let mut best: Option<(f64, usize)> = None;
    for lag in 1..=LONGEST.min(n / 3) {
        let Some(mismatch) = mismatch(lag) else { break };
        // Neighbours are alike in any slow motion; a period comes after the motion was elsewhere.
        away |= mismatch > 0.5;
        if away && mismatch < MISMATCH && best.is_none_or(|(least, _)| mismatch < least) {
            best = Some((mismatch, lag));
        }
    }
    best.map(|(_, lag)| lag)
}
