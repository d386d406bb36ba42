//! One limb of a model: its effects of every form, fitted.
//!
//! Effects that are a torque are columns. What the sensors get wrong (velocity_gain, encoder_offset, delay, elasticity,
//! backlash, torque_gain) and base_tilt are taken out of the data before; their column is the derivative there, and the
//! rows are made again until the step is small against its error (Gauss-Newton).

use nalgebra::{DMatrix, DVector};
use proprio_core::effect::EffectKind;
use proprio_core::inertia::INERTIAL;

use super::physical::{Bounded, Problem, Solution, triangle};
use crate::criticism::blocks::{BlockFactors, HeapFactor};
use crate::criticism::column::{BASE, Columns};
use crate::criticism::limb::{FOLDS, LimbCriticism};
use crate::criticism::recording::LimbRecording;
use crate::criticism::triangle::misfit;
use crate::estimate::Constraint;
use crate::model::{Limb, Model};

/// Most times that rows are made again.
const MOST_PASSES: usize = 6;
/// A correction that moves by less than this many standard deviations stays.
const STEADY: f64 = 0.1;

/// A limb fitted to a recording.
pub(crate) struct LimbFit<'a> {
    pub(crate) model: &'a Model,
    pub(crate) limb: &'a Limb,
    pub(crate) criticism: LimbCriticism<'a>,
    pub(crate) blocks: BlockFactors,
    /// The data of all blocks, joint by joint.
    pub(crate) all: Vec<HeapFactor>,
    /// Each joint's noise: root mean square of its residuals, N m.
    pub(crate) noise: Vec<f64>,
    pub(crate) problem: Problem,
    pub(crate) solution: Solution,
}

impl<'a> LimbFit<'a> {
    /// Fits the effects of `model`, whose values are not looked at; `tilt` is the base's, if it is known already.
    ///
    /// `None` if the recording is too short or the limb too large.
    pub(crate) fn of(
        model: &'a Model,
        limb: &'a Limb,
        recording: &'a LimbRecording,
        constraint: Constraint,
        tilt: Option<[f64; 2]>,
    ) -> Option<Self> {
        let mut criticism = LimbCriticism::new(model, limb, recording, false)?;
        if let Some(tilt) = tilt {
            criticism.corrections.tilt = tilt;
            criticism.rebuild();
        }
        let mut passes = 1;
        loop {
            let fit = Self::at(model, limb, criticism, constraint, tilt.is_some())?;
            if passes >= MOST_PASSES || fit.is_steady() {
                return Some(fit);
            }
            criticism = fit.criticism;
            criticism.fit.theta = fit.solution.theta.as_slice().to_vec();
            criticism.rebuild();
            passes += 1;
        }
    }

    /// The fit with the corrections as they are.
    fn at(
        model: &'a Model,
        limb: &'a Limb,
        criticism: LimbCriticism<'a>,
        constraint: Constraint,
        tilt_is_known: bool,
    ) -> Option<Self> {
        // The derivatives are taken where the corrections are.
        let mut criticism = criticism;
        for k in 0..criticism.columns.entries.len() {
            let entry = criticism.columns.entries[k];
            if entry.effect.is_some_and(|effect| criticism.is_correction((effect, entry.joint))) {
                criticism.fit.theta[k] = 0.0;
            }
        }
        let blocks = BlockFactors::of(&criticism.rows());
        let all = blocks.sum(&criticism.columns, |_| true);
        let mut noise = criticism.fit.noise.clone();
        let mut problem = Problem {
            bodies: limb
                .bodies
                .clone()
                .map(|b| (model.robot().bodies()[b].inertia, model.cad_uncertainty(b)))
                .collect(),
            others: others(&criticism, tilt_is_known),
            data: stacked(&criticism.columns, &all, &noise),
            free: constraint == Constraint::Free,
        };
        let mut solution = problem.solve()?;
        for (joint, noise) in noise.iter_mut().enumerate() {
            let square = misfit(&criticism.columns, joint, &all[joint], solution.theta.as_slice());
            let fitted = solution.theta.len() as f64 / all.len() as f64;
            let size = (square / (all[joint].rows() - fitted).max(1.0)).sqrt();
            *noise = size.max(1e-3 * *noise);
        }
        problem.data = stacked(&criticism.columns, &all, &noise);
        solution = problem.solve().unwrap_or(solution);
        Some(Self { model, limb, criticism, blocks, all, noise, problem, solution })
    }

