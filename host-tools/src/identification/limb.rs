//! One limb of a model: its effects of every form, fitted.
//!
//! Effects that are a torque are columns. What the sensors get wrong (velocity_gain, encoder_offset, delay, elasticity,
//! backlash, torque_gain) and base_tilt are taken out of the data before; their column is the derivative there, and the
//! rows are made again until the step is small against its error (Gauss-Newton).

use nalgebra::DVector;
use proprio_core::effect::EffectKind;
use proprio_core::inertia::INERTIAL;

use super::data::{Data, Rows, stacked};
use super::method::{self, Method};
use super::physical::{Bounded, Problem, Solution};
use crate::criticism::column::{BASE, Entry};
use crate::criticism::limb::LimbCriticism;
use crate::criticism::recording::LimbRecording;
use crate::estimate::Constraint;
use crate::model::{Limb, Model};

/// Most times that rows are made again.
const MOST_PASSES: usize = 6;
/// A correction that moves by less than this many standard deviations stays.
const STEADY: f64 = 0.1;

/// How a limb is fitted.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct How {
    pub(crate) constraint: Constraint,
    pub(crate) method: Method,
    /// The base's roll and pitch, where they are known already.
    pub(crate) tilt: Option<[f64; 2]>,
}

/// A limb fitted to a recording.
pub(crate) struct LimbFit<'a> {
    pub(crate) model: &'a Model,
    pub(crate) limb: &'a Limb,
    pub(crate) criticism: LimbCriticism<'a>,
    method: Method,
    pub(crate) data: Data,
    /// The data of all blocks, group by group.
    pub(crate) all: Vec<Rows>,
    /// Each group's noise: root mean square of its residuals, whitened where they are momentum's.
    pub(crate) noise: Vec<f64>,
    pub(crate) problem: Problem,
    pub(crate) solution: Solution,
}

impl<'a> LimbFit<'a> {
    /// Fits the effects of `model`, whose values are not looked at.
    ///
    /// `None` if the recording is too short or the limb too large.
    pub(crate) fn of(
        model: &'a Model,
        limb: &'a Limb,
        recording: &'a LimbRecording,
        how: How,
    ) -> Option<Self> {
        let mut criticism = LimbCriticism::new(model, limb, recording, false)?;
        if let Some(tilt) = how.tilt {
            criticism.corrections.tilt = tilt;
            criticism.rebuild();
        }
        let momentum = How {
            method: Method::Momentum,
            ..how
        };
        for _ in 1..MOST_PASSES {
            let fit = Self::at(model, limb, criticism, momentum)?;
            let steady = fit.is_steady();
            if steady && how.method == Method::Momentum {
                return Some(fit);
            }
            criticism = fit.criticism;
            criticism.fit.theta = fit.solution.theta.as_slice().to_vec();
            if steady {
                break;
            }
            criticism.rebuild();
        }
        Self::at(model, limb, criticism, how)
    }

    /// The fit with the corrections as they are.
    fn at(
        model: &'a Model,
        limb: &'a Limb,
        mut criticism: LimbCriticism<'a>,
        how: How,
    ) -> Option<Self> {
        // The derivatives are taken where the corrections are.
        for k in 0..criticism.columns.entries.len() {
            let entry = criticism.columns.entries[k];
            if entry
                .effect
                .is_some_and(|effect| criticism.is_correction((effect, entry.joint)))
            {
                criticism.fit.theta[k] = 0.0;
            }
        }
        let data = match how.method {
            Method::Momentum => {
                let factors = super::turns::block_factors(&mut criticism);
                Data::of_factors(&criticism.columns, &factors)
            }
            other => method::data(&criticism, other),
        };
        let all = data.sum(|_| true);
        let size = |rows: &Rows| {
            let square = rows.sum_of_squares(&DVector::zeros(criticism.columns.entries.len()));
            (square / rows.count.max(1.0)).sqrt().max(1e-9)
        };
        let sizes: Vec<f64> = all.iter().map(size).collect();
        let mut noise = match how.method {
            Method::Momentum => criticism.fit.noise.clone(),
            _ => sizes.clone(),
        };
        let bodies = limb.bodies.clone();
        let mut problem = Problem {
            bodies: bodies
                .map(|b| (model.robot().bodies()[b].inertia, model.cad_uncertainty(b)))
                .collect(),
            others: others(&criticism, how),
            data: stacked(&all, &noise),
            free: how.constraint == Constraint::Free,
        };
        let mut solution = problem.solve()?;
        for _ in 0..2 {
            noise = noises(&all, &solution.theta, &sizes);
            problem.data = stacked(&all, &noise);
            solution = problem.solve()?;
        }
        Some(Self {
            model,
            limb,
            criticism,
            method: how.method,
            data,
            all,
            noise,
            problem,
            solution,
        })
    }

    /// Whether no correction would move by much.
    fn is_steady(&self) -> bool {
        let std = self.solution.std();
        let entries = self.criticism.columns.entries.iter().enumerate();
        entries
            .filter(|(_, entry)| self.is_correction(entry))
            .all(|(k, _)| self.solution.theta[k].abs() <= STEADY * std[k])
    }

    pub(crate) fn is_correction(&self, entry: &Entry) -> bool {
        entry
            .effect
            .is_some_and(|effect| self.criticism.is_correction((effect, entry.joint)))
    }

