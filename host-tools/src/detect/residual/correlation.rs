//! Is what is left noise? Autocorrelation of the residual, and its correlation with what drives the robot.
//!
//! *Whiteness.* Neighbouring windows share the readings at their common end, so that even a perfect model leaves an MA(1)
//! residual. Every second window is used: those share no reading. The portmanteau statistic is Ljung and Box's (1978) with
//! each autocorrelation divided by its own standard error under changing variance (Lobato, Nankervis and Savin 2001): joints are
//! noisier when they move, and that is no structure.
//!
//! *Independence.* If residual and input are independent, their cross-correlation at lag τ is normal with variance
//! Σ R_e(k) R_u(k) (Ljung, System Identification, §16.6), where R_e and R_u are the autocovariances. All windows are used; the
//! residual's own correlation is in R_e, cut off where it has died away (Politis 2003). Since the inputs are given, the
//! sum over k needs no stationary input: a chirp is allowed.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::series::{Runs, Series, centred, square};

/// Probability that a test sounds an alarm though nothing is wrong, and that a value lies outside its band.
pub const LEVEL: f64 = 0.01;

/// The quantile of the normal distribution that 99 % bands are made of.
const BAND: f64 = 2.575_829_303_548_901;

/// Every so many windows one is used for whiteness: windows next to each other share readings.
pub const DECIMATION: usize = 2;

/// Lags of the autocorrelation, decimated windows.
const LAGS: usize = 20;

/// Lags of the cross-correlation to either side, windows.
const CROSS_LAGS: usize = 10;

/// Fewer windows than this cannot be judged.
const LEAST: usize = 50;

/// A correlation at a lag, and the band in which it lies with 99 % if nothing is wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Correlation {
    /// Lag, s; positive: the residual comes later.
    pub lag: f64,
    /// Correlation, −1 to 1.
    pub value: f64,
    /// Half width of the 99 % band about zero.
    pub band: f64,
}

/// Whether the residual is white.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Whiteness {
    /// Autocorrelation of every second window.
    pub autocorrelation: Vec<Correlation>,
    /// Portmanteau statistic.
    pub statistic: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
    /// Probability of a statistic as large in white noise.
    pub p: f64,
    /// Whether it is white as far as one can tell: p ≥ 1 %.
    pub white: bool,
}

/// What the residual is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Input {
    /// Velocity.
    Velocity,
    /// Acceleration, from positions.
    Acceleration,
    /// Predicted torque.
    Torque,
    /// Position.
    Position,
}

impl Input {
    /// The field's symbol, such as `q̇`.
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Velocity => "q̇",
            Self::Acceleration => "q̈",
            Self::Torque => "τ",
            Self::Position => "q",
        }
    }
}

/// Whether the residual is independent of an input.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Independence {
    /// Which input.
    pub input: Input,
    /// Cross-correlation; at negative lags the input answers the residual, which control does and no model is to blame for.
    pub correlation: Vec<Correlation>,
    /// Probability of a correlation as large at any lag ≥ 0 without dependence.
    pub p: f64,
    /// Whether it is independent as far as one can tell: p ≥ 1 %.
    pub independent: bool,
}

impl Independence {
    /// Share of the residual's variance that follows the input, at the lag at which it follows it best.
    pub fn share(&self) -> f64 {
        let after = self.correlation.iter().filter(|c| c.lag >= 0.0);
        after.map(|c| c.value * c.value).fold(0.0, f64::max)
    }
}

/// Mean time from one window to the next, s.
pub(super) fn window(t: &[f64], runs: &Runs) -> f64 {
    let steps = runs.0.iter().filter(|run| run.len() > 1);
    let (sum, count) = steps.fold((0.0, 0), |(sum, count), run| {
        (sum + t[run.end - 1] - t[run.start], count + run.len() - 1)
    });
    sum / count.max(1) as f64
}

/// Tests for whiteness; none for fewer than 50 windows after decimation.
pub(super) fn whiteness(series: &Series, runs: &Runs) -> Option<Whiteness> {
    let (indices, runs_left) = runs.decimated(DECIMATION);
    let n = indices.len();
    if n < LEAST {
        return None;
    }
    let e: Vec<f64> = indices.iter().map(|&k| series.residual[k]).collect();
    let e = centred(&e);
    let e2: Vec<f64> = e.iter().map(|e| e * e).collect();
    let variance = square(&e);
    let step = DECIMATION as f64 * window(series.t, runs);
    let mut statistic = 0.0;
    let mut autocorrelation = Vec::new();
    for lag in 1..=LAGS.min(n / 10) {
        let (product, pairs) = runs_left.product(&e, &e, lag);
        let (spread, _) = runs_left.product(&e2, &e2, lag);
        if pairs < LEAST / 2 || spread <= 0.0 {
            break;
        }
        // Ljung and Box's correction for short series.
        statistic += (n + 2) as f64 / n as f64 * product * product / spread;
        autocorrelation.push(Correlation {
            lag: step * lag as f64,
            value: product / variance,
            band: BAND * spread.sqrt() / variance,
        });
    }
    let freedom = autocorrelation.len();
    let p = ChiSquared::new(freedom as f64).ok()?.sf(statistic);
    Some(Whiteness {
        autocorrelation,
        statistic,
        freedom,
        p,
        white: p >= LEVEL,
    })
}