    /// Whether no correction would move by much.
    fn is_steady(&self) -> bool {
        let std = self.solution.std();
        let entries = self.criticism.columns.entries.iter().enumerate();
        entries
            .filter(|(_, entry)| entry.effect.is_some_and(|effect| self.criticism.is_correction((effect, entry.joint))))
            .all(|(k, _)| self.solution.theta[k].abs() <= STEADY * std[k])
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

    /// Sum of squared residuals of each joint, (N m)²: of the fit, of each fold under the fit to the others, and of the CAD
    /// without any effect; and the windows.
    pub(crate) fn misfits(&self) -> Vec<JointMisfit> {
        let columns = &self.criticism.columns;
        let folds = FOLDS.min(self.blocks.blocks.len());
        let mut cad = self.problem.start();
        cad.rows_mut(INERTIAL * self.problem.bodies.len(), self.problem.others.len()).fill(0.0);
        let mut misfits: Vec<JointMisfit> = self
            .all
            .iter()
            .enumerate()
            .map(|(joint, factor)| JointMisfit {
                windows: factor.rows(),
                fit: misfit(columns, joint, factor, self.solution.theta.as_slice()),
                cad: misfit(columns, joint, factor, cad.as_slice()),
                held_out: None,
            })
            .collect();
        for fold in (0..folds).filter(|_| folds > 1) {
            let train = self.blocks.sum(columns, |b| self.criticism.fold(b) != fold);
            let test = self.blocks.sum(columns, |b| self.criticism.fold(b) == fold);
            let problem = Problem { data: stacked(columns, &train, &self.noise), ..self.problem.clone() };
            let Some(solution) = problem.solve() else { continue };
            for (joint, misfits) in misfits.iter_mut().enumerate() {
                let square = misfit(columns, joint, &test[joint], solution.theta.as_slice());
                *misfits.held_out.get_or_insert(0.0) += square;
            }
        }
        misfits
    }
}

/// Sums over one joint's windows.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointMisfit {
    pub(crate) windows: f64,
    pub(crate) fit: f64,
    pub(crate) cad: f64,
    pub(crate) held_out: Option<f64>,
}

/// The rows of all joints, each divided by its joint's noise, as one triangle over θ.
pub(crate) fn stacked(columns: &Columns, factors: &[HeapFactor], noise: &[f64]) -> DMatrix<f64> {
    let n = columns.entries.len();
    let rows: usize = factors.iter().map(HeapFactor::columns).sum();
    let mut all = DMatrix::zeros(rows, n + 1);
    let mut at = 0;
    for (joint, factor) in factors.iter().enumerate() {
        for k in 0..factor.columns() {
            let row = factor.row(k);
            let entry = |column: usize| column.checked_sub(k).map_or(0.0, |c| row[c] / noise[joint]);
            for e in 0..n {
                if let Some(place) = columns.place(joint, e) {
                    all[(at, e)] = entry(place);
                }
            }
            all[(at, n)] = entry(factor.columns());
            at += 1;
        }
    }
    triangle(all)
}

/// What is known of the effects' entries: priors, and bounds on the catalogue's values as bounds on the entries.
fn others(criticism: &LimbCriticism, tilt_is_known: bool) -> Vec<Bounded> {
    let of = |entry: &crate::criticism::column::Entry| {
        let effect = entry.effect?;
        let parameter = &effect.description().parameters[entry.parameter];
        let correction = criticism.corrections.get(effect, entry.joint, entry.parameter);
        let (lower, upper) = match effect {
            EffectKind::TorqueGain => (1.0 / parameter.upper - correction, 1.0 / parameter.lower - correction),
            _ => {
                let at = parameter.neutral + correction;
                (parameter.lower - at, parameter.upper - at)
            }
        };
        let known = tilt_is_known && entry.joint == BASE;
        let (lower, upper) = if known { (0.0, 0.0) } else { (lower, upper) };
        Some(Bounded { mean: entry.mean, std: entry.std, lower, upper })
    };
    criticism.columns.entries.iter().filter_map(of).collect()
}

/// Half the gradient of each block's sum of squares, in units of the noise.
pub(crate) fn scores(fit: &LimbFit) -> Vec<DVector<f64>> {
    let columns = &fit.criticism.columns;
    let n = fit.solution.theta.len();
    let of = |block: &Vec<HeapFactor>| {
        let data = stacked(columns, block, &fit.noise);
        let r = data.columns(0, n);
        r.tr_mul(&(r * &fit.solution.theta - data.column(n)))
    };
    fit.blocks.blocks.iter().filter(|block| block.iter().any(|f| f.rows() > 0.0)).map(of).collect()
}
