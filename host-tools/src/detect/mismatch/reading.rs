//! A limb's log beside what the model gives and the plainest friction.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};

use proprio_core::spatial::Transform;
use proprio_core::tree::GRAVITY;

use crate::equation::dot::dot;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::model::{Limb, Model};
use crate::parallel::{by_number, side_by_side};
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
    /// Gravity in the base's axes as the model has it, m/s².
    pub(super) gravity: Vector3<f64>,
}

/// A joint's windows in which it moves.
pub(super) struct JointReading {
    pub(super) name: String,
    /// Mean torque measured, N m.
    pub(super) torque: Vec<f64>,
    /// The share that is left of the torque so many samples later, across gaps too, which are few.
    pub(super) left_at: BTreeMap<i64, f64>,
    /// What the model gives, its bodies and the effects that have a value, N m.
    pub(super) predicted: Vec<f64>,
    /// What of it gravity gives, N m.
    pub(super) weight: Vec<f64>,
    /// What gravity of 1 m/s² along the base's x, y and z gives, N m.
    pub(super) by_gravity: [Vec<f64>; 3],
    /// What of it centrifugal and Coriolis forces give, N m.
    pub(super) centrifugal: Vec<f64>,
    /// Mean velocity (rad/s), mean direction (−1 to 1), mean acceleration (rad/s²).
    friction: [Vec<f64>; 3],
    /// Their scalar products.
    products: [[f64; 3]; 3],
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
        let parts = Parts::of(&data);
        let names = data.joint_names();
        let joints = by_number(0..names.len(), |j| {
            JointReading::of(&data, j, names[j].clone(), (&predicted, &parts), &times)
        });
        let joints = joints.into_iter();
        let joints = joints.filter(|joint| joint.torque.len() >= LEAST_WINDOWS);
        Some(Self {
            joints: joints.collect(),
            period,
            gravity: parts.gravity,
        })
    }
}

impl JointReading {
    fn of(
        data: &LimbData,
        j: usize,
        name: String,
        (predicted, parts): (&[f64], &Parts),
        times: &[i64],
    ) -> Self {
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
        let velocity = |k: usize| samples.dq[k * n + j];
        let acceleration = windows.iter().map(|w| {
            let window = &motion.windows[*w];
            let [first, last] = window.samples;
            (velocity(last) - velocity(first)) / window.length
        });
        let friction = [
            mean(&velocity),
            mean(&|k| velocity(k).signum()),
            acceleration.collect(),
        ];
        let product = |a: usize, b: usize| dot(&friction[a], &friction[b]);
        let mut own = Self {
            name,
            torque: mean(&|k| samples.tau[k * n + j]),
            left_at: BTreeMap::new(),
            predicted: windows.iter().map(|w| predicted[w * n + j]).collect(),
            weight: windows.iter().map(|w| parts.weight(w * n + j)).collect(),
            by_gravity: (parts.by_gravity.each_ref())
                .map(|own| windows.iter().map(|w| own[w * n + j]).collect()),
            centrifugal: windows
                .iter()
                .map(|w| parts.centrifugal[w * n + j])
                .collect(),
            products: [0, 1, 2].map(|a| [0, 1, 2].map(|b| product(a, b))),
            friction,
        };
        let torque: Vec<f64> = samples.tau.iter().skip(j).step_by(n).copied().collect();
        let late = Late::of(&torque, data, &windows, times);
        let left = |shift: &i64| (*shift, own.left_of(&late.torque(*shift), 1.0));
        own.left_at = side_by_side(times, left).into_iter().collect();
        own
    }

    /// Share of the torque's square that model and friction leave.
    pub(super) fn left(&self) -> f64 {
        self.left_of(&self.torque, 1.0)
    }

    /// The same of another torque, which is the model's so many times.
    pub(super) fn left_of(&self, torque: &[f64], times: f64) -> f64 {
        self.left_by(torque, times, &self.predicted)
    }

