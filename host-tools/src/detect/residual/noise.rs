//! The noise floor: the error that no model can take away.
//!
//! Two ways. Where the motion repeats itself, so does all that a model could explain; what differs between periods is noise.
//! Otherwise what a model could explain is smooth from window to window, and the second difference removes it. A window's
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
//! standard error of γ0 is 4 %, of the mean square itself 2 %: what the mean square has above γ0 is structure only as far as it is beyond
//! the error of that. A step, which a few second differences far beyond the others show, is not used. Other structure that changes within a
//! few windows counts as noise here and comes and goes with the motion, which the spread over time betrays: the value is then an upper
//! bound. A log's floor is that of what a regression on the motion leaves ([`crate::detect::floor`]).

use std::fmt;
use std::ops::Range;

use nalgebra::{SMatrix, SVector};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::series::{Runs, Series, centred, square};
use crate::robust;

/// How a noise floor was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "method")]
pub enum NoiseMethod {
    /// From what differs between periods of the motion.
    RepeatedPeriods {
        /// Length of a period, s.
        period: f64,
    },
    /// From all that a model leaves, where too few windows are neighbours.
    Everything,
    /// From second differences of neighbouring windows.
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
            NoiseMethod::Everything => write!(f, "from all that is left"),
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

/// A second difference of so many standard deviations is a step: of normal noise, one in two million.
const STEP: f64 = 5.0;

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

/// Sums of products of differences over a stretch.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    sum: [f64; 4],
    count: [f64; 4],
    /// Sum of squares of the windows themselves, and how many.
    squares: [f64; 2],
}

impl Sums {
    fn plus(mut self, other: &Self, sign: f64) -> Self {
        for lag in 0..4 {
            self.sum[lag] += sign * other.sum[lag];
            self.count[lag] += sign * other.count[lag];
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

    fn mean(&self, lag: usize) -> f64 {
        self.sum[lag] / self.count[lag].max(1.0)
    }
}

/// An estimate from the sums of all stretches and its jackknife error.
fn jackknife(stretches: &[Sums], estimate: impl Fn(&Sums) -> f64) -> (f64, f64) {
    let all = stretches
        .iter()
        .fold(Sums::default(), |all, s| all.plus(s, 1.0));
    let used: Vec<&Sums> = stretches
        .iter()
        .filter(|s| s.count[0] + s.squares[1] > 0.0)
        .collect();
    let without: Vec<f64> = used.iter().map(|s| estimate(&all.plus(s, -1.0))).collect();
    let count = without.len() as f64;
    let mean = without.iter().sum::<f64>() / count;
    let spread: f64 = without.iter().map(|v| (v - mean).powi(2)).sum();
    (estimate(&all), (spread * (count - 1.0) / count).sqrt())
}

fn high_frequency(residual: &[f64], runs: &Runs) -> Option<NoiseFloor> {
    let mut stretches = vec![Sums::default(); residual.len() / STRETCH + 1];
    let second =
        |run: &Range<usize>| (residual[run.clone()].windows(3)).map(|w| w[0] - 2.0 * w[1] + w[2]);
    let usual = robust::scale(runs.0.iter().flat_map(second)).unwrap_or(0.0);
    let is_step = |d: &f64| d.abs() > STEP * usual;
    for run in &runs.0 {
        for (k, value) in residual[run.clone()].iter().enumerate() {
            let stretch = &mut stretches[(run.start + k) / STRETCH];
            stretch.squares[0] += value * value;
            stretch.squares[1] += 1.0;
        }
        let d: Vec<f64> = second(run).collect();
        for lag in 0..4.min(d.len()) {
            let pairs = d.iter().zip(&d[lag..]).enumerate();
            for (k, (a, b)) in pairs.filter(|(_, (a, b))| !is_step(a) && !is_step(b)) {
                let stretch = &mut stretches[(run.start + k) / STRETCH];
                stretch.sum[lag] += a * b;
                stretch.count[lag] += 1.0;
            }
        }
    }
    if stretches.iter().map(|s| s.count[3]).sum::<f64>() < LEAST as f64 / 2.0 {
        // A joint that turns round every few windows has too few neighbours: the noise is no more than all that is left.
        let (rms, rms_std) = jackknife(&stretches, |sums| sums.square().sqrt());
        return Some(NoiseFloor {
            rms,
            rms_std,
            upper_bound: true,
            method: NoiseMethod::Everything,
        });
    }
    let above = |sums: &Sums| (sums.square() - moving_average(sums)[0]).max(0.0);
    // Without structure the mean square tells the variance best, and what differs is the error of the other (Hausman 1978).
    let (_, differences_std) = jackknife(&stretches, |sums| moving_average(sums)[0]);
    let variance = |sums: &Sums| {
        let above = above(sums);
        let beyond = above - (SURE * differences_std).powi(2) / above.max(f64::MIN_POSITIVE);
        sums.square() - beyond.max(0.0)
    };
    let (rms, rms_std) = jackknife(&stretches, |sums| variance(sums).max(0.0).sqrt());
    let all = stretches
        .iter()
        .fold(Sums::default(), |all, s| all.plus(s, 1.0));
    let [variance, neighbours] = moving_average(&all);
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
        upper_bound: !steady(&stretches, rms),
        method,
    })
}

