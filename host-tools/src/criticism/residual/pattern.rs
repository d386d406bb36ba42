//! Which patterns of the residual are real, and what they look like.
//!
//! For each variable the residual is fitted by each named [`Shape`] and by each bin on its own, with errors that survive
//! autocorrelation; a variable's probability is the least of them times their number (Bonferroni). Over all variables and joints
//! the false discovery rate is held at 1 % (Benjamini and Hochberg 1995). A real pattern that is gone once stronger ones are
//! taken out only echoes them: variables of a moving joint go together.

use serde::Serialize;

use super::bins::{Bin, Binned, bin};
use super::cluster::{self, Fit};
use super::series::{Runs, Series, square};
use super::shape::{Shape, Variable, Variables};
use super::words;

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
    /// Size of the best shape, N m per unit of it, and its standard error.
    pub size: Option<[f64; 2]>,
    /// Share of the residual's variance that the pattern explains.
    pub share: f64,
    /// Other named shapes in this variable that fit almost as well.
    pub alternatives: Vec<Shape>,
    /// The stronger pattern that this one goes away with.
    pub echo_of: Option<Variable>,
    /// What the pattern looks like, in words; none unless it is real and no echo.
    pub sentence: Option<String>,
}

/// A shape's share must be this much of the bins' own to describe the pattern.
const DESCRIBES: f64 = 0.5;

/// A shape with this share of the best one's fits almost as well.
const ALMOST: f64 = 0.9;

/// All patterns of a joint, before the false discovery rate is controlled.
pub(super) fn patterns(series: &Series, runs: &Runs, variables: &Variables) -> Vec<Where> {
    let mut all = vec![constant(series, runs)];
    let of = |&variable: &Variable| against(variable, series.residual, runs, variables);
    all.extend(variables.known().iter().map(of));
    all
}

fn constant(series: &Series, runs: &Runs) -> Where {
    let fit = cluster::mean(series.residual, runs);
    Where {
        variable: Variable::Constant,
        bins: Vec::new(),
        p: fit.map_or(1.0, |fit| fit.p),
        significant: false,
        shape: Some(Shape::Offset),
        size: fit.map(|fit| [fit.slope, fit.std]),
        share: fit.map_or(0.0, |fit| fit.share),
        alternatives: Vec::new(),
        echo_of: None,
        sentence: None,
    }
}

fn against(variable: Variable, residual: &[f64], runs: &Runs, variables: &Variables) -> Where {
    let values = variables.values(variable);
    let binned = bin(&values, residual, runs);
    let shapes = variables.shapes(variable);
    let mut fits: Vec<(Shape, Fit)> = shapes
        .iter()
        .filter_map(|&shape| {
            Some((
                shape,
                cluster::fit(&variables.pattern(shape), residual, runs)?,
            ))
        })
        .collect();
    let alone = each_bin(&binned, residual, runs);
    let tests = (fits.len() + alone.len()) as f64;
    let least = fits
        .iter()
        .map(|(_, fit)| fit.p)
        .chain(alone)
        .fold(1.0, f64::min);
    fits.retain(|(_, fit)| fit.p * tests < FALSE_DISCOVERY);
    fits.sort_by(|(_, a), (_, b)| b.share.total_cmp(&a.share));
    let in_bins = share_of_bins(&binned, residual);
    let best = fits
        .first()
        .filter(|(_, fit)| fit.share >= DESCRIBES * in_bins)
        .copied();
    let almost = |share: f64| best.is_some_and(|(_, best)| share >= ALMOST * best.share);
    let others = fits
        .iter()
        .skip(1)
        .filter(|(shape, fit)| almost(fit.share) && !shape.is_periodic());
    Where {
        variable,
        p: (least * tests).min(1.0),
        significant: false,
        shape: best.map(|(shape, _)| shape),
        size: best.map(|(_, fit)| [fit.slope, fit.std]),
        share: best.map_or(in_bins, |(_, fit)| fit.share),
        alternatives: others.map(|(shape, _)| *shape).collect(),
        echo_of: None,
        sentence: None,
        bins: binned.bins,
    }
}

impl Shape {
    fn is_periodic(self) -> bool {
        matches!(self, Self::Periodic { .. })
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
pub(super) fn control(joints: &mut [&mut Vec<Where>]) {
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

/// Sorts out echoes among a joint's real patterns, and puts the others into words, strongest first.
pub(super) fn explain(patterns: &mut [Where], series: &Series, runs: &Runs, variables: &Variables) {
    let mut left = series.residual.to_vec();
    let mut order: Vec<usize> = (0..patterns.len())
        .filter(|&i| patterns[i].significant)
        .collect();
    order.sort_by(|&a, &b| patterns[b].share.total_cmp(&patterns[a].share));
    let mut told: Vec<Variable> = Vec::new();
    for i in order {
        let pattern = &mut patterns[i];
        let variable = pattern.variable;
        if let Some(&strongest) = told.first() {
            let rest = again(variable, &left, runs, variables);
            // As many tests as there are variables.
            if rest.p * variables.known().len() as f64 > FALSE_DISCOVERY {
                pattern.echo_of = Some(strongest);
                continue;
            }
            // What it looks like, and how large it is, with the stronger ones gone.
            (pattern.shape, pattern.size) = (rest.shape, rest.size);
            (pattern.alternatives, pattern.share) = (rest.alternatives.clone(), rest.share);
            remove(&mut left, &rest, variables);
            pattern.sentence = Some(words::sentence(series.joint, &rest, variables));
        } else {
            remove(&mut left, pattern, variables);
            pattern.sentence = Some(words::sentence(series.joint, pattern, variables));
        }
        told.push(variable);
    }
}

fn again(variable: Variable, left: &[f64], runs: &Runs, variables: &Variables) -> Where {
    if variable == Variable::Constant {
        let offset = cluster::mean(left, runs);
        return Where {
            variable,
            bins: Vec::new(),
            p: offset.map_or(1.0, |fit| fit.p),
            significant: true,
            shape: Some(Shape::Offset),
            size: offset.map(|fit| [fit.slope, fit.std]),
            share: offset.map_or(0.0, |fit| fit.share),
            alternatives: Vec::new(),
            echo_of: None,
            sentence: None,
        };
    }
    against(variable, left, runs, variables)
}

/// Takes a pattern out of the residual: its shape, or its bins' means.
fn remove(left: &mut [f64], pattern: &Where, variables: &Variables) {
    let values = variables.values(pattern.variable);
    match (pattern.shape, pattern.size) {
        (Some(shape), Some([size, _])) => {
            let pattern = variables.pattern(shape);
            for (e, x) in left.iter_mut().zip(pattern) {
                *e -= if x.is_finite() { size * x } else { 0.0 };
            }
        }
        _ => {
            for (e, x) in left.iter_mut().zip(values) {
                let bin = pattern.bins.iter().find(|bin| x <= bin.to);
                *e -= bin.filter(|_| x.is_finite()).map_or(0.0, |bin| bin.mean);
            }
        }
    }
}
