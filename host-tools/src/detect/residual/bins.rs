//! The residual binned by a variable.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

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
    /// Probability that all means differ as much by chance; none where bins are too few or too short to say.
    pub(super) p: Option<f64>,
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
    let mut p = None;
    if !upper.is_empty() {
        let variances = errors(&mut bins, &of, residual, runs);
        p = all_alike(&bins, &variances);
    }
    bins.retain(|bin| bin.n > 0);
    if upper.is_empty() {
        bins.clear();
    }
    Binned { bins, of, p }
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

/// Standard errors of the bins' means: ratio estimates over batches. Returns the variances of means by the number of windows and their correlation time,
/// with that number of independent ones.
fn errors(bins: &mut [Bin], of: &[Option<usize>], residual: &[f64], runs: &Runs) -> Vec<[f64; 2]> {
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
    let independent = |b: usize| bins[b].n as f64 / time;
    (0..bins.len())
        .map(|b| {
            let variance = squares[b] / bins[b].n.max(1) as f64;
            [variance / independent(b), independent(b)]
        })
        .collect()
}

/// Fewer independent windows in a bin than this say nothing of its variance.
const LEAST_INDEPENDENT: f64 = 3.0;

/// Welch's analysis of variance (1951): whether all means are alike, of bins whose noise differs. A mean's variance is the larger of the two that are
/// known: by the residual's correlation time, and by the spread over batches. A single bin's error needs several batches in it, and a short log
/// has few: all bins together tell a pattern that each of them leaves open.
fn all_alike(bins: &[Bin], variances: &[[f64; 2]]) -> Option<f64> {
    let known = bins.iter().zip(variances);
    let known: Vec<(f64, f64, f64)> = known
        .filter(|(_, [_, independent])| *independent >= LEAST_INDEPENDENT)
        .map(|(bin, [variance, independent])| {
            let batches = bin.std_error.map_or(0.0, |std| std * std);
            (bin.mean, variance.max(batches), *independent)
        })
        .filter(|(_, variance, _)| *variance > 0.0)
        .collect();
    let k = known.len() as f64;
    if k < 3.0 {
        return None;
    }
    let total: f64 = known.iter().map(|(_, variance, _)| 1.0 / variance).sum();
    let weighted = known.iter().map(|(mean, variance, _)| mean / variance);
    let mean = weighted.sum::<f64>() / total;
    let between = known
        .iter()
        .map(|(own, variance, _)| (own - mean).powi(2) / variance);
    let spread: f64 = known
        .iter()
        .map(|(_, variance, n)| (1.0 - 1.0 / (variance * total)).powi(2) / (n - 1.0))
        .sum();
    let corrected = 1.0 + 2.0 * (k - 2.0) / (k * k - 1.0) * spread;
    let statistic = between.sum::<f64>() / (k - 1.0) / corrected;
    let freedom = (k * k - 1.0) / (3.0 * spread);
    Some(FisherSnedecor::new(k - 1.0, freedom).ok()?.sf(statistic))
}
