//! Each of the trunk's parameters before and after a motion.

use std::path::Path;

use nalgebra::DMatrix;
use proprio_core::inertia::INERTIAL;
use serde::Serialize;

use super::super::{ExciteError, Measures, Motion};
use super::knowledge::{Prior, structure};
use super::standing::Standing;
use crate::estimate::Status;
use crate::free_base::FreeBaseError;
use crate::free_base::expected::{Expected, expected, expected_of_log};
use crate::free_base::walk::Played;
use crate::model::{BASE, Model};
use crate::parameter::INERTIAL_NAMES;

/// What a motion is expected to tell of one of the trunk's ten parameters, about the base's origin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrunkParameter {
    /// `m:base`, `hx:base`, …, `Izz:base`.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// By the model, in that unit.
    pub value: f64,
    /// Standard deviation after the motion is played once and identified.
    pub std: f64,
    /// Standard deviation before any data.
    pub prior_std: f64,
    /// `identified`, `prior` (held by the prior) or `unexcited`.
    pub status: Status,
}

/// What a motion tells that has no numbers.
pub(super) const NOTHING: Measures = Measures {
    condition_number: f64::INFINITY,
    condition_number_si: f64::INFINITY,
    rank: 0,
    log_det: f64::NEG_INFINITY,
};

/// The measures of rows.
pub(super) fn measures(prior: &Prior, rows: &DMatrix<f64>) -> Option<Measures> {
    let (condition_number, rank) = prior.condition(rows, true);
    Some(Measures {
        condition_number,
        condition_number_si: prior.condition(rows, false).0,
        rank,
        log_det: prior.seen(rows)?.log_det,
    })
}

/// The ten parameters from their standard deviations before and after.
pub(super) fn parameters(
    model: &Model,
    [before, after]: [[f64; INERTIAL]; 2],
) -> Vec<TrunkParameter> {
    let of = |k: usize| {
        let (what, unit) = INERTIAL_NAMES[k];
        TrunkParameter {
            name: crate::parameter::name_at(what, "base"),
            unit,
            value: model.inertia(BASE).0[k],
            std: after[k],
            prior_std: before[k],
            status: Status::of(after[k], before[k]),
        }
    };
    (0..INERTIAL).map(of).collect()
}

/// By the windows that `identify --free-base` makes of a log of the motion.
pub(super) fn of_standing(
    model: &Model,
    standing: &Standing,
    motion: &Motion,
) -> Result<Vec<TrunkParameter>, ExciteError> {
    let rate = super::super::output::RATE;
    let count = (motion.duration() * rate).round() as usize;
    let played = (0..=count).filter_map(|n| {
        let t = n as f64 / rate;
        let (state, needed) = standing.moment(motion, t)?;
        let [gyro, acc] = state.imu(&standing.robot);
        Some(Played {
            t,
            q: state.q.to_vec(),
            dq: state.dq.to_vec(),
            tau: needed.torque.to_vec(),
            gyro,
            acc,
            down: state.down(),
        })
    });
    let expected = structure(model).and_then(|own| expected(&own, played.collect()));
    let expected = expected.map_err(|_| ExciteError::Unphysical("of the Go2".to_owned()))?;
    Ok(told(model, &expected))
}

/// What the motion of a log of a walking or swaying Go2 tells of the trunk, by the same measure as a design is told: at the noise that
/// designs assume, whatever the log's.
///
/// # Errors
/// [`FreeBaseError`]: a log that is bad or lacks what a moving base needs.
pub fn measured(model: &Model, log: &Path) -> Result<Vec<TrunkParameter>, FreeBaseError> {
    let expected = expected_of_log((model, &structure(model)?), log)?;
    Ok(told(model, &expected))
}

fn told(model: &Model, expected: &Expected) -> Vec<TrunkParameter> {
    let trunk = |all: &[f64]| std::array::from_fn(|k| all[k]);
    parameters(model, [trunk(&expected.prior_std), trunk(&expected.std)])
}
