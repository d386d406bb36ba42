//! What a black box could still take away: how far a model's error falls if something that knows no physics is shown more and more of
//! the motion. It says where to look for what is missing, and how much there is to be found.
//!
//! What a model leaves of a joint's torque is regressed on functions of what the joint does at that moment, then of what the other joints
//! of its limb do as well, then of what came before (`probes.rs`): position, velocity, acceleration and the torque that the model
//! predicts, never the measured one. Each fold is predicted by the others (ridge regression, Hoerl & Kennard 1970, *Technometrics* 12:55;
//! how much it is shrunk, and whether what a box sees more is used at all, is decided by the folds that are not judged: where it helps
//! them beyond the error of that).

pub(super) mod probes;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::estimate::limb_data::LimbData;
use crate::parallel::side_by_side;
use crate::select::criteria::sum_and_error;

/// Shrinkage that is tried, in units of the number of windows: probes have unit variance.
const SHRINKAGE: [f64; 4] = [3e-3, 3e-2, 0.3, 3.0];
/// Fewer windows of a joint for each probe tell nothing.
const LEAST_WINDOWS: usize = 3;
/// A box is enough if all that a larger one takes away more is less than this share.
const ENOUGH: f64 = 0.8;

/// What a box is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Inputs {
    /// The joint's own motion at that moment.
    Joint,
    /// That of the other joints of its limb as well.
    Limb,
    /// And what came before.
    Past,
}

impl Inputs {
    /// Beside a bar.
    pub fn in_short(self) -> &'static str {
        match self {
            Self::Joint => "own motion",
            Self::Limb => "+ limb's",
            Self::Past => "+ the past",
        }
    }
}

/// What is shown, one after the other.
const ALL: [Inputs; 3] = [Inputs::Joint, Inputs::Limb, Inputs::Past];

/// A model's error with what a black box takes away of it, on data that neither has seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rung {
    /// What the box is shown.
    pub sees: Inputs,
    /// Root mean square over the windows of all joints, N m.
    pub rms: f64,
    /// Standard error of what it takes away, from the spread over folds, N m.
    pub std: f64,
}

/// Of a model's error what black boxes take away.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BlackBox {
    /// The model's error in the windows that the boxes judge, N m.
    pub rms: f64,
    /// Each box sees more than the one before.
    pub rungs: Vec<Rung>,
}

impl BlackBox {
    /// Of limbs whose model predicts so: mean torque of each window and joint, N m. `None` where too little can be held out.
    pub(crate) fn of(data: &[LimbData], predicted: &[&[f64]]) -> Option<Self> {
        let joints: Vec<(usize, usize)> = (data.iter().enumerate())
            .flat_map(|(limb, data)| (0..data.joints()).map(move |joint| (limb, joint)))
            .collect();
        let of = |&(limb, joint): &(usize, usize)| {
            let all = vec![1.0; data[limb].left_out.len()];
            Joint::of(&data[limb], predicted[limb], joint, &all)
        };
        let joints: Vec<Joint> = side_by_side(&joints, of).into_iter().flatten().collect();
        let windows: f64 = joints.iter().map(|joint| joint.windows).sum();
        let folds = joints.iter().map(|joint| joint.left.len()).max()?;
        let sum = |of: &dyn Fn(&[f64; 4]) -> f64| -> Vec<f64> {
            let fold = |f: usize| joints.iter().filter_map(|j| j.left.get(f)).map(of).sum();
            (0..folds).map(fold).collect()
        };
        let rms = |squares: f64| (squares / windows).sqrt();
        let before = sum(&|left| left[0]).iter().sum::<f64>();
        let rung = |(n, &sees): (usize, &Inputs)| {
            let (taken, error) = sum_and_error(&sum(&|left| left[0] - left[n + 1]));
            let after = rms((before - taken).max(0.0));
            Rung {
                sees,
                rms: after,
                // Of a root: half the error of the square over the root.
                std: error / windows / (2.0 * after.max(f64::MIN_POSITIVE)),
            }
        };
        Some(Self {
            rms: rms(before),
            rungs: ALL.iter().enumerate().map(rung).collect(),
        })
    }
}

impl BlackBox {
    /// The least error of all boxes, N m.
    pub(crate) fn lowest(&self) -> f64 {
        self.rungs
            .iter()
            .map(|rung| rung.rms)
            .fold(self.rms, f64::min)
    }

    /// Whether its last rung is known to better than half of itself: a bound of 0.2 ± 4.4 N m bounds nothing.
    pub(crate) fn is_known(&self) -> bool {
        self.rungs
            .last()
            .is_some_and(|rung| rung.std < 0.5 * rung.rms)
    }
}

/// What a black box takes away of a joint's error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Explained {
    /// The share of the squared error, and its standard error from the spread over folds.
    pub(crate) share: f64,
    pub(crate) std: f64,
    /// The box that sees least of those that take all but a fifth of it.
    pub(crate) sees: Inputs,
}

impl Explained {
    /// Of a joint of a limb whose model predicts so, where each window that counts is by so many times its noise more in `doubt`: the less, the surer it
    /// is. `None` where too little can be held out, or nothing is left.
    pub(crate) fn of(
        data: &LimbData,
        predicted: &[f64],
        joint: usize,
        doubt: &[f64],
    ) -> Option<Self> {
        let mut sure = vec![0.0; data.left_out.len()];
        let counting = (0..sure.len()).filter(|&w| data.counts(w, joint));
        for (w, doubt) in counting.zip(doubt) {
            sure[w] = 1.0 / doubt.hypot(1.0);
        }
        let joint = Joint::of(data, predicted, joint, &sure)?;
        let before: f64 = joint.left.iter().map(|left| left[0]).sum();
        let taken =
            |n: usize| -> Vec<f64> { joint.left.iter().map(|left| left[0] - left[n]).collect() };
        let (most, error) = sum_and_error(&taken(ALL.len()));
        let enough = |n: &usize| sum_and_error(&taken(n + 1)).0 >= ENOUGH * most;
        (before > 0.0).then(|| Self {
            share: most / before,
            std: error / before,
            sees: ALL[(0..ALL.len()).find(enough).unwrap_or(ALL.len() - 1)],
        })
    }
}

