//! One leg's data and fits.

use std::path::Path;

use proprio_core::estimator::{
    DeviceRows, DeviceWindow, LEG_INERTIAL, LegBase, LegFactors, LegPrior,
};
use proprio_core::factor::FactorError;
use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use proprio_core::spatial::Transform;
use proprio_core::window::{Implausible, Push, Sample, Settings};

use super::IdentificationError;
use super::base_rows::{BaseRows, analysis};
use crate::estimate::{self, Constraint, ParameterEstimate};
use crate::log::Samples;

/// Windows of the estimator, here and on the device.
pub(super) const SETTINGS: Settings = Settings::DEFAULT;

/// Length of a block of one fold, µs: longer than a residual remembers.
const BLOCK_US: u64 = 2_000_000;
/// Windows this soon after a block's start belong to no fold, µs.
const GUARD_US: u64 = 100_000;
/// Folds of the held-out error.
const FOLDS: usize = 2;

/// Gathers one leg's data.
pub(super) struct LegIdentifier {
    leg: Leg,
    /// The device's: of the columns that a base parameter has, which are a third of the work and say as much.
    window: DeviceWindow<f64>,
    base: LegBase<f64>,
    /// The windows of each fold, and then those of none.
    parts: [BaseRows; FOLDS + 1],
    samples: Samples,
    /// The same of the log being read, and the first sample of it that was rejected.
    in_log: Samples,
    rejected: Option<(u64, Implausible)>,
    windows: u64,
}

/// What is known of a leg in the end.
pub(super) struct LegFit {
    pub(super) leg: Leg,
    pub(super) parameters: Vec<ParameterEstimate>,
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
        Self {
            leg,
            window: DeviceWindow::new(leg, &Transform::identity(), SETTINGS),
            base: analysis(leg),
            parts: std::array::from_fn(|_| BaseRows::new()),
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
                self.parts[fold(rows).unwrap_or(FOLDS)].take(rows);
                self.windows += 1;
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

    pub(super) fn fit(&self, constraint: Constraint) -> Result<LegFit, FactorError> {
        let prior = LegPrior::of(self.leg);
        let mut parts = self.parts.clone();
        parts.iter_mut().for_each(BaseRows::finish);
        let mut whole = parts[FOLDS].clone();
        parts[..FOLDS].iter().for_each(|fold| whole.merge(fold));
        let all = whole.factors(&self.base)?;
        let solution = estimate::solve(&prior, &all, constraint)?;

        let mut urdf = estimate::solve(&prior, &LegFactors::default(), Constraint::Free)?.values;
        urdf[LEG_INERTIAL..].fill(0.0);
        let mut joints = [Misfit::default(); JOINTS_PER_LEG];
        for (joint, misfit) in joints.iter_mut().enumerate() {
            misfit.fit = all.sum_of_squares(joint, &solution.values);
            misfit.urdf = all.sum_of_squares(joint, &urdf);
        }
        let folds = [parts[0].factors(&self.base)?, parts[1].factors(&self.base)?];
        for fold in 0..FOLDS {
            let (train, test) = (&folds[1 - fold], &folds[fold]);
            if train.windows() == 0.0 {
                continue;
            }
            let theta = estimate::solve(&prior, train, constraint)?.values;
            for (joint, misfit) in joints.iter_mut().enumerate() {
                misfit.held_out += test.sum_of_squares(joint, &theta);
                misfit.held_out_windows += test.windows();
            }
        }
        let parameters = estimate::of_leg(self.leg, &solution, constraint)?;
        let (samples, windows) = (self.samples, self.windows);
        Ok(LegFit {
            leg: self.leg,
            parameters,
            joints,
            samples,
            windows,
        })
    }
}

/// Which fold a window belongs to; none near the start of a block.
fn fold(rows: &DeviceRows<f64>) -> Option<usize> {
    let start = rows.span_us[0];
    (start % BLOCK_US >= GUARD_US).then_some((start / BLOCK_US) as usize % FOLDS)
}

fn quantity(reason: Implausible) -> &'static str {
    match reason {
        Implausible::NotFinite => "value",
        Implausible::Position => "position",
        Implausible::Speed => "velocity",
        Implausible::Torque => "torque",
    }
}
