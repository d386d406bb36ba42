//! The residual binned by a variable.

use serde::Serialize;

use super::cluster::{batches, correlation_time};
use super::series::{Runs, square};

/// Bins of a variable, by quantiles.
const BINS: usize = 8;

/// Windows from which quantiles are taken.
const SAMPLED: usize = 8000;

/// The mean residual within a range of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bin {
    /// Least value of the variable in the bin, in the variable's unit.
    pub from: f64,
    /// Greatest value in it.
    pub to: f64,
    /// Mean value in it.
    pub centre: f64,
    /// Windows.
    pub n: usize,
    /// Mean residual, N m.
    pub mean: f64,
    /// Its standard error, from the spread over batches longer than the residual's memory, N m; none for one batch.
    pub std_error: Option<f64>,
    /// How many independent windows the bin is worth.
    pub effective_n: f64,
}

/// A variable cut into bins.
#[derive(Debug, Clone)]
pub(super) struct Binned {
    pub(super) bins: Vec<Bin>,
    /// The bin of each window; none where the variable is not known.
    pub(super) of: Vec<Option<usize>>,
}

/// Cuts `x` into bins of equally many windows; fewer where values are equal. No bins where `x` does not change.
pub(super) fn bin(x: &[f64], residual: &[f64], runs: &Runs) -> Binned {
    let upper = edges(x);
    let place = |&x: &f64| {
        x.is_finite()
            .then(|| upper.partition_point(|&edge| edge < x))
    };
    let of: Vec<Option<usize>> = x.iter().map(place).collect();
    let mut bins = vec![
        Bin {
            from: f64::INFINITY,
            to: f64::NEG_INFINITY,
            centre: 0.0,
            n: 0,
            mean: 0.0,
            std_error: None,
            effective_n: 0.0,
        };
        upper.len() + 1
    ];
    for (k, bin) in of.iter().enumerate() {
        if let Some(bin) = bin.map(|bin| &mut bins[bin]) {
            bin.n += 1;
            bin.from = bin.from.min(x[k]);
            bin.to = bin.to.max(x[k]);
            bin.centre += x[k];
            bin.mean += residual[k];
        }
    }
    for bin in &mut bins {
        bin.centre /= bin.n.max(1) as f64;
        bin.mean /= bin.n.max(1) as f64;
    }
    if !upper.is_empty() {
        errors(&mut bins, &of, residual, runs);
    }
    bins.retain(|bin| bin.n > 0);
    if upper.is_empty() {
        bins.clear();
    }
    Binned { bins, of }
}

/// Greatest values of all bins but the last.
fn edges(x: &[f64]) -> Vec<f64> {
    let stride = x.len() / SAMPLED + 1;
    let mut sorted: Vec<f64> = x
        .iter()
        .step_by(stride)
        .copied()
        .filter(|x| x.is_finite())
        .collect();
    sorted.sort_by(f64::total_cmp);
    let Some((&least, &greatest)) = sorted.first().zip(sorted.last()) else {
        return Vec::new();
    };
    let mut edges: Vec<f64> = (1..BINS)
        .map(|i| sorted[i * (sorted.len() - 1) / BINS])
        .collect();
    edges.dedup();
    edges.retain(|&edge| edge >= least && edge < greatest);
    edges
}

/// Standard errors of the bins' means: ratio estimates over batches.
fn errors(bins: &mut [Bin], of: &[Option<usize>], residual: &[f64], runs: &Runs) {
    let left: Vec<f64> = residual
        .iter()
        .zip(of)
        .map(|(e, bin)| bin.map_or(0.0, |bin| e - bins[bin].mean))
        .collect();
    let batches = batches(&left, runs);
    let count = batches.last().map_or(0, |last| last + 1);
    let mut sums = vec![[0.0; 2]; count * bins.len()];
    let mut squares = vec![0.0; bins.len()];
    for (k, bin) in of.iter().enumerate() {
        if let Some(bin) = *bin {
            let sum = &mut sums[batches[k] * bins.len() + bin];
            sum[0] += left[k];
            sum[1] += 1.0;
            squares[bin] += left[k] * left[k];
        }
    }
    let time = correlation_time(&left, runs);
    for b in 0..bins.len() {
        let column = || {
            (0..count)
                .map(|batch| sums[batch * bins.len() + b])
                .filter(|s| s[1] > 0.0)
        };
        let visited = column().count() as f64;
        let n = bins[b].n as f64;
        let spread = square(&column().map(|sum| sum[0]).collect::<Vec<_>>());
        bins[b].effective_n = n / time;
        if visited >= 2.0 {
            let variance = spread * visited / (visited - 1.0) / (n * n);
            bins[b].std_error = Some(variance.sqrt());
            if variance > 0.0 {
                bins[b].effective_n = (squares[b] / n / variance).min(n);
            }
        }
    }
}