    /// The same of the torque that was measured, where the bodies give another one.
    pub(super) fn left_beside(&self, predicted: &[f64]) -> f64 {
        self.left_by(&self.torque, 1.0, predicted)
    }

    /// A torque without what friction explains of it: what is left where columns' shares of it are taken away, friction of any sign.
    pub(super) fn without_friction(&self, x: &[f64]) -> Vec<f64> {
        let columns = self.friction.each_ref().map(Vec::as_slice);
        let (found, _) = least_squares(&columns, x);
        let mut left = x.to_vec();
        for (column, size) in columns.iter().zip(found.iter()) {
            left.iter_mut()
                .zip(*column)
                .for_each(|(x, c)| *x -= size * c);
        }
        left
    }

    /// Share of the torque's square that model, friction of any sign and a constant torque leave.
    pub(super) fn left_with_offset(&self) -> f64 {
        let beyond = self.torque.iter().zip(&self.predicted).map(|(x, p)| x - p);
        let beyond: Vec<f64> = beyond.collect();
        let constant = vec![1.0; beyond.len()];
        let friction = self.friction.iter().map(Vec::as_slice);
        let columns: Vec<&[f64]> = friction.chain([constant.as_slice()]).collect();
        let (_, left) = least_squares(&columns, &beyond);
        left / dot(&self.torque, &self.torque).max(f64::MIN_POSITIVE)
    }

