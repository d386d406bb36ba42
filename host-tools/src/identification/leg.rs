//! One leg's data and fits.

use std::path::Path;

use proprio_core::estimator::{
    EFFECTS, LEG, LEG_INERTIAL, LegFactors, LegPrior, LegRows, LegSolver, LegVector, LegWindow,
    plausible,
};
use proprio_core::factor::FactorError;
use proprio_core::go2::{self, JOINTS_PER_LEG, Leg};
use proprio_core::spatial::Transform;
use proprio_core::window::{Implausible, Push, Sample, Settings, Window};

use super::IdentificationError;
use super::result::Samples;

/// Windows of the estimator, here and on the device.
pub(super) const SETTINGS: Settings = Settings {
    window_us: 20_000,
    max_gap_us: 10_000,
};

/// Length of a block of one fold, µs: longer than a residual remembers.
const BLOCK_US: u64 = 2_000_000;
/// Windows this soon after a block's start belong to no fold, µs.
const GUARD_US: u64 = 100_000;
/// Folds of the held-out error.
const FOLDS: usize = 2;

/// Gathers one leg's data.
pub(super) struct LegIdentifier {
    leg: Leg,
    window: LegWindow<f64>,
    /// The folds, then the guards' windows.
    factors: [LegFactors<f64>; FOLDS + 1],
    samples: Samples,
    /// The same of the log being read, and the first sample of it that was rejected.
    in_log: Samples,
    rejected: Option<(u64, Implausible)>,
    windows: u64,
}

/// What is known of a leg in the end.
pub(super) struct LegFit {
    pub(super) leg: Leg,
    pub(super) solution: Solution,
    /// Means and standard deviations before the data.
    pub(super) prior: (LegVector<f64>, LegVector<f64>),
    pub(super) joints: [Misfit; JOINTS_PER_LEG],
    pub(super) samples: Samples,
    pub(super) windows: u64,
}

/// Sums of squared residuals of one joint, (N m)², and how many windows they are over.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Misfit {
    pub(super) fit: f64,
    pub(super) urdf: f64,
    pub(super) held_out: f64,
    pub(super) held_out_windows: f64,
}

impl LegIdentifier {
    pub(super) fn new(leg: Leg) -> Self {
        let base = Transform::identity();
        let window = Window::new(go2::leg(leg), base, EFFECTS, plausible(leg), SETTINGS);
        let factors = [LegFactors::default(); FOLDS + 1];
        Self {
            leg,
            window,
            factors,
            samples: Samples::default(),
            in_log: Samples::default(),
            rejected: None,
            windows: 0,
        }
    }

    /// Ends a log: nothing is continuous between two. Says what was odd about this one.
    pub(super) fn end_log(&mut self, path: &Path) -> Result<Option<String>, IdentificationError> {
        self.window.clear();
        let samples = std::mem::take(&mut self.in_log);
        self.samples = self.samples.plus(&samples);
        let Some((line, reason)) = self.rejected.take() else {
            return Ok(None);
        };
        let (leg, what) = (self.leg, quantity(reason));
        let percent = 100.0 * samples.rejected as f64 / samples.total as f64;
        if percent > 50.0 {
            let path = path.to_owned();
            return Err(IdentificationError::Impossible {
                path,
                line,
                leg,
                what,
                percent,
            });
        }
        Ok(Some(format!(
            "{}: {} samples of leg {} are more than the robot can do, the first by its {what} on line {line}; they \
             are skipped",
            path.display(),
            samples.rejected,
            leg.name(),
        )))
    }

    pub(super) fn leg(&self) -> Leg {
        self.leg
    }

    pub(super) fn samples(&self) -> Samples {
        self.samples
    }

    pub(super) fn windows(&self) -> u64 {
        self.windows
    }

    /// Takes the sample of a line of the log.
    pub(super) fn push(&mut self, sample: &Sample<f64, JOINTS_PER_LEG>, line: u64) {
        let samples = &mut self.in_log;
        samples.total += 1;
        match self.window.push(sample) {
            Push::Used => {}
            Push::Closed => {
                let rows = self.window.rows();
                // Samples are checked to be finite, so the rows are.
                if self.factors[fold(rows)].fold_window(rows).is_ok() {
                    self.windows += 1;
                }
            }
            Push::Gap => samples.gaps += 1,
            Push::Repeated => samples.repeated += 1,
            Push::Late => samples.late += 1,
            Push::Rejected(reason) => {
                samples.rejected += 1;
                self.rejected.get_or_insert((line, reason));
            }
        }
    }

    pub(super) fn fit(&self) -> Result<LegFit, FactorError> {
        let prior = LegPrior::of(self.leg);
        let nothing = solve(&prior, &LegFactors::default())?;
        let marginals = (nothing.values, nothing.std);
        let mut all = LegFactors::default();
        let mut scratch = [0.0; LEG.columns(0) + 1];
        self.factors
            .iter()
            .try_for_each(|part| all.merge(part, &mut scratch))?;
        let solution = solve(&prior, &all)?;

        let mut urdf = marginals.0;
        urdf[LEG_INERTIAL..].fill(0.0);
        let mut joints = [Misfit::default(); JOINTS_PER_LEG];
        for (joint, misfit) in joints.iter_mut().enumerate() {
            misfit.fit = all.sum_of_squares(joint, &solution.values);
            misfit.urdf = all.sum_of_squares(joint, &urdf);
        }
        for fold in 0..FOLDS {
            let (train, test) = (&self.factors[1 - fold], &self.factors[fold]);
            if train.windows() == 0.0 {
                continue;
            }
            let theta = solve(&prior, train)?.values;
            for (joint, misfit) in joints.iter_mut().enumerate() {
                misfit.held_out += test.sum_of_squares(joint, &theta);
                misfit.held_out_windows += test.windows();
            }
        }
        let (samples, windows) = (self.samples, self.windows);
        Ok(LegFit {
            leg: self.leg,
            solution,
            prior: marginals,
            joints,
            samples,
            windows,
        })
    }
}

/// Which of the factors a window belongs to: its block's fold, or the guards.
fn fold(rows: &LegRows<f64>) -> usize {
    let start = rows.span_us[0];
    if start % BLOCK_US < GUARD_US {
        FOLDS
    } else {
        (start / BLOCK_US) as usize % FOLDS
    }
}

fn quantity(reason: Implausible) -> &'static str {
    match reason {
        Implausible::NotFinite => "value",
        Implausible::Position => "position",
        Implausible::Speed => "velocity",
        Implausible::Torque => "torque",
    }
}

/// θ of a leg and its standard deviations.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solution {
    pub(super) values: LegVector<f64>,
    pub(super) std: LegVector<f64>,
}

fn solve(prior: &LegPrior<f64>, data: &LegFactors<f64>) -> Result<Solution, FactorError> {
    let mut solver = LegSolver::default();
    solver.start(prior, data);
    while !solver.advance()? {}
    let own = |numbers: &[f64]| std::array::from_fn(|k| numbers[k]);
    Ok(Solution {
        values: own(solver.values()),
        std: own(solver.std()),
    })
}