/// A joint's squared errors.
struct Joint {
    /// How many windows, as sure as they are.
    windows: f64,
    /// Of each fold: without a box and with each, (N m)².
    left: Vec<[f64; 4]>,
}

/// A fold's normal equations.
#[derive(Clone)]
struct Normal {
    products: DMatrix<f64>,
    moments: DVector<f64>,
    square: f64,
    windows: f64,
}

impl Normal {
    fn new(probes: usize) -> Self {
        Self {
            products: DMatrix::zeros(probes, probes),
            moments: DVector::zeros(probes),
            square: 0.0,
            windows: 0.0,
        }
    }

    /// Of probes, window by window, what a model leaves there, and how many windows they are worth.
    fn of(probes: &DMatrix<f64>, left: &DVector<f64>, windows: f64) -> Self {
        Self {
            products: probes * probes.transpose(),
            moments: probes * left,
            square: left.norm_squared(),
            windows,
        }
    }

    /// The first `count` weights of the data that are not `held_out`; `None` if they are not finite.
    fn weights(&self, held_out: &Self, count: usize, shrinkage: f64) -> Option<DVector<f64>> {
        let of = |normal: &Self| normal.products.view((0, 0), (count, count)).into_owned();
        let mut products = of(self) - of(held_out);
        let shrink = shrinkage * (self.windows - held_out.windows);
        (0..count).for_each(|k| products[(k, k)] += shrink);
        let moments = self.moments.rows(0, count) - held_out.moments.rows(0, count);
        Some(products.cholesky()?.solve(&moments))
    }

    /// The sum of squares that weights leave.
    fn left(&self, weights: &DVector<f64>) -> f64 {
        let count = weights.len();
        let products = self.products.view((0, 0), (count, count));
        let square = self.square - 2.0 * weights.dot(&self.moments.rows(0, count))
            + weights.dot(&(products * weights));
        square.max(0.0)
    }
}

impl Joint {
    /// Each window's row times how `sure` it is.
    fn of(data: &LimbData, predicted: &[f64], joint: usize, sure: &[f64]) -> Option<Self> {
        let (n, folds) = (data.joints(), data.blocks.folds);
        if !data.blocks.can_hold_out() {
            return None;
        }
        let probes = probes::of(data, predicted, joint);
        let count = probes.seen.last().copied()?;
        if probes.windows.len() < LEAST_WINDOWS * count {
            return None;
        }
        let of_fold: Vec<Normal> = (0..folds)
            .map(|fold| {
                let own = probes.windows.iter().zip(&probes.values);
                let (mut values, mut left, mut worth) = (Vec::new(), Vec::new(), 0.0);
                for (&w, x) in own.filter(|(w, _)| data.fold(**w) == fold) {
                    let k = w * n + joint;
                    values.extend(x.iter().map(|x| x * sure[w]));
                    left.push((data.torque[k] - predicted[k]) * sure[w]);
                    worth += sure[w].powi(2);
                }
                let values = DMatrix::from_vec(count, left.len(), values);
                Normal::of(&values, &DVector::from_vec(left), worth)
            })
            .collect();
        let mut all = Normal::new(count);
        for normal in &of_fold {
            all.products += &normal.products;
            all.moments += &normal.moments;
            all.square += normal.square;
            all.windows += normal.windows;
        }
        let without: Vec<f64> = of_fold.iter().map(|normal| normal.square).collect();
        let mut left: Vec<[f64; 4]> = without.iter().map(|square| [*square; 4]).collect();
        // For each fold the box that the others choose, by what it leaves of every fold.
        let mut chosen = vec![without; folds];
        for (rung, &seen) in probes.seen.iter().enumerate() {
            let of = |shrinkage: f64| -> Option<Vec<f64>> {
                let left =
                    |normal: &Normal| Some(normal.left(&all.weights(normal, seen, shrinkage)?));
                of_fold.iter().map(left).collect()
            };
            let tried: Vec<Vec<f64>> = SHRINKAGE.into_iter().filter_map(of).collect();
            for (fold, chosen) in chosen.iter_mut().enumerate() {
                let others = |squares: &[f64]| squares.iter().sum::<f64>() - squares[fold];
                let best = tried
                    .iter()
                    .min_by(|a, b| others(a).total_cmp(&others(b)))?;
                if is_better(best, chosen, fold) {
                    chosen.clone_from(best);
                }
                left[fold][rung + 1] = chosen[fold];
            }
        }
        Some(Self {
            windows: all.windows,
            left,
        })
    }
}

/// Whether a box leaves less than another one in all folds but one, beyond the error of that.
fn is_better(squares: &[f64], known: &[f64], but: usize) -> bool {
    let others = (squares.iter().zip(known).enumerate()).filter(|(fold, _)| *fold != but);
    let gains: Vec<f64> = others.map(|(_, (after, before))| before - after).collect();
    let (gain, error) = sum_and_error(&gains);
    gain > error
}

#[cfg(test)]
mod tests;
