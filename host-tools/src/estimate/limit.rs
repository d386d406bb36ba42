//! The limit of a drive that reports more torque than it gives, told by the windows below it.
//!
//! What such a drive reports beyond its limit is whatever the controller asks for: a few windows with errors of any size, which a
//! least-squares fit follows. So windows whose error is an outlier are left out and the model is fitted again, until the rest is a
//! model's and its noise. If the drive has a limit, then what that model says of the windows left out, which it has not seen, is the
//! same torque again and again, its largest, whatever was reported.

use proprio_core::effect::EffectKind;

use super::limb_data::LimbData;
use crate::equation::values::Values;
use crate::robust::{MEDIAN_OF_NORMAL, median};

/// An error is an outlier beyond so many standard deviations, as the median of all tells them.
const OUTLIER: f64 = 5.0;
/// The same while outliers are left out: a model that follows some of them makes the others look usual, and frees itself of them step by
/// step (the concentration of Rousseeuw & Van Driessen 1999, *Data Mining and Knowledge Discovery* 3:29).
const UNUSUAL: f64 = 3.0;
/// Fewer outliers of the first model are no reason to look.
const LEAST_AT_FIRST: usize = 4;
/// Times that outliers are left out, and that the limit is found anew.
const ROUNDS: usize = 12;
/// Fewer windows beyond a limit tell none: errors of another cause, which are as often on either side, are all beyond what is predicted once in
/// sixteen times, and then not all at one torque, the largest.
const LEAST_WINDOWS: usize = 4;
/// Most of the windows that may be left out: a model is not told by less than half of a log.
const MOST_OUT: f64 = 0.5;
/// Of the outliers at least this share is beyond the limit, others are not a drive's; and of the windows in which more is reported than it, this share
/// has no more of it.
const LEAST_BEYOND: f64 = 0.8;
/// The same of the smaller ones that are left out on the way: noise and friction's reversals are among them, as often on either side.
const LEAST_BEYOND_OF_UNUSUAL: f64 = 0.5;
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
    pub(crate) fn of(
        (data, values): (&LimbData, &Values),
        predicted: &[f64],
        joint: usize,
        refit: &Refit,
    ) -> Option<Self> {
        let joint = Joint::of((data, values), joint, refit);
        if !joint.is_suspected(predicted) {
            return None;
        }
        let (values, predicted) = joint.without_outliers(predicted)?;
        let out = joint.outliers(&predicted, OUTLIER);
        if !joint.are_beyond(&predicted, &out, LEAST_BEYOND) {
            return None;
        }
        let beyond: Vec<usize> = (out.into_iter())
            .filter(|&w| joint.is_beyond(&predicted, w))
            .collect();
        if beyond.len() < LEAST_WINDOWS {
            return None;
        }
        joint.limit(values, predicted, &beyond)
    }
}

/// Values of a limb's model fitted to other data of it, from these on; `None` if there is no such fit.
type Refit<'a> = dyn Fn(&LimbData, &Values) -> Option<Values> + 'a;

/// A joint of a limb under a model, and the windows in which it is judged.
struct Joint<'a> {
    data: &'a LimbData<'a>,
    values: &'a Values,
    refit: &'a Refit<'a>,
    joint: usize,
    counted: Vec<usize>,
}