    fn left_by(&self, torque: &[f64], times: f64, predicted: &[f64]) -> f64 {
        let total = dot(torque, torque);
        let beyond: Vec<f64> = (torque.iter().zip(predicted))
            .map(|(x, p)| x / times - p)
            .collect();
        let right: Vec<f64> = self.friction.iter().map(|x| dot(x, &beyond)).collect();
        let square = dot(&beyond, &beyond);
        let mut there: Vec<usize> = (0..right.len()).collect();
        // What would have to be negative is not there.
        loop {
            let count = there.len();
            let normal = DMatrix::from_fn(count, count, |r, c| self.products[there[r]][there[c]]);
            let told = DVector::from_fn(count, |r, _| right[there[r]]);
            let (found, left) = solved(normal, &told, square);
            let worst = (0..count).min_by(|a, b| found[*a].total_cmp(&found[*b]));
            match worst.filter(|k| found[*k] < 0.0) {
                Some(k) => drop(there.remove(k)),
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

/// What parts of the bodies' torque are, window by window, joint by joint, N m, by the motion in the window's middle.
struct Parts {
    gravity: Vector3<f64>,
    by_gravity: [Vec<f64>; 3],
    centrifugal: Vec<f64>,
}

impl Parts {
    fn of(data: &LimbData) -> Self {
        let (n, samples, motion) = (data.joints(), data.recording, &data.motion);
        let values = Values::given(data.model, data.limb);
        let body = data.body.loaded(&values);
        let base = data.body.base(&values);
        let at = |w: usize| {
            let [first, last] = motion.windows[w].samples;
            let middle = (first + last) / 2 * n;
            middle..middle + n
        };
        let zero = vec![0.0; n];
        let torque = |base: &Transform<f64>, w: usize, dq: &[f64]| {
            let mut torque = vec![0.0; n];
            body.inverse_dynamics(base, [&samples.q[at(w)], dq, &zero], &mut torque);
            torque
        };
        let windows = || 0..motion.windows.len();
        let weight = |base: &Transform<f64>| -> Vec<f64> {
            windows().flat_map(|w| torque(base, w, &zero)).collect()
        };
        let along = |axis: usize| {
            let base = Transform {
                rotation: falling_along(axis),
                translation: base.translation,
            };
            weight(&base).into_iter().map(|x| x / GRAVITY).collect()
        };
        let moving = windows().flat_map(|w| torque(&base, w, &samples.dq[at(w)]));
        let centrifugal = moving.zip(weight(&base)).map(|(all, weight)| all - weight);
        Self {
            gravity: base.rotation.transpose() * Vector3::new(0.0, 0.0, -GRAVITY),
            by_gravity: [along(0), along(1), along(2)],
            centrifugal: centrifugal.collect(),
        }
    }

    fn weight(&self, at: usize) -> f64 {
        (0..3)
            .map(|axis| self.gravity[axis] * self.by_gravity[axis][at])
            .sum()
    }
}

/// The attitude of a base along whose axis gravity acts.
fn falling_along(axis: usize) -> Matrix3<f64> {
    let mut along = Vector3::zeros();
    along[axis] = 1.0;
    let turn = Rotation3::rotation_between(&along, &-Vector3::z());
    // Opposite ones are half a turn about any axis across them apart.
    let half = || Rotation3::from_axis_angle(&Vector3::x_axis(), PI);
    *turn.unwrap_or_else(half).matrix()
}

/// Shifts in samples at which a torque may be late or early.
pub(super) fn shifts(period: f64) -> impl Iterator<Item = i64> {
    let most = (MOST_LATE / period.max(1e-6)).round() as i64;
    let step = (most / 60).max(1);
    (-most / step..=most / step).map(move |k| k * step)
}

/// A joint's torque at other times than that at which it was measured, window by window.
struct Late<'a> {
    /// N m, sample by sample, the first and the last as often again as it may be late.
    torque: Vec<f64>,
    most: usize,
    /// Half of the time since the sample before, s.
    half: Vec<f64>,
    data: &'a LimbData<'a>,
    windows: &'a [usize],
}

impl<'a> Late<'a> {
    fn of(torque: &[f64], data: &'a LimbData, windows: &'a [usize], times: &[i64]) -> Self {
        let most = times
            .iter()
            .map(|shift| shift.unsigned_abs() as usize)
            .max();
        let most = most.unwrap_or(0);
        let repeat = |x: Option<&f64>| vec![x.copied().unwrap_or(0.0); most];
        let time = &data.motion.time;
        let half = time.windows(2).map(|pair| 0.5 * (pair[1] - pair[0]));
        Self {
            torque: [&repeat(torque.first()), torque, &repeat(torque.last())].concat(),
            most,
            half: std::iter::once(0.0).chain(half).collect(),
            data,
            windows,
        }
    }

    /// The mean torque of each window so many samples later, N m.
    fn torque(&self, shift: i64) -> Vec<f64> {
        let begin = (self.most as i64 + shift) as usize;
        let mean = |w: &usize| {
            let window = &self.data.motion.windows[*w];
            let [first, last] = window.samples;
            let torque = &self.torque[begin + first..=begin + last];
            let half = &self.half[first + 1..=last];
            let steps = half.iter().zip(torque.windows(2));
            let sum: f64 = steps.map(|(half, pair)| half * (pair[0] + pair[1])).sum();
            sum / window.length
        };
        self.windows.iter().map(mean).collect()
    }
}

/// Coefficients of columns, and the sum of squares that they leave.
pub(super) fn least_squares(columns: &[&[f64]], torque: &[f64]) -> (DVector<f64>, f64) {
    let n = columns.len();
    let normal = DMatrix::from_fn(n, n, |r, c| dot(columns[r], columns[c]));
    let right = DVector::from_fn(n, |r, _| dot(columns[r], torque));
    solved(normal, &right, dot(torque, torque))
}

/// The same by the columns' scalar products with each other and with a torque, and that of the torque with itself.
fn solved(normal: DMatrix<f64>, right: &DVector<f64>, square: f64) -> (DVector<f64>, f64) {
    if right.is_empty() {
        return (DVector::zeros(0), square);
    }
    // Columns that are one another's multiples share what they explain.
    let least = 1e-12 * normal.diagonal().amax();
    let found = normal.svd(true, true).solve(right, least);
    let found = found.unwrap_or_else(|_| DVector::zeros(right.len()));
    let left = square - right.dot(&found);
    (found, left.max(0.0))
}
