//! Real patterns, told apart and put into words.
//!
//! The strongest pattern is taken out of the residual, then the strongest of what is left, and so on; all those taken are
//! fitted together each time. Of the real patterns, those that are never taken are echoes of the ones that are. Nothing here
//! names an effect: a shape and what it looks like, with the other shapes that would do almost as well.

use serde::Serialize;

use super::cluster;
use super::pattern::{ALMOST, FALSE_DISCOVERY, Where, against};
use super::series::{Runs, centred, square};
use super::shape::{Shape, Variable, Variables};
use super::words;

/// A real pattern of the residual.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Pattern {
    /// In which variable.
    pub variable: Variable,
    /// The named shape that describes it, if one does.
    pub shape: Option<Shape>,
    /// Its size with the other patterns fitted too, N m per unit of the shape, and its standard error.
    pub size: Option<[f64; 2]>,
    /// Share of the residual's mean square that it explained when it was found.
    pub share: f64,
    /// Other shapes that fit almost as well.
    pub alternatives: Vec<Shape>,
    /// What it looks like, in words.
    pub sentence: String,
}

/// A pattern that has been taken out of the residual.
struct Term {
    found: Where,
    x: Vec<f64>,
    size: f64,
}

/// Patterns told at most.
const MOST: usize = 6;

/// Rounds in which the sizes of all terms are fitted one after the other.
const ROUNDS: usize = 20;

/// The real patterns of a joint, strongest first; marks the echoes among `everywhere`.
pub(super) fn explain(
    joint: &str,
    residual: &[f64],
    runs: &Runs,
    variables: &Variables,
    everywhere: &mut [Where],
) -> Vec<Pattern> {
    let real = everywhere.iter().filter(|w| w.significant);
    let real: Vec<Variable> = real.map(|w| w.variable).collect();
    let mut terms: Vec<Term> = Vec::new();
    while terms.len() < MOST {
        let left = less(residual, &terms);
        let Some(found) = strongest(&real, &left, residual, runs, variables) else {
            break;
        };
        if terms
            .iter()
            .any(|t| (t.found.variable, t.found.shape) == (found.variable, found.shape))
        {
            break;
        }
        terms.push(Term::new(found, variables));
        fit_together(&mut terms, residual);
    }
    drop_idle(&mut terms, residual, runs, everywhere.len());
    mark_echoes(everywhere, &terms, variables);
    let tell = |term: &Term| term.told(joint, &less(residual, &terms), runs, variables);
    terms.iter().map(tell).collect()
}

impl Term {
    fn new(found: Where, variables: &Variables) -> Self {
        let x = vector(&found, variables);
        let size = found.size.map_or(1.0, |[size, _]| size);
        Self { found, x, size }
    }

    /// The residual with this pattern put back.
    fn alone(&self, left: &[f64]) -> Vec<f64> {
        left.iter()
            .zip(&self.x)
            .map(|(e, x)| e + self.size * x)
            .collect()
    }

    fn fit(&self, left: &[f64], runs: &Runs) -> Option<cluster::Fit> {
        let alone = self.alone(left);
        if self.found.variable == Variable::Constant {
            cluster::mean(&alone, runs)
        } else {
            cluster::fit(&self.x, &alone, runs)
        }
    }

    fn told(&self, joint: &str, left: &[f64], runs: &Runs, variables: &Variables) -> Pattern {
        let size = self.fit(left, runs).map(|fit| [fit.slope, fit.std]);
        let found = Where {
            size: size.filter(|_| self.found.shape.is_some()),
            ..self.found.clone()
        };
        Pattern {
            variable: found.variable,
            shape: found.shape,
            size: found.size,
            share: found.share,
            sentence: words::sentence(joint, &found, variables),
            alternatives: found.alternatives,
        }
    }
}

/// A pattern's values: its shape less the mean, or its bins' means.
fn vector(found: &Where, variables: &Variables) -> Vec<f64> {
    match found.shape {
        Some(Shape::Offset) => variables.pattern(Shape::Offset),
        Some(shape) => centred(&variables.pattern(shape)),
        None => {
            let mean = |x: &f64| {
                let bin = found.bins.iter().find(|bin| *x <= bin.to);
                bin.map_or(f64::NAN, |bin| bin.mean)
            };
            centred(
                &variables
                    .values(found.variable)
                    .iter()
                    .map(mean)
                    .collect::<Vec<_>>(),
            )
        }
    }
}

fn less(residual: &[f64], terms: &[Term]) -> Vec<f64> {
    let mut left = residual.to_vec();
    for term in terms {
        for (e, x) in left.iter_mut().zip(&term.x) {
            *e -= term.size * x;
        }
    }
    left
}

/// The strongest pattern of what is left that is beyond chance, with its rivals.
fn strongest(
    real: &[Variable],
    left: &[f64],
    residual: &[f64],
    runs: &Runs,
    variables: &Variables,
) -> Option<Where> {
    let found = real
        .iter()
        .map(|&variable| against(variable, left, runs, variables));
    let beyond = |w: &Where| w.p * real.len() as f64 <= FALSE_DISCOVERY;
    let mut found: Vec<Where> = found.filter(beyond).collect();
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    let (best, others) = found.split_first()?;
    let rivals = others
        .iter()
        .filter(|w| w.share >= ALMOST * best.share && best.variable != Variable::Constant);
    let rivals = rivals
        .filter_map(|w| w.shape)
        .filter(|shape| !shape.is_periodic());
    Some(Where {
        alternatives: best.alternatives.iter().copied().chain(rivals).collect(),
        share: best.share * square(left) / square(residual),
        ..best.clone()
    })
}

/// Least squares of all terms' sizes together, by going round.
fn fit_together(terms: &mut [Term], residual: &[f64]) {
    let mut left = less(residual, terms);
    for _ in 0..ROUNDS {
        for term in terms.iter_mut() {
            let product: f64 = left.iter().zip(&term.x).map(|(e, x)| e * x).sum();
            let change = product / square(&term.x).max(f64::MIN_POSITIVE);
            for (e, x) in left.iter_mut().zip(&term.x) {
                *e -= change * x;
            }
            term.size += change;
        }
    }
}

/// Drops terms that later ones have made idle.
fn drop_idle(terms: &mut Vec<Term>, residual: &[f64], runs: &Runs, tests: usize) {
    let mut i = 0;
    while i < terms.len() && terms.len() > 1 {
        let left = less(residual, terms);
        let idle = terms[i]
            .fit(&left, runs)
            .is_none_or(|fit| fit.p * tests as f64 > FALSE_DISCOVERY);
        if idle {
            terms.remove(i);
            fit_together(terms, residual);
        } else {
            i += 1;
        }
    }
}

/// An echo goes with the term whose values are most like its own.
fn mark_echoes(everywhere: &mut [Where], terms: &[Term], variables: &Variables) {
    let echo = |w: &&mut Where| {
        w.significant && terms.iter().all(|term| term.found.variable != w.variable)
    };
    for found in everywhere.iter_mut().filter(echo) {
        let x = vector(found, variables);
        let likeness = |term: &Term| {
            let product: f64 = x.iter().zip(&term.x).map(|(a, b)| a * b).sum();
            product * product / square(&term.x).max(f64::MIN_POSITIVE)
        };
        let nearest = terms
            .iter()
            .max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
        found.echo_of = nearest.map(|term| term.found.variable);
    }
}
