//! A limb's log beside what the model gives and the plainest friction.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::model::{Limb, Model};
use crate::recording::LimbRecording;

/// Most time by which a torque may be late, s.
const MOST_LATE: f64 = 0.15;
/// Fewer windows than this in which a joint moves tell nothing.
const LEAST_WINDOWS: usize = 50;

/// A limb's log read in some way: its joints that move.
pub(super) struct Reading {
    pub(super) joints: Vec<JointReading>,
    /// The time between samples, s.
    pub(super) period: f64,
}

/// A joint's windows in which it moves.
pub(super) struct JointReading {
    pub(super) name: String,
    /// Mean torque measured, N m; and so many samples later, across gaps too, which are few.
    pub(super) torque: Vec<f64>,
    pub(super) shifted: BTreeMap<i64, Vec<f64>>,
    /// What the model gives, its bodies and the effects that have a value, N m.
    pub(super) predicted: Vec<f64>,
    /// Mean velocity (rad/s), mean direction (−1 to 1), mean acceleration (rad/s²).
    friction: [Vec<f64>; 3],
}

impl Reading {
    /// A limb's samples as those of `limb`; `at_times`: and its torque at other times.
    pub(super) fn of(
        model: &Model,
        limb: &Limb,
        samples: &LimbRecording,
        at_times: bool,
    ) -> Option<Self> {
        let data = LimbData::of(model, limb, samples)?;
        let predicted = data.predicted(&Values::given(model, limb), &|_| true);
        let period = samples.period();
        let times: Vec<i64> = match at_times {
            true => shifts(period).collect(),
            false => Vec::new(),
        };
        let joint =
            |(j, name): (usize, String)| JointReading::of(&data, j, name, &predicted, &times);
        let joints = data.joint_names().into_iter().enumerate().map(joint);
        let joints = joints.filter(|joint| joint.torque.len() >= LEAST_WINDOWS);
        Some(Self {
            joints: joints.collect(),
            period,
        })
    }
}

impl JointReading {
    fn of(data: &LimbData, j: usize, name: String, predicted: &[f64], times: &[i64]) -> Self {
        let (n, samples, motion) = (data.joints(), data.recording, &data.motion);
        let windows: Vec<usize> = (0..motion.windows.len())
            .filter(|w| data.counts(*w, j))
            .collect();
        let mean = |x: &dyn Fn(usize) -> f64| -> Vec<f64> {
            windows
                .iter()
                .map(|w| motion.mean(&motion.windows[*w], x))
                .collect()
        };
        let last = samples.len().saturating_sub(1) as i64;
        let at =
            |shift: i64| mean(&|k| samples.tau[(k as i64 + shift).clamp(0, last) as usize * n + j]);
        let velocity = |k: usize| samples.dq[k * n + j];
        let acceleration = windows.iter().map(|w| {
            let window = &motion.windows[*w];
            let [first, last] = window.samples;
            (velocity(last) - velocity(first)) / window.length
        });
        Self {
            name,
            torque: at(0),
            shifted: times.iter().map(|shift| (*shift, at(*shift))).collect(),
            predicted: windows.iter().map(|w| predicted[w * n + j]).collect(),
            friction: [
                mean(&velocity),
                mean(&|k| velocity(k).signum()),
                acceleration.collect(),
            ],
        }
    }

    /// Share of the torque's square that model and friction leave.
    pub(super) fn left(&self) -> f64 {
        self.left_of(&self.torque, 1.0)
    }

    /// The same of another torque, which is the model's so many times.
    pub(super) fn left_of(&self, torque: &[f64], times: f64) -> f64 {
        let total: f64 = torque.iter().map(|x| x * x).sum();
        let beyond: Vec<f64> = torque
            .iter()
            .zip(&self.predicted)
            .map(|(x, p)| x / times - p)
            .collect();
        let mut columns: Vec<&[f64]> = self.friction.iter().map(Vec::as_slice).collect();
        // What would have to be negative is not there.
        loop {
            let (found, left) = least_squares(&columns, &beyond);
            let worst = (0..columns.len()).min_by(|a, b| found[*a].total_cmp(&found[*b]));
            match worst.filter(|k| found[*k] < 0.0) {
                Some(k) => drop(columns.remove(k)),
                None => return left * times * times / total.max(f64::MIN_POSITIVE),
            }
        }
    }

    /// By how much the model's torque would have to be multiplied, friction beside it.
    pub(super) fn factor(&self) -> f64 {
        let columns: Vec<&[f64]> = (self.friction.iter().map(Vec::as_slice))
            .chain([self.predicted.as_slice()])
            .collect();
        let (found, _) = least_squares(&columns, &self.torque);
        found[3]
    }
}

/// Shifts in samples at which a torque may be late or early.
pub(super) fn shifts(period: f64) -> impl Iterator<Item = i64> {
    let most = (MOST_LATE / period.max(1e-6)).round() as i64;
    let step = (most / 60).max(1);
    (-most / step..=most / step).map(move |k| k * step)
}

/// Coefficients of columns, and the sum of squares that they leave.
pub(super) fn least_squares(columns: &[&[f64]], torque: &[f64]) -> (DVector<f64>, f64) {
    let dot = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
    let n = columns.len();
    if n == 0 {
        return (DVector::zeros(0), dot(torque, torque));
    }
    let normal = DMatrix::from_fn(n, n, |r, c| dot(columns[r], columns[c]));
    let right = DVector::from_fn(n, |r, _| dot(columns[r], torque));
    // Columns that are one another's multiples share what they explain.
    let least = 1e-12 * normal.diagonal().amax();
    let found = normal.svd(true, true).solve(&right, least);
    let found = found.unwrap_or_else(|_| DVector::zeros(n));
    let left = dot(torque, torque) - right.dot(&found);
    (found, left.max(0.0))
}