impl<'a> Joint<'a> {
    fn of(
        (data, values): (&'a LimbData<'a>, &'a Values),
        joint: usize,
        refit: &'a Refit<'a>,
    ) -> Self {
        let windows = 0..data.motion.windows.len();
        Self {
            data,
            values,
            refit,
            joint,
            counted: windows.filter(|&w| data.counts(w, joint)).collect(),
        }
    }

    fn at(&self, window: usize) -> usize {
        window * self.data.joints() + self.joint
    }

    fn reported(&self, window: usize) -> f64 {
        self.data.torque[self.at(window)]
    }

    fn is_suspected(&self, predicted: &[f64]) -> bool {
        let first = self.outliers(predicted, OUTLIER);
        first.len() >= LEAST_AT_FIRST && self.are_beyond(predicted, &first, LEAST_BEYOND_OF_UNUSUAL)
    }

    /// The windows whose error is larger than so many standard deviations.
    fn outliers(&self, predicted: &[f64], most: f64) -> Vec<usize> {
        let error = |w: &usize| (self.reported(*w) - predicted[self.at(*w)]).abs();
        let usual = median(self.counted.iter().map(error)).unwrap_or(0.0) / MEDIAN_OF_NORMAL;
        let all = self.counted.iter().copied();
        all.filter(|w| error(w) > most * usual).collect()
    }

    /// Whether more is reported than what is predicted.
    fn is_beyond(&self, predicted: &[f64], window: usize) -> bool {
        let (reported, given) = (self.reported(window), predicted[self.at(window)]);
        reported * given > 0.0 && reported.abs() > given.abs()
    }

    /// Whether windows beyond what is predicted make up such a share of them or, as far as the model follows the excess, of their squared
    /// error.
    fn are_beyond(&self, predicted: &[f64], out: &[usize], share: f64) -> bool {
        let square = |w: &usize| (self.reported(*w) - predicted[self.at(*w)]).powi(2);
        let beyond = || out.iter().filter(|&&w| self.is_beyond(predicted, w));
        beyond().count() as f64 >= share * out.len() as f64
            || beyond().map(square).sum::<f64>() >= share * out.iter().map(square).sum::<f64>()
    }

    /// The model fitted again until no outliers are left in its data, and what it predicts.
    fn without_outliers(&self, predicted: &[f64]) -> Option<(Values, Vec<f64>)> {
        let (mut values, mut predicted) = (self.values.clone(), predicted.to_vec());
        let mut out: Vec<usize> = Vec::new();
        for _ in 0..ROUNDS {
            let found = self.outliers(&predicted, UNUSUAL);
            if found == out {
                break;
            }
            out = found;
            if !self.are_beyond(&predicted, &out, LEAST_BEYOND_OF_UNUSUAL) {
                return None;
            }
            (values, predicted) = self.without(&values, &out)?;
        }
        Some((values, predicted))
    }

    /// The torque that the motion takes in the windows `beyond` a limit, if it is one.
    fn limit(
        &self,
        mut values: Values,
        mut predicted: Vec<f64>,
        beyond: &[usize],
    ) -> Option<Limit> {
        let given = |predicted: &[f64], w: usize| predicted[self.at(w)].abs();
        let usual = |predicted: &[f64]| median(beyond.iter().map(|&w| given(predicted, w)));
        let mut torque = usual(&predicted)?;
        let mut out: Vec<usize> = Vec::new();
        // Windows a little beyond the limit are no outliers, but say as little of the model.
        for _ in 0..ROUNDS {
            let most = torque;
            let all = self.counted.iter().copied();
            out = all.filter(|&w| self.reported(w).abs() > most).collect();
            (values, predicted) = self.without(&values, &out)?;
            torque = usual(&predicted)?;
            if (torque - most).abs() < SAME * most {
                break;
            }
        }
        // Wherever more is reported the motion takes the limit: a drive that gives twice as much elsewhere has none.
        let obeys = |w: &&usize| given(&predicted, **w) <= (1.0 + ALIKE) * torque;
        if (out.iter().filter(obeys).count() as f64) < LEAST_BEYOND * out.len() as f64 {
            return None;
        }
        let spread = median((beyond.iter()).map(|&w| (given(&predicted, w) - torque).abs()))?;
        let rest = self.counted.iter().filter(|w| !out.contains(w));
        let above = rest.filter(|&&w| given(&predicted, w) > (1.0 + ALIKE) * torque);
        if spread > ALIKE * torque || above.count() as f64 > MOST_ABOVE * self.counted.len() as f64
        {
            return None;
        }
        // Windows that the limit was reached in show a mean of less: where these differ by more than noise, the median is low by as much.
        let noise = median(
            self.counted
                .iter()
                .filter(|w| !out.contains(w))
                .map(|&w| (self.reported(w) - predicted[self.at(w)]).abs()),
        )?;
        let partly = (spread * spread - noise * noise).max(0.0).sqrt() / MEDIAN_OF_NORMAL;
        let excess = beyond.iter().map(|&w| self.reported(w).abs() - torque);
        let excess = excess.sum::<f64>() / beyond.len() as f64;
        let place = (EffectKind::Saturation, self.joint);
        values.insert(place);
        values.set(place, 0, torque);
        values.set(place, 1, excess);
        Some(Limit {
            torque,
            // A median's is 1.25 times a mean's; windows in a row say the same.
            std: (1.25 * spread / MEDIAN_OF_NORMAL / (runs(beyond) as f64).sqrt())
                .hypot(SCALE * torque)
                .hypot(partly),
            values,
        })
    }

    /// The model fitted again without some windows, and what it predicts in all of them; `None` where they are too many.
    fn without(&self, values: &Values, out: &[usize]) -> Option<(Values, Vec<f64>)> {
        let data = self.data;
        if out.len() as f64 > MOST_OUT * self.counted.len() as f64 {
            return None;
        }
        let mut left_out = data.left_out.clone();
        out.iter().for_each(|&w| left_out[w] = true);
        let rest = data.clone().leaving_out(&left_out);
        let values = (self.refit)(&rest, values)?;
        let predicted = data.predicted(&values, &|_| true);
        Some((values, predicted))
    }
}

/// How many runs of neighbours.
fn runs(windows: &[usize]) -> usize {
    let new = windows.windows(2).filter(|pair| pair[1] > pair[0] + 1);
    1 + new.count()
}

#[cfg(test)]
mod tests {
    use proprio_core::go2::Leg;
    use proprio_simulator::{Hide, Simulation, hidden};

    use super::*;
    use crate::estimate::fit::{How, LimbFit};
    use crate::estimate::limb_data::tests::recording_of;
    use crate::identify::plain;

    /// The limit at a Go2's RR_calf, under the four effects of every drive.
    fn limit(hide: &str) -> Option<f64> {
        let legs = Leg::ALL;
        let mut effects = hidden::typical(&legs);
        if !hide.is_empty() {
            effects.extend(hide.parse::<Hide>().unwrap().on(&legs).unwrap());
        }
        let simulation = Simulation {
            rate: 250.0,
            seed: 107,
            inertia_error: 0.03,
            effects,
            ..Simulation::new(&legs)
        };
        let recording = recording_of(&Default::default(), &simulation);
        let model = plain(&recording);
        let (limb, samples) = &recording.limbs[2];
        let data = LimbData::of(&model, limb, samples).unwrap();
        let places = crate::identify::model_fit::places_of(&data);
        let fit = LimbFit::of(&data, &places, &How::default()).unwrap();
        let found = fit.limit(&fit.predicted(), 2)?;
        Some(found.torque)
    }

    /// Five of this log's 700 windows, each at another reversal, have 5 to 8 deviations more than the model says, all of about 1.5 N m; at other times the
    /// same drive gives 3.9 N m.
    #[test]
    fn what_gives_more_elsewhere_has_no_limit() {
        assert_eq!(limit(""), None);
        let found = limit("saturation:RR_calf=2.5").unwrap();
        assert!((found - 2.5).abs() < 0.15, "{found}");
    }
}
