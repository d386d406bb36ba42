//! A joint whose frame stands elsewhere than the description has it, by what that does to the torque.
//!
//! A link that is longer than the description has it, or an axis that is not where it should be, moves weight and inertia as the joints
//! move. The torque's derivative by a joint's frame is a difference of two predictions; what the bodies, priors included, can take of it is
//! projected out, and the frame is sought by Gauss-Newton: turned about its axes, or displaced along them. Most of that a body takes as well,
//! or the joint's zero; poses of the end effector measure the same numbers far better (`calibrate`, [`crate::kinematics`]).
//!
//! The first joint's frame is left out: turned, it is the base's tilt.

use nalgebra::Vector3;

use crate::equation::values::Place;
use crate::estimate::added_variables::LeftOver;
use crate::estimate::fit::{How, LimbFit};
use crate::estimate::limb_data::{LimbData, Squares};
use crate::model::{JointQuantity, Model};
use crate::parallel::by_number;
use crate::select::criteria::step::explains_most;

/// What is known of a frame before data, one standard deviation: a hand-measured description is off by some degrees and cm, and more than three of
/// them is another robot.
const TURN: f64 = 0.05;
const SHIFT: f64 = 0.02;
/// Half the distance of the two predictions of a derivative, in units of what is known: their second difference is then a ten-thousandth.
const STEP: f64 = 0.02;
/// Times that the frame is moved and derivatives are made anew: an angle of 0.1 rad is then left open by 1e-6.
const ROUNDS: usize = 3;
/// Frames that are sought, of those whose derivatives promise no less than this share of what the best promises: far from where it is, a frame is
/// told from another by its second derivatives.
const MOST_SOUGHT: usize = 3;
const AS_GOOD: f64 = 0.5;
/// A frame that is fewer of its standard deviations off is none: of normal errors one in two million, and a robot has tens of frames.
const LEAST: f64 = 5.0;

/// How a frame is moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Move {
    Turned,
    Displaced,
}

impl Move {
    fn size(self) -> f64 {
        match self {
            Self::Turned => TURN,
            Self::Displaced => SHIFT,
        }
    }

    fn quantity(self, axis: usize) -> JointQuantity {
        match self {
            Self::Turned => JointQuantity::Turn(axis),
            Self::Displaced => JointQuantity::Shift(axis),
        }
    }

    /// The model with a joint's frame moved along its own axes, m or rad.
    fn applied(self, model: &Model, joint: usize, by: &Vector3<f64>) -> Model {
        model.with_frame_moved(joint, [0, 1, 2].map(|n| (self.quantity(n), by[n])))
    }
}

/// A joint's frame that is not where the model has it.
#[derive(Debug, Clone)]
pub(crate) struct OtherFrame {
    /// The joint, among all of the robot's.
    pub(crate) joint: usize,
    how: Move,
    /// How far it is off along its own axes, and the standard deviations of that, m or rad.
    by: Vector3<f64>,
    std: Vector3<f64>,
}

impl OtherFrame {
    /// Whether it is turned, and not displaced.
    pub(crate) fn is_turned(&self) -> bool {
        self.how == Move::Turned
    }

    /// How far it is off, and the standard deviation, m or rad.
    pub(crate) fn size(&self) -> [f64; 2] {
        let size = self.by.norm();
        let direction = self.by / size.max(f64::MIN_POSITIVE);
        [size, direction.component_mul(&self.std).norm()]
    }

    /// What is to be corrected of the joint's frame, each with its value and standard deviation.
    pub(crate) fn quantities(&self) -> impl Iterator<Item = (JointQuantity, f64, f64)> + '_ {
        (0..3).map(|n| (self.how.quantity(n), self.by[n], self.std[n]))
    }

    /// The model with the frame where it is, to the last digit.
    pub(crate) fn applied(&self, model: &Model) -> Model {
        self.how.applied(model, self.joint, &self.by)
    }
}

/// A limb's fit under a model.
struct Fitted<'a> {
    fit: LimbFit<'a>,
    predicted: Vec<f64>,
}

impl<'a> Fitted<'a> {
    fn of(data: &'a LimbData<'a>, places: &[Place], how: &How) -> Option<Self> {
        let fit = LimbFit::of(data, places, how)?;
        let predicted = fit.predicted();
        Some(Self { fit, predicted })
    }

    fn left(&self, chosen: &dyn Fn(usize) -> bool) -> Option<LeftOver> {
        LeftOver::of_windows(&self.fit, &self.predicted, chosen)
    }

    /// What the predicted torque changes by along each of a joint's axes, N m per unit of what is known, in these windows of all.
    fn derivatives(&self, joint: usize, how: Move, windows: &[usize]) -> Option<Vec<Vec<f64>>> {
        let data = self.fit.data;
        let n = data.joints();
        let mut chosen = vec![false; data.motion.windows.len()];
        windows.iter().for_each(|&w| chosen[w] = true);
        let body = data.body_of(joint);
        let at = |by: Vector3<f64>| -> Option<Vec<f64>> {
            let model = how.applied(data.model, body, &by);
            let moved = data.with_geometry(&model)?;
            Some(moved.predicted(&self.fit.values, &|w| chosen[w]))
        };
        let slope = |axis: usize| -> Option<Vec<f64>> {
            let step = Vector3::ith(axis, STEP * how.size());
            let [more, less] = [at(step)?, at(-step)?];
            let of = |k: usize| (more[k] - less[k]) / (2.0 * STEP);
            let all = windows.iter().flat_map(|w| w * n..(w + 1) * n);
            Some(all.map(of).collect())
        };
        (0..3).map(slope).collect()
    }
}

