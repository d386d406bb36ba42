//! The limit of a drive that reports more torque than it gives, told by the windows below it.
//!
//! What such a drive reports beyond its limit is whatever the controller asks for: a few windows with errors of any size, which a
//! least-squares fit follows. So windows whose error is an outlier are left out and the model is fitted again, until the rest is a
//! model's and its noise. If the drive has a limit, then what that model says of the windows left out, which it has not seen, is the
//! same torque again and again, its largest, whatever was reported.

use proprio_core::effect::EffectKind;

use super::fit::{How, LimbFit};
use crate::equation::values::Values;

/// An error is an outlier beyond so many standard deviations, as the median of all tells them.
const OUTLIER: f64 = 5.0;
/// Median of |x| over its standard deviation where x is normal.
const MEDIAN: f64 = 0.6745;
/// Times that outliers are left out, and that the limit is found anew.
const ROUNDS: usize = 6;
/// Fewer windows beyond a limit tell none.
const LEAST_WINDOWS: usize = 8;
/// Most of the windows that may be left out: a model is not told by less than half of a log.
const MOST_OUT: f64 = 0.5;
/// Of the outliers at least this share is beyond the limit: others are not a drive's.
const LEAST_BEYOND: f64 = 0.8;
/// Beyond the limit the motion takes the same torque within this share of it: half of the windows there do. A window that the limit was
/// reached in shows a mean of less.
const ALIKE: f64 = 0.15;
/// A limit that moves by less than this share stays.
const SAME: f64 = 0.01;
/// What is not known of the bodies' scale, a share: the windows beyond the limit are those with the largest torques.
const SCALE: f64 = 0.02;
/// Share of the other windows whose torque exceeds the limit at most.
const MOST_ABOVE: f64 = 0.01;

/// A limit that was found.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Limit {
    /// Its torque, N m, and its standard deviation.
    pub(crate) torque: f64,
    pub(crate) std: f64,
    /// The limb's model as the windows below it have it, with the limit in it.
    pub(crate) values: Values,
}

impl Limit {
    /// The limit of a joint whose drive a fit, which predicts so, takes to give what it reports; `None` if there is none that these data
    /// tell.
    pub(crate) fn of(fit: &LimbFit, predicted: &[f64], joint: usize) -> Option<Self> {
        let n = fit.data.joints();
        let counted: Vec<usize> = (0..fit.data.motion.windows.len())
            .filter(|&w| fit.data.counts(w, joint))
            .collect();
        let reported = |w: usize| fit.data.torque[w * n + joint];
        let (mut values, mut predicted) = (fit.values.clone(), predicted.to_vec());
        let mut out: Vec<usize> = Vec::new();
        for _ in 0..ROUNDS {
            let error = |w: usize| (reported(w) - predicted[w * n + joint]).abs();
            let most = OUTLIER * median(counted.iter().map(|&w| error(w)))? / MEDIAN;
            let found: Vec<usize> = counted
                .iter()
                .copied()
                .filter(|&w| error(w) > most)
                .collect();
            if found == out {
                break;
            }
            out = found;
            if out.len() < LEAST_WINDOWS || out.len() as f64 > MOST_OUT * counted.len() as f64 {
                return None;
            }
            (values, predicted) = without(fit, &values, &out)?;
        }
        let is_beyond = |predicted: &[f64], w: usize| {
            let given = predicted[w * n + joint];
            reported(w) * given > 0.0 && reported(w).abs() > given.abs()
        };
        let beyond: Vec<usize> = (out.iter().copied())
            .filter(|&w| is_beyond(&predicted, w))
            .collect();
        if beyond.len() < LEAST_WINDOWS || (beyond.len() as f64) < LEAST_BEYOND * out.len() as f64 {
            return None;
        }
        // Windows a little beyond the limit are no outliers, but say as little of the model.
        let at = |predicted: &[f64]| median(beyond.iter().map(|&w| predicted[w * n + joint].abs()));
        let mut torque = at(&predicted)?;
        for _ in 0..ROUNDS {
            let most = torque;
            out = (counted.iter().copied())
                .filter(|&w| reported(w).abs() > most)
                .collect();
            if out.len() as f64 > MOST_OUT * counted.len() as f64 {
                return None;
            }
            (values, predicted) = without(fit, &values, &out)?;
            torque = at(&predicted)?;
            if (torque - most).abs() < SAME * most {
                break;
            }
        }
        let given = |w: usize| predicted[w * n + joint].abs();
        let spread = median(beyond.iter().map(|&w| (given(w) - torque).abs()))?;
        let rest = || counted.iter().filter(|w| !out.contains(w));
        let above = rest().filter(|&&w| given(w) > (1.0 + ALIKE) * torque);
        if spread > ALIKE * torque || above.count() as f64 > MOST_ABOVE * counted.len() as f64 {
            return None;
        }
        let excess = beyond.iter().map(|&w| reported(w).abs() - torque);
        let excess = excess.sum::<f64>() / beyond.len() as f64;
        let place = (EffectKind::Saturation, joint);
        values.insert(place);
        values.set(place, 0, torque);
        values.set(place, 1, excess);
        Some(Self {
            torque,
            // A median's is 1.25 times a mean's; windows in a row say the same.
            std: (1.25 * spread / MEDIAN / (runs(&beyond) as f64).sqrt()).hypot(SCALE * torque),
            values,
        })
    }
}

/// A fit's model fitted again without some windows, and what it predicts in all of them.
fn without(fit: &LimbFit, values: &Values, out: &[usize]) -> Option<(Values, Vec<f64>)> {
    let mut left_out = fit.data.left_out.clone();
    for &w in out {
        left_out[w] = true;
    }
    let data = fit.data.clone().leaving_out(&left_out);
    let how = How {
        start: Some(values.clone()),
        shapes: Some(Vec::new()),
        hold_bodies: true,
        passes: Some(2),
        ..How::default()
    };
    let values = LimbFit::of(&data, &fit.places, &how)?.values;
    let predicted = fit.data.predicted(&values, &|_| true);
    Some((values, predicted))
}

/// `None` of none.
fn median(x: impl Iterator<Item = f64>) -> Option<f64> {
    let mut x: Vec<f64> = x.collect();
    let middle = x.len() / 2;
    (middle < x.len()).then(|| *x.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// How many runs of neighbours.
fn runs(windows: &[usize]) -> usize {
    let new = windows.windows(2).filter(|pair| pair[1] > pair[0] + 1);
    1 + new.count()
}