/// Autocovariance sums Σ e(t) e(t+k) up to where they have died away, tapered: lag 0 first.
///
/// The cut is Politis' (2003) rule: twice the smallest lag after which five in a row are insignificant; the window is his flat-top.
pub(super) fn tapered(e: &[f64], runs: &Runs) -> Vec<f64> {
    const LONGEST: usize = 100;
    const QUIET: usize = 5;
    let n = e.len() as f64;
    let variance = square(e);
    let threshold = 2.0 * (n.max(10.0).log10() / n).sqrt() * variance;
    let mut sums = vec![variance];
    let mut quiet = 0;
    while quiet < QUIET && sums.len() <= LONGEST {
        let (product, _) = runs.product(e, e, sums.len());
        quiet = if product.abs() < threshold {
            quiet + 1
        } else {
            0
        };
        sums.push(product);
    }
    let last = 2 * (sums.len() - 1 - quiet);
    for lag in sums.len()..=last {
        sums.push(runs.product(e, e, lag).0);
    }
    sums.truncate(last + 1);
    for (lag, sum) in sums.iter_mut().enumerate().skip(last / 2 + 1) {
        *sum *= 2.0 * (1.0 - lag as f64 / last as f64);
    }
    sums
}

/// Tests for independence of each input that changes; none for fewer than 50 windows.
pub(super) fn independence(series: &Series, runs: &Runs) -> Vec<Independence> {
    if series.t.len() < LEAST {
        return Vec::new();
    }
    let e = centred(series.residual);
    let sums = tapered(&e, runs);
    let step = window(series.t, runs);
    let inputs = [
        (Input::Velocity, series.dq.to_vec()),
        (Input::Acceleration, series.acceleration(runs)),
        (Input::Torque, series.predicted()),
        (Input::Position, series.q.to_vec()),
    ];
    let test = |(input, values): &(Input, Vec<f64>)| {
        of_input(*input, &centred(values), &e, &sums, runs, step)
    };
    inputs.iter().filter_map(test).collect()
}

/// The variance of Σ e(t) u(t − τ) is at least this share of what white noise would give: over-differenced noise could
/// make the estimate negative.
const LEAST_VARIANCE: f64 = 0.05;

fn of_input(
    input: Input,
    u: &[f64],
    e: &[f64],
    residual: &[f64],
    runs: &Runs,
    step: f64,
) -> Option<Independence> {
    let n = u.len() as f64;
    let norm = (residual[0] * square(u)).sqrt();
    if norm <= 0.0 {
        return None;
    }
    let reach = residual.len() + CROSS_LAGS;
    let inputs: Vec<f64> = (0..=reach).map(|lag| runs.product(u, u, lag).0).collect();
    // Covariance of the sums at two lags that lie `apart`.
    let covariance = |apart: usize| {
        let at = |k: isize| inputs[(k + apart as isize).unsigned_abs()];
        let sides = (1..residual.len() as isize).map(|k| residual[k as usize] * (at(k) + at(-k)));
        (residual[0] * at(0) + sides.sum::<f64>()) / n
    };
    let white = residual[0] * inputs[0] / n;
    let variance = covariance(0).max(LEAST_VARIANCE * white);
    let mut largest: f64 = 0.0;
    let mut correlation = Vec::new();
    for lag in -(CROSS_LAGS as isize)..=CROSS_LAGS as isize {
        let (first, second) = if lag >= 0 { (u, e) } else { (e, u) };
        let (product, pairs) = runs.product(first, second, lag.unsigned_abs());
        let std = (variance * pairs as f64 / n).sqrt();
        if lag >= 0 && std > 0.0 {
            largest = largest.max(product.abs() / std);
        }
        correlation.push(Correlation {
            lag: step * lag as f64,
            value: product / norm,
            band: BAND * std / norm,
        });
    }
    let shared: Vec<f64> = (0..=CROSS_LAGS)
        .map(|lag| covariance(lag) / variance)
        .collect();
    let p = (2.0 * Normal::standard().sf(largest) * independent_lags(&shared)).min(1.0);
    Some(Independence {
        input,
        correlation,
        p,
        independent: p >= LEVEL,
    })
}

/// How many independent tests the lags 0 to [`CROSS_LAGS`] amount to, from their correlation at each distance: Nyholt (2004),
/// 1 + (m − 1)(1 − Var(λ)/m) with λ the eigenvalues of the correlation matrix, whose squares sum up to those of its entries.
fn independent_lags(correlation: &[f64]) -> f64 {
    let m = correlation.len() as f64;
    let entries = correlation.iter().enumerate().map(|(apart, c)| {
        let times = if apart == 0 {
            m
        } else {
            2.0 * (m - apart as f64)
        };
        times * c.clamp(-1.0, 1.0).powi(2)
    });
    let variance = (entries.sum::<f64>() - m) / (m - 1.0);
    (1.0 + (m - 1.0) * (1.0 - variance / m)).clamp(1.0, m)
}