    /// Entry k's value as the catalogue means it.
    pub(crate) fn value(&self, entry: usize) -> f64 {
        self.criticism.value(entry, self.solution.theta[entry])
    }

    /// How the catalogue's value of an entry changes with it.
    pub(crate) fn scale(&self, entry: usize) -> f64 {
        let (at, step) = (self.solution.theta[entry], 1e-6);
        let span = self.criticism.value(entry, at + step) - self.criticism.value(entry, at - step);
        (span / (2.0 * step)).abs()
    }

    /// Sums of squared residuals of each group: of the fit, of each fold under the fit to the others, of the CAD without any
    /// effect.
    pub(crate) fn misfits(&self) -> Vec<Misfit> {
        let folds = self.criticism.blocks.folds;
        let mut cad = self.problem.start();
        cad.rows_mut(
            INERTIAL * self.problem.bodies.len(),
            self.problem.others.len(),
        )
        .fill(0.0);
        let everywhere = |theta: &DVector<f64>| self.squares(&vec![theta.clone(); folds]);
        let counts = self.all.iter().map(|rows| rows.count);
        let sums = everywhere(&self.solution.theta)
            .into_iter()
            .zip(everywhere(&cad));
        let mut misfits: Vec<Misfit> = counts
            .zip(sums)
            .map(|(windows, (fit, cad))| Misfit {
                windows,
                fit,
                cad,
                held_out: None,
            })
            .collect();
        let without = |fold: usize| {
            let train = self.data.sum(|b| self.criticism.fold(b) != fold);
            let problem = Problem {
                data: stacked(&train, &self.noise),
                ..self.problem.clone()
            };
            Some(problem.solve()?.theta)
        };
        let held_out: Option<Vec<_>> = (0..folds).map(without).collect();
        if let Some(held_out) = held_out.filter(|_| folds > 1) {
            for (misfit, square) in misfits.iter_mut().zip(self.squares(&held_out)) {
                misfit.held_out = Some(square);
            }
        }
        misfits
    }

    /// Each group's sum of squared residuals, each fold's under its θ. Momentum rows as they are, not whitened.
    pub(crate) fn squares(&self, theta: &[DVector<f64>]) -> Vec<f64> {
        if self.method == Method::Momentum {
            let theta: Vec<Vec<f64>> = theta.iter().map(|t| t.as_slice().to_vec()).collect();
            return self.criticism.squares(&theta).by_joint;
        }
        let mut squares = vec![0.0; self.all.len()];
        for (fold, theta) in theta.iter().enumerate() {
            let rows = self.data.sum(|b| self.criticism.fold(b) == fold);
            for (square, rows) in squares.iter_mut().zip(&rows) {
                *square += rows.sum_of_squares(theta);
            }
        }
        squares
    }

    /// Half the gradient of each block's sum of squares, in units of the noise.
    pub(crate) fn scores(&self) -> Vec<DVector<f64>> {
        let n = self.solution.theta.len();
        let of = |block: &Vec<Rows>| {
            let data = stacked(block, &self.noise);
            let r = data.columns(0, n);
            r.tr_mul(&(r * &self.solution.theta - data.column(n)))
        };
        let told = self
            .data
            .blocks
            .iter()
            .filter(|block| block.iter().any(|rows| rows.count > 0.0));
        told.map(of).collect()
    }
}

/// Sums over one group's windows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Misfit {
    pub(crate) windows: f64,
    pub(crate) fit: f64,
    pub(crate) cad: f64,
    pub(crate) held_out: Option<f64>,
}

/// Root mean square of each group's residuals under θ.
fn noises(groups: &[Rows], theta: &DVector<f64>, sizes: &[f64]) -> Vec<f64> {
    let fitted = theta.len() as f64 / groups.len() as f64;
    let of = |(rows, size): (&Rows, &f64)| {
        let square = rows.sum_of_squares(theta) / (rows.count - fitted).max(1.0);
        square.sqrt().max(1e-3 * size)
    };
    groups.iter().zip(sizes).map(of).collect()
}

/// What is known of the effects' entries: priors, and bounds on the catalogue's values as bounds on the entries.
fn others(criticism: &LimbCriticism, how: How) -> Vec<Bounded> {
    let of = |entry: &Entry| {
        let effect = entry.effect?;
        let parameter = &effect.description().parameters[entry.parameter];
        let correction = criticism
            .corrections
            .get(effect, entry.joint, entry.parameter);
        let known = how.tilt.is_some() && entry.joint == BASE
            || how.method != Method::Momentum && criticism.is_correction((effect, entry.joint));
        let [lower, upper] = match effect {
            _ if known => [0.0, 0.0],
            _ if how.constraint == Constraint::Free => [f64::NEG_INFINITY, f64::INFINITY],
            EffectKind::TorqueGain => [
                1.0 / parameter.upper - correction,
                1.0 / parameter.lower - correction,
            ],
            _ => [parameter.lower, parameter.upper]
                .map(|bound| bound - parameter.neutral - correction),
        };
        Some(Bounded {
            mean: entry.mean,
            std: entry.std,
            lower,
            upper,
        })
    };
    criticism.columns.entries.iter().filter_map(of).collect()
}
