//! Real patterns, told apart and put into words.
//!
//! The strongest pattern is taken out of the residual, then the strongest of what is left, and so on. A candidate is judged
//! by what it adds to those taken (less its projection on them), and all those taken are fitted together each time. Of the real patterns, those that are never taken are echoes of the ones that are. Nothing here
//! names an effect: a shape and what it looks like, with the other shapes that would do almost as well.

use serde::Serialize;

use super::cluster;
use super::pattern::{ALMOST, FALSE_DISCOVERY, Where, against};
use super::series::{Runs, centred, project_out, square};
use super::shape::{ADDS, Shape, Variable, Variables};
use super::text;

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
    /// The same without what it looks like.
    #[serde(skip)]
    pub observation: String,
}

/// A pattern that has been taken out of the residual.
struct Term {
    found: Where,
    x: Vec<f64>,
    size: f64,
}

/// A pattern that explains less of the residual's mean square may be real but is not worth a sentence.
const LEAST_EXPLAINED: f64 = 0.01;

/// A mean with this share of the mean square is most of it: of what grows from nothing in proportion to its variable it has three quarters.
const MOSTLY: f64 = 0.8;

/// Patterns told at most.
const MOST: usize = 6;

/// Rounds, at most, in which the sizes of all terms are fitted one after the other.
const ROUNDS: usize = 200;

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
        let Some(found) = strongest(&real, &left, &terms, runs, variables) else {
            break;
        };
        // What varies explains a share of the variance; of the mean square that is less by what the mean is of it.
        let of = match found.variable {
            Variable::Constant => square(&left),
            _ => square(&centred(&left)),
        };
        let found = Where {
            share: found.share * of / square(residual),
            ..found
        };
        if found.share < LEAST_EXPLAINED {
            break;
        }
        terms.push(Term::new(found, variables));
        fit_together(&mut terms, residual);
    }
    drop_idle(&mut terms, residual, runs, everywhere.len());
    mark_echoes(everywhere, &terms, variables);
    let left = less(residual, &terms);
    let tell = |i: usize| terms[i].told(joint, fit_beside(&terms, i, &left, runs), variables);
    (0..terms.len()).map(tell).collect()
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

    /// The fit beside the other terms.
    fn fit(&self, left: &[f64], others: &[Vec<f64>], runs: &Runs) -> Option<cluster::Fit> {
        let alone = self.alone(left);
        if self.found.variable == Variable::Constant {
            return cluster::mean(&alone, runs);
        }
        let mut x = self.x.clone();
        project_out(&mut x, others);
        // Of what the others say all but rounding nobody knows the size.
        (square(&x) > ADDS * square(&self.x)).then_some(())?;
        cluster::fit(&x, &alone, runs)
    }

    /// The pattern as told; `fit` is the fit beside the other terms.
    fn told(&self, joint: &str, fit: Option<cluster::Fit>, variables: &Variables) -> Pattern {
        let size = fit.map(|fit| [fit.slope, fit.std]);
        let found = Where {
            size: size.filter(|_| self.found.shape.is_some()),
            ..self.found.clone()
        };
        Pattern {
            variable: found.variable,
            shape: found.shape,
            size: found.size,
            share: found.share,
            sentence: text::sentence(joint, &found, variables),
            observation: text::observation(joint, &found, variables),
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
    terms: &[Term],
    runs: &Runs,
    variables: &Variables,
) -> Option<Where> {
    let taken = orthonormal(terms.iter());
    let found = real
        .iter()
        .map(|&variable| against(variable, left, &taken, runs, variables));
    let told = |w: &Where| terms.iter().any(|term| term.found.variable == w.variable);
    let beyond = |w: &Where| {
        // What else is in a variable that has been told matters only if it has a name.
        w.p * real.len() as f64 <= FALSE_DISCOVERY && (w.shape.is_some() || !told(w))
    };
    let mut found: Vec<Where> = found.filter(beyond).collect();
    // A mean comes last: what changes has one too, and says more of it; but first where it is most of what is left.
    let is_mean = |w: &Where| w.variable == Variable::Constant;
    let rank = |w: &Where| match is_mean(w) {
        true if w.share >= MOSTLY => 0,
        false => 1,
        true => 2,
    };
    found.sort_by(|a, b| rank(a).cmp(&rank(b)).then(b.share.total_cmp(&a.share)));
    let (best, others) = found.split_first()?;
    let rivals = others
        .iter()
        .filter(|w| w.share >= ALMOST * best.share && !is_mean(best) && !is_mean(w));
    let rivals = rivals
        .filter_map(|w| w.shape)
        .filter(|shape| !shape.is_searched());
    Some(Where {
        alternatives: best.alternatives.iter().copied().chain(rivals).collect(),
        ..best.clone()
    })
}

/// Directions that span the terms' values (Gram-Schmidt).
fn orthonormal<'a>(terms: impl Iterator<Item = &'a Term>) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for term in terms {
        let mut x = term.x.clone();
        project_out(&mut x, &basis);
        let norm = square(&x).sqrt();
        if norm > 1e-6 * square(&term.x).sqrt() {
            x.iter_mut().for_each(|x| *x /= norm);
            basis.push(x);
        }
    }
    basis
}

/// Least squares of all terms' sizes together, by going round until nothing changes.
fn fit_together(terms: &mut [Term], residual: &[f64]) {
    let mut left = less(residual, terms);
    for _ in 0..ROUNDS {
        let mut largest: f64 = 0.0;
        for term in terms.iter_mut() {
            let product: f64 = left.iter().zip(&term.x).map(|(e, x)| e * x).sum();
            let change = product / square(&term.x).max(f64::MIN_POSITIVE);
            for (e, x) in left.iter_mut().zip(&term.x) {
                *e -= change * x;
            }
            term.size += change;
            largest = largest.max((change / term.size).abs());
        }
        if largest < 1e-5 {
            break;
        }
    }
}

/// The fit of one term beside the others.
fn fit_beside(terms: &[Term], i: usize, left: &[f64], runs: &Runs) -> Option<cluster::Fit> {
    let others = terms.iter().enumerate().filter(|(other, _)| *other != i);
    terms[i].fit(left, &orthonormal(others.map(|(_, term)| term)), runs)
}

/// Drops terms that later ones have made idle.
fn drop_idle(terms: &mut Vec<Term>, residual: &[f64], runs: &Runs, tests: usize) {
    let mut i = 0;
    while i < terms.len() && terms.len() > 1 {
        let left = less(residual, terms);
        let idle = fit_beside(terms, i, &left, runs)
            .is_none_or(|fit| fit.p * tests as f64 > FALSE_DISCOVERY);
        if idle {
            terms.remove(i);
            fit_together(terms, residual);
            // Without it, others may be idle too.
            i = 0;
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
