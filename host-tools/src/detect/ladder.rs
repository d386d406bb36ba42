//! What every result of a log is held against, the same numbers in every command, JSON and page: no model, the CAD, the model file as it is given, and the
//! log's noise floor. All are of the windows in which a joint is judged, which no value of a model changes.

use serde::Serialize;

use super::floor;
use super::residual::NoiseFloor;
use crate::estimate::limb_data::LimbData;
use crate::model::Model;
use crate::summary::{ErrorRange, torque};

/// Root mean squares of measured − predicted mean torque over a window, of a joint or of all, N m.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Yardsticks {
    /// Of predicting zero.
    pub zero_rms: f64,
    /// Of the CAD's rigid body without any effect.
    pub cad_rms: f64,
    /// Of the model file with the values that it gives; of the CAD, where there is none.
    pub given_rms: f64,
    /// Error that no model can take away, a property of the log; none for fewer than 100 windows, or of all joints if one has none.
    pub noise_floor_rms: Option<f64>,
    /// Whether the true floor may be lower: the log does not separate noise from what changes as fast.
    pub noise_floor_is_upper_bound: bool,
    /// Why there is none.
    #[serde(skip)]
    pub floor_unknown: Option<&'static str>,
}

/// An error that is so many times the floor is not at it. Of 90 complete robots with twelve kinds of noise (`studies/pinocchio/complete.py`) half are at 1.0
/// times, nine tenths below 1.2; those above 1.5 had noise that the floor leaves out: spikes, and velocities that are differences of positions.
const MOST_BESIDE_FLOOR: f64 = 1.5;

/// Why a joint has no noise floor.
const TOO_FEW: &str = "a joint has too few windows in motion";
/// Why a walk has none.
pub(crate) const WALK: &str = "of equations without contact forces none is known";

/// A joint's, and how many windows they are of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct JointLadder {
    pub(crate) windows: f64,
    pub(crate) errors: Yardsticks,
    pub(crate) noise: Option<NoiseFloor>,
}

impl JointLadder {
    /// What noise leaves of the joint's held-out squares, (N m)²; none where its floor is not known.
    pub(crate) fn noise_squares(&self) -> Option<f64> {
        Some(self.windows * self.noise?.rms.powi(2))
    }
}

/// Those of a limb's joints, held against the file's model as `given`.
pub(crate) fn of(data: &LimbData, given: &Model) -> Vec<JointLadder> {
    let zero = vec![0.0; data.torque.len()];
    let cad = data.predicted_by_cad();
    let floors = floor::of(data, &cad).into_iter().zip(data.windows());
    let predicted = [zero, data.predicted_as_given(given), cad];
    let [zero, given, cad] = predicted.map(|torque| data.squares(&torque).by_joint());
    let joint = |(j, (noise, windows)): (usize, (Option<NoiseFloor>, f64))| {
        let rms = |squares: &[f64]| (squares[j] / windows.max(1.0)).sqrt();
        JointLadder {
            windows,
            errors: Yardsticks {
                zero_rms: rms(&zero),
                cad_rms: rms(&cad),
                given_rms: rms(&given),
                noise_floor_rms: noise.map(|noise| noise.rms),
                noise_floor_is_upper_bound: noise.is_some_and(|noise| noise.upper_bound),
                floor_unknown: noise.is_none().then_some(TOO_FEW),
            },
            noise,
        }
    };
    floors.enumerate().map(joint).collect()
}

/// A root mean square over the windows of all joints of one over each joint's.
pub(crate) fn over_all(joints: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let sums = joints
        .into_iter()
        .fold([0.0; 2], |[sum, n], (windows, rms)| {
            [sum + rms * rms * windows, n + windows]
        });
    (sums[0] / sums[1].max(1.0)).sqrt()
}

impl Yardsticks {
    /// Of an equation of which only the CAD's error is known.
    pub(crate) fn of_other_equation(cad_rms: f64) -> Self {
        Self {
            zero_rms: f64::NAN,
            cad_rms,
            given_rms: cad_rms,
            floor_unknown: Some("of momentum's equation alone one is known"),
            ..Self::default()
        }
    }

    /// Of walks, under no model, the CAD and the file as given, N m.
    pub(crate) fn of_walk([zero_rms, cad_rms, given_rms]: [f64; 3]) -> Self {
        Self {
            zero_rms,
            cad_rms,
            given_rms,
            floor_unknown: Some(WALK),
            ..Self::default()
        }
    }

    /// Over the windows of all joints, each with how many it has; joints without any do not count.
    pub(crate) fn over_all(joints: &[(f64, Self)]) -> Self {
        let judged = || joints.iter().filter(|(windows, _)| *windows > 0.0);
        let all = |of: &dyn Fn(&Self) -> f64| over_all(judged().map(|(n, own)| (*n, of(own))));
        let is_known =
            judged().next().is_some() && judged().all(|(_, own)| own.noise_floor_rms.is_some());
        Self {
            zero_rms: all(&|own| own.zero_rms),
            cad_rms: all(&|own| own.cad_rms),
            given_rms: all(&|own| own.given_rms),
            noise_floor_rms: is_known.then(|| all(&|own| own.noise_floor_rms.unwrap_or(0.0))),
            noise_floor_is_upper_bound: judged().any(|(_, own)| own.noise_floor_is_upper_bound),
            floor_unknown: (!is_known).then(|| {
                let reasons = judged().find_map(|(_, own)| own.floor_unknown);
                reasons.unwrap_or(TOO_FEW)
            }),
        }
    }

    /// Share of the square of an error `rms` that is above the noise floor, %.
    pub(crate) fn above_noise_percent(&self, rms: f64) -> Option<f64> {
        let share = |floor: f64| 1.0 - (floor / rms.max(f64::MIN_POSITIVE)).powi(2);
        Some(100.0 * share(self.noise_floor_rms?).max(0.0))
    }

    /// From the file as given to a result that leaves `after`.
    pub(crate) fn error(&self, after: impl Into<Option<f64>>) -> ErrorRange {
        ErrorRange {
            floor_unknown: self.floor_unknown,
            ..ErrorRange::torque(self.given_rms, after, self.noise_floor_rms)
        }
    }

    /// How many times the floor an error is, where that is more than a floor's own error, and that of a good model's values, may be.
    pub(crate) fn times_floor(&self, error: f64) -> Option<f64> {
        let times = error / self.noise_floor_rms?;
        (times > MOST_BESIDE_FLOOR).then_some(times)
    }

    /// The floor as it stands beside an error: where that is no larger but for chance, it is the floor.
    pub(crate) fn floor_beside(&self, error: f64) -> Option<f64> {
        self.noise_floor_rms.map(|floor| floor.min(error))
    }

    /// The same in words.
    pub(crate) fn floor_words(&self, error: f64) -> String {
        match (self.floor_beside(error), self.noise_floor_is_upper_bound) {
            (Some(floor), true) => format!("noise floor at most {}", torque(floor)),
            (Some(floor), false) => format!("noise floor {}", torque(floor)),
            (None, _) => format!(
                "noise floor unknown: {}",
                self.floor_unknown.unwrap_or(TOO_FEW)
            ),
        }
    }
}