/// The frame of a limb's joint that explains most of what effects at `places` leave, and the limb's held-out squares with it; none if no frame is surely
/// elsewhere, or if its derivatives are far from bringing the squares down to these.
pub(crate) fn other(
    data: &LimbData,
    places: &[Place],
    how: &How,
    goal: &Squares,
) -> Option<(OtherFrame, Squares)> {
    let start = Fitted::of(data, places, how)?;
    let left = start.left(&|_| true)?;
    let moves = [Move::Turned, Move::Displaced];
    let all: Vec<(usize, Move)> = (1..data.joints())
        .flat_map(|joint| moves.map(|how| (joint, how)))
        .collect();
    let promised = by_number(0..all.len(), |n| {
        let (joint, how) = all[n];
        let slopes = start.derivatives(joint, how, &left.windows)?;
        let step = left.coefficients(&slopes, &[0.0; 3], data.joints())?;
        Some((step.fall, all[n]))
    });
    let mut promised: Vec<(f64, (usize, Move))> = promised.into_iter().flatten().collect();
    promised.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (most, _) = *promised.first()?;
    // Derivatives promise less than a frame that is far off takes, and most of it where it is the cause.
    let left =
        [&data.squares(&start.predicted), goal].map(|squares| squares.weighted(&start.fit.noise));
    if !explains_most(left[0], left[0] - most, left[1]) {
        return None;
    }
    let may_be = promised.iter().filter(|(fall, _)| *fall >= AS_GOOD * most);
    let sought = may_be
        .take(MOST_SOUGHT)
        .filter_map(|(_, own)| sought(data, places, how, *own));
    let left = |(_, squares): &(OtherFrame, Squares)| squares.weighted(&start.fit.noise);
    sought.min_by(|a, b| left(a).total_cmp(&left(b)))
}

/// A joint's frame where the data have it, and the limb's held-out squares with it; none if it is not surely elsewhere.
fn sought(
    data: &LimbData,
    places: &[Place],
    how: &How,
    (joint, moved): (usize, Move),
) -> Option<(OtherFrame, Squares)> {
    let body = data.body_of(joint);
    // In units of what is known.
    let mut by = Vector3::zeros();
    for round in 0..=ROUNDS {
        let model = moved.applied(data.model, body, &(by * moved.size()));
        let own = data.with_geometry(&model)?;
        let fitted = Fitted::of(&own, places, how)?;
        let left = fitted.left(&|_| true)?;
        let slopes = fitted.derivatives(joint, moved, &left.windows)?;
        let step = left.coefficients(&slopes, by.as_slice(), data.joints())?;
        if round < ROUNDS {
            by += Vector3::from_column_slice(&step.by);
            continue;
        }
        // How each fold's absence moves it: what its windows are predicted with, and the jackknife's deviation.
        let folds = data.blocks.folds;
        let windows: Vec<usize> = (0..data.motion.windows.len()).collect();
        let slopes = fitted.derivatives(joint, moved, &windows)?;
        let without = by_number(0..folds, |fold| {
            let left = fitted.left(&|w| data.fold(w) != fold)?;
            let chosen: Vec<Vec<f64>> = (slopes.iter())
                .map(|slope| left.chosen(slope, data.joints()))
                .collect();
            Some(left.coefficients(&chosen, by.as_slice(), data.joints())?.by)
        });
        let without: Vec<Vec<f64>> = without.into_iter().collect::<Option<_>>()?;
        let n = data.joints();
        let mut predicted = fitted.fit.predicted_held_out()?;
        for (k, predicted) in predicted.iter_mut().enumerate() {
            let steps = without[data.fold(k / n)].iter();
            *predicted += steps
                .zip(&slopes)
                .map(|(x, slope)| x * slope[k])
                .sum::<f64>();
        }
        let frame = OtherFrame {
            joint: body,
            how: moved,
            by: by * moved.size(),
            std: Vector3::from_column_slice(&step.std).sup(&jackknife(&without)) * moved.size(),
        };
        let [size, std] = frame.size();
        return (size >= LEAST * std).then(|| (frame, own.squares(&predicted)));
    }
    None
}

/// Standard deviations of three numbers from what they are without each fold.
fn jackknife(without: &[Vec<f64>]) -> Vector3<f64> {
    let count = without.len() as f64;
    Vector3::from_fn(|k, _| {
        let mean = without.iter().map(|own| own[k]).sum::<f64>() / count;
        let squares: f64 = without.iter().map(|own| (own[k] - mean).powi(2)).sum();
        ((count - 1.0) / count * squares).sqrt()
    })
}
