//! Friction first, then inertia: the sequence of the identification study, step by step.
//!
//! 1. The rigid body is the CAD's; each joint's Fc, Fv and Ia in 0 to 50 and β in −50 to 50 (SI), without any prior.
//! 2. Friction stays; the bodies are free within their prior, by the momentum equation.
//! 3. Friction stays; every body is one that could exist.
//!
//! Against one fit of everything, which is the default, what the CAD gets wrong goes into the friction of the first step and
//! stays there: the stages are for comparison with studies that work so.

use std::sync::OnceLock;

use nalgebra::DMatrix;
use proprio_core::effect::EffectKind;
use proprio_core::inertia::INERTIAL;
use serde::Serialize;

use super::bounded::{Bounded, Problem, Solution};
use super::fit::LimbFit;
use super::groups::stacked;

/// Bounds of the first step, SI.
const MOST: f64 = 50.0;
/// Stands for no prior: parameters are below [`MOST`], and the data tell them far better than this.
const NO_PRIOR: f64 = 1e6;

/// One step for all limbs.
#[derive(Debug, Clone, Serialize)]
pub struct Stage {
    /// `friction`, `momentum inertia`, `consistent inertia`.
    pub name: &'static str,
    /// Root mean square of its residuals, N m.
    pub rms: f64,
    /// The parameters that it fitted.
    pub parameters: Vec<StageParameter>,
}

/// A parameter at the end of a step.
#[derive(Debug, Clone, Serialize)]
pub struct StageParameter {
    /// As in the final result.
    pub name: String,
    /// Value.
    pub value: f64,
}

/// Names of the steps.
pub(crate) const NAMES: [&str; 3] = ["friction", "momentum inertia", "consistent inertia"];

impl LimbFit<'_> {
    /// Goes through the steps, and ends with the last one's θ; returns θ after each.
    pub(crate) fn go_through_stages(&mut self) -> Option<[Solution; 3]> {
        let data = stacked(&self.all, &self.noise);
        let (n, inertial) = (data.ncols() - 1, INERTIAL * self.problem.bodies.len());
        let cad = self.problem.start();
        let mut rows = DMatrix::zeros(data.nrows(), n - inertial + 1);
        rows.columns_mut(0, n - inertial + 1)
            .copy_from(&data.columns(inertial, n - inertial + 1));
        let right = data.column(n) - data.columns(0, inertial) * cad.rows(0, inertial);
        rows.set_column(n - inertial, &right);
        let friction = Problem {
            bodies: Vec::new(),
            others: self.wide_bounds(),
            data: rows,
            free: false,
        };
        let friction = friction.solve()?;

        let mut held = self.problem.clone();
        for (other, value) in held.others.iter_mut().zip(friction.theta.iter()) {
            *other = Bounded {
                mean: *value,
                lower: *value,
                upper: *value,
                ..*other
            };
        }
        held.free = true;
        let free = held.solve()?;
        held.free = false;
        let consistent = held.solve()?;

        let mut first = consistent.clone();
        first
            .theta
            .rows_mut(0, inertial)
            .copy_from(&cad.rows(0, inertial));
        first.held = vec![false; inertial]
            .into_iter()
            .chain(friction.held)
            .collect();
        self.solution.theta = consistent.theta.clone();
        self.solution.held = first.held.clone();
        // Errors are those of all parameters together, friction's share included.
        self.solution.factor = self.problem.expanded(&self.solution.theta)?.0;
        self.deviations = OnceLock::new();
        Some([first, free, consistent])
    }

    fn wide_bounds(&self) -> Vec<Bounded> {
        let effects = self.columns.entries.iter().filter_map(|entry| entry.effect);
        let of = |(other, effect): (&Bounded, EffectKind)| {
            let [lower, upper] = match effect {
                effect if !effect.description().plain => return *other,
                effect if effect.description().parameters[0].lower < 0.0 => [-MOST, MOST],
                _ => [0.0, MOST],
            };
            Bounded {
                mean: 0.0,
                std: NO_PRIOR,
                lower,
                upper,
            }
        };
        self.problem.others.iter().zip(effects).map(of).collect()
    }
}
