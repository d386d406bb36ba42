//! Which patterns of the residual are real.
//!
//! For each variable the residual is fitted by each named [`Shape`], by each bin on its own and by all bins together, with errors that survive
//! autocorrelation; a variable's probability is the least of them times their number (Bonferroni). Over all variables and joints
//! the false discovery rate is held at 1 % (Benjamini and Hochberg 1995).

use serde::Serialize;

use super::bins::{Bin, Binned, bin};
use super::cluster::{self, Fit};
use super::series::{Runs, square};
use super::shape::{Shape, Variable, Variables};

/// Expected share of patterns told that are not real.
pub const FALSE_DISCOVERY: f64 = 0.01;

/// The residual against one variable.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Where {
    /// Which variable.
    pub variable: Variable,
    /// The residual in bins of it; empty where it does not change.
    pub bins: Vec<Bin>,
    /// Probability of a pattern as strong where there is none, the shapes and bins tried taken into account.
    pub p: f64,
    /// Whether the pattern is real, with the false discovery rate over all joints and variables held at 1 %.
    pub significant: bool,
    /// The named shape that fits best; none if none fits, or if bins show much that it does not.
    pub shape: Option<Shape>,
    /// Size of that shape, N m per unit of it, and its standard error.
    pub size: Option<[f64; 2]>,
    /// Share of the residual's variance that the pattern explains.
    pub share: f64,
    /// Other named shapes in this variable that fit almost as well.
    pub alternatives: Vec<Shape>,
    /// The variable of the told pattern that explains this one: variables of a moving joint go together.
    pub echo_of: Option<Variable>,
}

/// A shape's share must be this much of the bins' own to describe the pattern.
const DESCRIBES: f64 = 0.5;

/// A shape with this share of the best one's fits almost as well.
pub(super) const ALMOST: f64 = 0.9;

/// The residual against all variables, before the false discovery rate is controlled.
pub(super) fn everywhere(residual: &[f64], runs: &Runs, variables: &Variables) -> Vec<Where> {
    let known = variables.known().into_iter();
    known
        .map(|variable| against(variable, residual, &[], runs, variables))
        .collect()
}

/// The residual against one variable, beside patterns already `taken` out of it (orthonormal).
pub(super) fn against(
    variable: Variable,
    residual: &[f64],
    taken: &[Vec<f64>],
    runs: &Runs,
    variables: &Variables,
) -> Where {
    if variable == Variable::Constant {
        let fit = cluster::mean(residual, runs).map(|fit| (Shape::Offset, fit));
        let p = fit.map_or(1.0, |(_, fit)| fit.p);
        return judged(variable, Vec::new(), p, &Vec::from_iter(fit), 0.0);
    }
    let binned = bin(&variables.values(variable), residual, runs);
    let (mut fits, tests) = variables.fits(variable, residual, taken, runs);
    let mut alone = each_bin(&binned, residual, runs);
    alone.extend(binned.p);
    let tests = (tests + alone.len()) as f64;
    let least = fits
        .iter()
        .map(|(_, fit)| fit.p)
        .chain(alone)
        .fold(f64::NAN, f64::min);
    let p = if least.is_nan() {
        1.0
    } else {
        (least * tests).min(1.0)
    };
    fits.retain(|(_, fit)| fit.p * tests < FALSE_DISCOVERY);
    fits.sort_by(|(_, a), (_, b)| b.share.total_cmp(&a.share));
    let in_bins = share_of_bins(&binned, residual);
    judged(variable, binned.bins, p, &fits, in_bins)
}

/// The best of `fits`, the largest first, if it describes what the bins show.
fn judged(
    variable: Variable,
    bins: Vec<Bin>,
    p: f64,
    fits: &[(Shape, Fit)],
    in_bins: f64,
) -> Where {
    let best = fits
        .first()
        .filter(|(_, fit)| fit.share >= DESCRIBES * in_bins);
    let almost = |share: f64| best.is_some_and(|(_, best)| share >= ALMOST * best.share);
    let others = fits
        .iter()
        .skip(1)
        .filter(|(shape, fit)| almost(fit.share) && !shape.is_searched());
    Where {
        variable,
        bins,
        p,
        significant: false,
        shape: best.map(|(shape, _)| *shape),
        size: best.map(|(_, fit)| [fit.slope, fit.std]),
        share: best.map_or(in_bins, |(_, fit)| fit.share),
        alternatives: others.map(|(shape, _)| *shape).collect(),
        echo_of: None,
    }
}

impl Shape {
    /// Whether it is the best of a search: others that fit as well are neighbours of it.
    pub(super) fn is_searched(self) -> bool {
        matches!(self, Self::Periodic { .. } | Self::Change { .. })
    }
}

/// Probability that each bin's mean differs as much from the others' by chance.
fn each_bin(binned: &Binned, residual: &[f64], runs: &Runs) -> Vec<f64> {
    let inside = |bin: usize| -> Vec<f64> {
        let of = binned.of.iter();
        of.map(|of| of.map_or(f64::NAN, |of| f64::from(u8::from(of == bin))))
            .collect()
    };
    // Two bins are one comparison.
    let count = binned.bins.len();
    let compared = if count == 2 { 1 } else { count };
    (0..compared)
        .filter_map(|bin| Some(cluster::fit(&inside(bin), residual, runs)?.p))
        .collect()
}

/// Share of the residual's variance between bins, less what noise would give.
fn share_of_bins(binned: &Binned, residual: &[f64]) -> f64 {
    let n: f64 = binned.bins.iter().map(|bin| bin.n as f64).sum();
    let mean = binned
        .bins
        .iter()
        .map(|bin| bin.n as f64 * bin.mean)
        .sum::<f64>()
        / n.max(1.0);
    let excess = binned.bins.iter().map(|bin| {
        let noise = bin.std_error.unwrap_or(0.0);
        bin.n as f64 * ((bin.mean - mean).powi(2) - noise * noise)
    });
    let known = binned
        .of
        .iter()
        .zip(residual)
        .filter(|(of, _)| of.is_some());
    let left: Vec<f64> = known.map(|(_, e)| e - mean).collect();
    let total = square(&left);
    if total > 0.0 {
        (excess.sum::<f64>() / total).max(0.0)
    } else {
        0.0
    }
}

/// Marks what is real over all joints (Benjamini and Hochberg).
pub(super) fn control(joints: &mut [Vec<Where>]) {
    let mut ps: Vec<f64> = joints.iter().flat_map(|w| w.iter().map(|w| w.p)).collect();
    ps.sort_by(f64::total_cmp);
    let count = ps.len() as f64;
    let passes = |(rank, p): (usize, &f64)| {
        (*p <= FALSE_DISCOVERY * (rank + 1) as f64 / count).then_some(*p)
    };
    let threshold = ps.iter().enumerate().filter_map(passes).next_back();
    for pattern in joints.iter_mut().flat_map(|patterns| patterns.iter_mut()) {
        pattern.significant = threshold.is_some_and(|threshold| pattern.p <= threshold);
    }
}