/// The relative standard error of a floor of steady noise is this over the root of the number of windows.
const STEADY: f64 = 1.2;

/// Chance that steady noise is taken for something that comes and goes.
const UNSTEADY: f64 = 0.001;

/// Whether the noise of up to eight parts of the series is the same but for chance (chi-square test).
fn steady(stretches: &[Sums], rms: f64) -> bool {
    let parts = (stretches.len() / 2).clamp(2, 8);
    let groups = stretches.chunks(stretches.len().div_ceil(parts));
    let sums = groups.map(|group| {
        group
            .iter()
            .fold(Sums::default(), |all, s| all.plus(s, 1.0))
    });
    let (mut statistic, mut count) = (0.0, 0.0);
    for part in sums.filter(|part| part.count[3] >= STRETCH as f64) {
        let off = moving_average(&part)[0].max(0.0).sqrt() / rms.max(f64::MIN_POSITIVE) - 1.0;
        statistic += off * off * part.count[0] / (STEADY * STEADY);
        count += 1.0;
    }
    let chi_square = ChiSquared::new(f64::max(count - 1.0, 1.0));
    chi_square.is_ok_and(|chi_square| chi_square.sf(statistic) >= UNSTEADY)
}

/// Lags of the second difference's autocovariance that are used.
const DIFFERENCE_LAGS: usize = 4;

/// Autocovariance of the second difference of white noise of variance 1.
const OF_WHITE: [f64; 3] = [6.0, -4.0, 1.0];

/// γ0 and γ1 of an MA(1) process from the autocovariances of its second difference, with |γ1| ≤ γ0/2 as every MA(1)
/// process has it.
fn moving_average(sums: &Sums) -> [f64; 2] {
    let y = SVector::<f64, DIFFERENCE_LAGS>::from_fn(|lag, _| sums.mean(lag));
    // Columns γ0, γ1, s.
    let columns = SMatrix::<f64, DIFFERENCE_LAGS, 3>::from_row_slice(&[
        6.0, -8.0, 1.0, //
        -4.0, 7.0, 1.0, //
        1.0, -4.0, 1.0, //
        0.0, 1.0, 1.0,
    ]);
    let [mut g0, mut g1, slow]: [f64; 3] = weighted(columns, y).into();
    if slow < 0.0 {
        // What is alike at all lags is the variance of something.
        [g0, g1] = weighted(columns.fixed_columns::<2>(0).into_owned(), y).into();
    }
    if g1.abs() <= 0.5 * g0 {
        return [g0, g1];
    }
    // On the bound γ1 = ±γ0/2 two unknowns are left.
    let side = 0.5f64.copysign(g1);
    let bound = columns.fixed_columns::<2>(0) * SVector::from([1.0, side]);
    let columns =
        SMatrix::<f64, DIFFERENCE_LAGS, 2>::from_columns(&[bound, columns.column(2).into()]);
    let [g0, _]: [f64; 2] = weighted(columns, y).into();
    let g0 = f64::max(g0, 0.0);
    [g0, side * g0]
}

/// Least squares weighted by the covariance of sample autocovariances in white noise.
fn weighted<const N: usize>(
    columns: SMatrix<f64, DIFFERENCE_LAGS, N>,
    y: SVector<f64, DIFFERENCE_LAGS>,
) -> SVector<f64, N> {
    let at = |lag: i32| {
        OF_WHITE
            .get(lag.unsigned_abs() as usize)
            .copied()
            .unwrap_or(0.0)
    };
    let covariance = SMatrix::<f64, DIFFERENCE_LAGS, DIFFERENCE_LAGS>::from_fn(|i, j| {
        let (i, j) = (i as i32, j as i32);
        let term = |m: i32| at(m) * at(m + j - i) + at(m + j) * at(m - i);
        (-8..=8).map(term).sum()
    });
    let root = covariance
        .cholesky()
        .expect("a covariance of full rank")
        .l();
    let solve = "a factor of full rank";
    let x = root.solve_lower_triangular(&columns).expect(solve);
    let y = root.solve_lower_triangular(&y).expect(solve);
    let qr = x.transpose() * x;
    qr.cholesky()
        .map_or(SVector::zeros(), |qr| qr.solve(&(x.transpose() * y)))
}

/// What differs from one period to the next, over √2.
fn repeated(series: &Series, runs: &Runs, period: usize) -> Option<NoiseFloor> {
    let mut stretches = vec![Sums::default(); series.t.len() / STRETCH + 1];
    for run in &runs.0 {
        for k in run.start..run.end.saturating_sub(period) {
            let d = series.residual[k + period] - series.residual[k];
            let stretch = &mut stretches[k / STRETCH];
            stretch.sum[0] += 0.5 * d * d;
            stretch.count[0] += 1.0;
        }
    }
    let (rms, rms_std) = jackknife(&stretches, |sums| sums.mean(0).max(0.0).sqrt());
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
