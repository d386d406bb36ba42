//! Means of a gear's twist and torque over the windows of a fit, and what is read off them without one.
//!
//! In a play there is no torque, and where the link comes to rest only the torque's sign matters; on its way it says nothing, so that of a
//! play only the half of the time is judged in which the torque is larger.

use std::ops::Range;

use crate::equation::hysteresis::hysteresis;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::robust::median;

/// Displacements over which friction builds up that are tried: the shortest as a share of the twist's range, each so many times the one
/// before, and how many.
const SHORTEST: f64 = 0.01;
pub(super) const LONGER: f64 = 1.2;
const DISPLACEMENTS: i32 = 30;

/// Means over windows.
pub(super) struct Windows {
    /// Twist (rad) and torque between link and motor (N m).
    pub(super) twist: Vec<f64>,
    pub(super) torque: Vec<f64>,
    /// Mean velocity of the twist, rad/s.
    pub(super) rate: Vec<f64>,
    /// Half the torque's sign.
    pub(super) side: Vec<f64>,
    /// Whether the torque is larger than it is half of the time.
    pressed: Vec<bool>,
    pub(super) fold: Vec<usize>,
    /// Displacements that are tried (rad), with the state of friction.
    pub(super) friction: Vec<(f64, Vec<f64>)>,
}

impl Windows {
    /// Of the windows that are not left out; `None` without a second encoder, or if nothing turns in some fold.
    pub(super) fn of(data: &LimbData, values: &Values, joint: usize) -> Option<Self> {
        let motion = &data.motion;
        let link = motion.link(joint)?;
        let twist: Vec<f64> = (motion.joint[joint].state.iter().zip(&link.state))
            .map(|(motor, link)| motor[0] - link[0])
            .collect();
        let load = motion.load(&data.body, values, (false, 0.0));
        let smooth = motion.smooth(&load);
        let torque = |k: usize| smooth[k * data.joints() + joint];
        let chosen: Vec<usize> = (0..motion.windows.len())
            .filter(|w| !data.left_out[*w])
            .collect();
        let mean = |x: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let of = |w: &usize| motion.mean(&motion.windows[*w], x);
            chosen.iter().map(of).collect()
        };
        let own = mean(&|k| twist[k]);
        let range = range(&own)?;
        let friction = |n: i32| {
            let displacement = SHORTEST * LONGER.powi(n) * range;
            let of = |stretch: &Range<usize>| {
                hysteresis(twist[stretch.clone()].iter().copied(), displacement)
            };
            let states: Vec<f64> = motion.stretches.iter().flat_map(of).collect();
            (displacement, mean(&|k| states[k]))
        };
        let rate = chosen.iter().map(|w| {
            let window = &motion.windows[*w];
            let [first, last] = window.samples;
            (twist[last] - twist[first]) / window.length
        });
        let pull = mean(&torque);
        let middle = median(pull.iter().map(|x| x.abs())).unwrap_or(0.0);
        let windows = Self {
            friction: (0..DISPLACEMENTS).map(friction).collect(),
            rate: rate.collect(),
            pressed: pull.iter().map(|x| x.abs() > middle).collect(),
            torque: pull,
            side: mean(&|k| 0.5 * torque(k).signum()),
            fold: chosen.iter().map(|w| data.fold(*w)).collect(),
            twist: own,
        };
        let folds = windows.by_fold(&windows.torque, &|w| windows.is_pressed(w));
        (folds.len() > 1 && folds.iter().all(|square| *square > 0.0)).then_some(windows)
    }

    /// Whether a window's torque is larger than it is half of the time.
    pub(super) fn is_pressed(&self, window: usize) -> bool {
        self.pressed[window]
    }

    /// How many folds there are.
    pub(super) fn folds(&self) -> usize {
        self.fold.iter().max().map_or(0, |most| most + 1)
    }

    /// How far the twist is from its mean, root mean square, rad.
    pub(super) fn rms(&self) -> f64 {
        let square: f64 = self.by_fold(&self.twist, &|_| true).iter().sum();
        (square / self.twist.len() as f64).sqrt()
    }

    /// How far apart the twist is on either side of a play, by medians, which a link on its way does not move; rad.
    pub(super) fn gap(&self) -> [f64; 2] {
        let middle = |side: f64, chosen: &dyn Fn(usize) -> bool| {
            let there =
                |w: &usize| chosen(self.fold[*w]) && self.pressed[*w] && self.side[*w] == side;
            let own = (0..self.fold.len()).filter(there);
            median(own.map(|w| self.twist[w])).unwrap_or(0.0)
        };
        let between = |chosen: &dyn Fn(usize) -> bool| middle(0.5, chosen) - middle(-0.5, chosen);
        let all = between(&|_| true);
        let without = (0..self.folds()).map(|fold| between(&|own| own != fold));
        [all, jackknife(all, without)]
    }

    /// Sums of squares of the chosen windows about their mean, fold by fold.
    pub(super) fn by_fold(&self, x: &[f64], chosen: &dyn Fn(usize) -> bool) -> Vec<f64> {
        let own: Vec<usize> = (0..x.len()).filter(|w| chosen(*w)).collect();
        let mean = own.iter().map(|w| x[*w]).sum::<f64>() / own.len() as f64;
        let mut squares = vec![0.0; self.folds()];
        for w in own {
            squares[self.fold[w]] += (x[w] - mean).powi(2);
        }
        squares
    }
}

/// From the least to the greatest, but for the outermost hundredths; `None` if nothing moves.
fn range(x: &[f64]) -> Option<f64> {
    let mut sorted = x.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let out = sorted.len() / 100;
    let range = sorted.get(sorted.len().checked_sub(1 + out)?)? - sorted.get(out)?;
    (range > 0.0).then_some(range)
}

/// The mean and its standard error.
pub(super) fn mean(x: &[f64]) -> (f64, f64) {
    let n = x.len() as f64;
    let mean = x.iter().sum::<f64>() / n;
    let spread: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, (spread / (n * (n - 1.0))).sqrt())
}

/// Standard deviation of a value by those that are found without each fold in turn (Efron & Stein 1981, *Ann. Statist.* 9:586).
pub(super) fn jackknife(all: f64, without: impl ExactSizeIterator<Item = f64>) -> f64 {
    let folds = without.len() as f64;
    let square: f64 = without.map(|own| (own - all).powi(2)).sum();
    ((folds - 1.0) / folds * square).sqrt()
}
