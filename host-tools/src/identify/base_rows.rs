//! A leg's windows over its base columns, folded many at a time: a third of the numbers that all columns have.

use proprio_core::estimator::{
    COLUMNS, DEFAULT_ACTIVE, DevicePrior, DeviceRows, EFFECTS, LegBase, LegFactors,
};
use proprio_core::factor::{Factor, FactorError};
use proprio_core::go2::{JOINTS_PER_LEG, Leg};

use crate::estimate::factor::{BATCH, HeapFactor};

/// Numbers that the analysis of a leg works in.
const WORK: usize = 1100;

/// Which of a leg's columns are independent, and how the others follow from them.
pub(super) fn analysis(leg: Leg) -> LegBase<f64> {
    let mut base = LegBase::empty();
    let prior = DevicePrior::of(leg, &DEFAULT_ACTIVE);
    // The work space is as large as is asked for; else the fit would say that there was no analysis.
    let _ = base.analyse(leg, &prior, &mut [0.0; WORK]);
    base
}

/// Rows of windows: of each joint a factor of its [`EFFECTS`] and base columns, and the rows that wait to be folded in.
#[derive(Debug, Clone)]
pub(super) struct BaseRows {
    joints: [(HeapFactor, Vec<f64>); JOINTS_PER_LEG],
}

impl BaseRows {
    pub(super) fn new() -> Self {
        // How many columns there are the first window tells.
        let empty = |_| (HeapFactor::new(0), Vec::new());
        Self {
            joints: std::array::from_fn(empty),
        }
    }

    /// Takes the rows of a window. Samples are checked to be finite, so the rows are.
    pub(super) fn take(&mut self, rows: &DeviceRows<f64>) {
        for (joint, (factor, waiting)) in self.joints.iter_mut().enumerate() {
            let row = rows.joint(joint);
            // Behind the base columns stand the effects that a plain model does not have, then the torque.
            let Some((torque, columns)) = row.split_last() else {
                continue;
            };
            let kept = columns.len() - (COLUMNS.len() - EFFECTS.len());
            if factor.columns() != kept {
                *factor = HeapFactor::new(kept);
            }
            waiting.extend_from_slice(&columns[..kept]);
            waiting.push(*torque);
            if waiting.len() >= BATCH * (kept + 1) {
                factor.fold(waiting);
                waiting.clear();
            }
        }
    }

    /// Folds in what waits.
    pub(super) fn finish(&mut self) {
        for (factor, waiting) in &mut self.joints {
            factor.fold(waiting);
            waiting.clear();
        }
    }

    /// Takes in another's rows; both are [finished](Self::finish).
    pub(super) fn merge(&mut self, other: &Self) {
        for ((factor, _), (other, _)) in self.joints.iter_mut().zip(&other.joints) {
            factor.merge(other);
        }
    }

    /// The factors over all columns; of a leg that was analysed.
    pub(super) fn factors(&self, base: &LegBase<f64>) -> Result<LegFactors<f64>, FactorError> {
        if self.joints.iter().any(|(factor, _)| factor.rows() == 0.0) {
            return Ok(LegFactors::default());
        }
        let mut numbers = (self.joints.each_ref()).map(|(factor, _)| factor.numbers().to_vec());
        let mut joints = self
            .joints
            .iter()
            .zip(&mut numbers)
            .map(|((factor, _), numbers)| {
                Factor::from_packed(factor.columns(), factor.rows(), numbers.as_mut_slice())
            });
        let mut next = || joints.next().unwrap_or(Err(FactorError::Length(0)));
        base.standard_factors([next()?, next()?, next()?])
    }
}
