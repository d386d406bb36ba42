//! Regression whose errors survive autocorrelation.
//!
//! The residual's neighbours are alike, so that n windows are worth far fewer. Errors therefore come from the spread over
//! batches of windows that are longer than the residual's memory (Bester, Conley and Hansen 2011): the batch is five
//! correlation times, which are summed up to the window that Sokal (1997) chooses. Batches are few and unequal, hence the
//! jackknife form of the variance and Student's distribution with the effective number of batches (Carter, Schnepel and
//! Steigerwald 2017).

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::series::{Runs, centred, square};

/// A slope of the residual against something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// Residual per unit, an offset apart.
    pub(super) slope: f64,
    /// Its standard error.
    pub(super) std: f64,
    /// Probability of a slope as large where there is none.
    pub(super) p: f64,
    /// Share of the residual's variance that it explains.
    pub(super) share: f64,
}

/// Fewer effective batches than this carry no error.
const LEAST_BATCHES: f64 = 3.0;

/// Batches are at most this share of the series.
const MOST_SHARE: f64 = 1.0 / 8.0;

/// The fit of `residual` to `x`, each less its mean; NaN in `x` leaves a window out. None where `x` does not change, or
/// changes in too few batches.
pub(super) fn fit(x: &[f64], residual: &[f64], runs: &Runs) -> Option<Fit> {
    let masked: Vec<f64> = residual
        .iter()
        .zip(x)
        .map(|(e, x)| if x.is_finite() { *e } else { f64::NAN })
        .collect();
    slope(&centred(x), &centred(&masked), runs)
}

/// The mean of `residual` as the slope against 1.
pub(super) fn mean(residual: &[f64], runs: &Runs) -> Option<Fit> {
    slope(&vec![1.0; residual.len()], residual, runs)
}

fn slope(x: &[f64], e: &[f64], runs: &Runs) -> Option<Fit> {
    let (xx, ee) = (square(x), square(e));
    if xx <= 1e-12 * x.len() as f64 * x.iter().fold(0.0, |m: f64, x| m.max(x * x)) || ee <= 0.0 {
        return None;
    }
    let slope = x.iter().zip(e).map(|(x, e)| x * e).sum::<f64>() / xx;
    let left: Vec<f64> = x.iter().zip(e).map(|(x, e)| e - slope * x).collect();
    let batches = batches(&left, runs);
    let count = batches.last()? + 1;
    let mut leverage = vec![0.0; count];
    let mut score = vec![0.0; count];
    for (k, &batch) in batches.iter().enumerate() {
        leverage[batch] += x[k] * x[k] / xx;
        score[batch] += x[k] * left[k] / xx;
    }
    let effective = 1.0 / square(&leverage);
    if effective < LEAST_BATCHES {
        return None;
    }
    let squares = leverage
        .iter()
        .zip(&score)
        .map(|(h, s)| (s / (1.0 - h)).powi(2));
    let std = (squares.sum::<f64>() * (1.0 - 1.0 / effective)).sqrt();
    let student = StudentsT::new(0.0, 1.0, effective - 1.0).ok()?;
    Some(Fit {
        slope,
        std,
        p: 2.0 * student.sf(slope.abs() / std.max(f64::MIN_POSITIVE)),
        share: slope * slope * xx / ee,
    })
}

/// The batch that each window belongs to, counted from 0.
pub(super) fn batches(e: &[f64], runs: &Runs) -> Vec<usize> {
    let most = ((e.len() as f64 * MOST_SHARE) as usize).max(1);
    let length = ((5.0 * correlation_time(e, runs)).ceil() as usize).clamp(5.min(most), most);
    let mut batches = Vec::with_capacity(e.len());
    let (mut batch, mut held) = (0, 0);
    for run in &runs.0 {
        // A gap ends a batch unless it has hardly begun.
        if 2 * held >= length {
            (batch, held) = (batch + 1, 0);
        }
        for _ in run.clone() {
            if held == length {
                (batch, held) = (batch + 1, 0);
            }
            batches.push(batch);
            held += 1;
        }
    }
    batches
}

/// How many windows one independent value is worth, 1 or more.
pub(super) fn correlation_time(e: &[f64], runs: &Runs) -> f64 {
    let variance = square(e);
    let mut time = 1.0;
    let mut lag = 1;
    while (lag as f64) < 5.0 * time && lag < e.len() / 10 && variance > 0.0 {
        time += 2.0 * runs.product(e, e, lag).0 / variance;
        lag += 1;
    }
    time.max(1.0)
}
