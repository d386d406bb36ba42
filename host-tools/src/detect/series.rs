//! A joint's windows as series: what was measured, what a model says, and what the joint did meanwhile.

use super::residual::{NoiseFloor, Series};
use crate::estimate::limb_data::LimbData;

/// A message was lost between samples that lie so many mean periods apart.
const WHOLE: f64 = 1.6;

/// One joint's windows, in the order of time; SI, joint side.
#[derive(Debug, Clone, Default)]
pub struct JointSeries {
    /// Which joint.
    pub joint: String,
    /// Centre of the window, s.
    pub t: Vec<f64>,
    /// Mean position, rad.
    pub q: Vec<f64>,
    /// Mean velocity, rad/s.
    pub dq: Vec<f64>,
    /// Measured mean torque, N m.
    pub tau: Vec<f64>,
    /// The model's mean torque, N m.
    pub predicted: Vec<f64>,
    /// Measured − predicted mean torque, N m.
    pub residual: Vec<f64>,
    /// Motor temperature, °C; empty where not recorded.
    pub temperature: Vec<f64>,
    /// Whether no message of the window was lost: over a longer time between two samples a mean is rough.
    pub whole: Vec<bool>,
    /// Whether the joint slides: m for rad and N for N m.
    pub slides: bool,
    /// The log's noise floor, where it is known.
    pub noise: Option<NoiseFloor>,
}

impl JointSeries {
    /// As the statistics take it.
    pub fn view(&self) -> Series<'_> {
        Series {
            joint: &self.joint,
            t: &self.t,
            q: &self.q,
            dq: &self.dq,
            tau: &self.tau,
            residual: &self.residual,
            temperature: (!self.temperature.is_empty()).then_some(&self.temperature),
            contact: None,
            slides: self.slides,
            noise: self.noise,
        }
    }

    /// The same of these of its windows alone, in the order of time.
    pub fn only(&self, windows: &[usize]) -> Self {
        let of = |values: &[f64]| -> Vec<f64> {
            let kept = windows.iter().filter_map(|&k| values.get(k));
            kept.copied().collect()
        };
        Self {
            joint: self.joint.clone(),
            t: of(&self.t),
            q: of(&self.q),
            dq: of(&self.dq),
            tau: of(&self.tau),
            predicted: of(&self.predicted),
            residual: of(&self.residual),
            temperature: of(&self.temperature),
            whole: windows
                .iter()
                .filter_map(|&k| self.whole.get(k).copied())
                .collect(),
            slides: self.slides,
            noise: self.noise,
        }
    }

    /// The predictions at other times of the same recording; NaN where there is none.
    pub fn predicted_at(&self, t: &[f64]) -> Vec<f64> {
        let mut next = 0;
        let at = |&t: &f64| {
            while self.t.get(next).is_some_and(|own| *own < t) {
                next += 1;
            }
            let found = self.t.get(next).is_some_and(|own| *own == t);
            if found {
                self.predicted[next]
            } else {
                f64::NAN
            }
        };
        t.iter().map(at).collect()
    }

    /// Root mean square of the residuals, N m.
    pub fn rms(&self) -> f64 {
        let sum: f64 = self.residual.iter().map(|r| r * r).sum();
        (sum / self.residual.len().max(1) as f64).sqrt()
    }
}

impl JointSeries {
    /// A limb's joints, over the windows in which they are judged, as a model predicts them: its mean torque of each window and
    /// joint, N m.
    pub(crate) fn of(data: &LimbData, predicted: &[f64]) -> Vec<Self> {
        let n = data.joints();
        let longest = WHOLE * data.recording.period();
        let is_whole = |[first, last]: [usize; 2]| {
            (first + 1..=last).all(|k| data.motion.time[k] - data.motion.time[k - 1] <= longest)
        };
        let warm = data.motion.temperature.iter().all(|t| t.is_finite());
        let series = |(j, joint): (usize, String)| {
            let mut series = Self {
                joint,
                slides: data.slides(j),
                ..Self::default()
            };
            let windows = data.motion.windows.iter().enumerate();
            for (w, window) in windows.filter(|(w, _)| data.counts(*w, j)) {
                let state = |k: usize| &data.motion.joint[j].state[k];
                let (torque, expected) = (data.torque[w * n + j], predicted[w * n + j]);
                series.t.push(window.t);
                series.q.push(data.motion.mean(window, |k| state(k)[0]));
                series.dq.push(data.motion.mean(window, |k| state(k)[1]));
                series.tau.push(torque);
                series.predicted.push(expected);
                series.residual.push(torque - expected);
                series.whole.push(is_whole(window.samples));
                if warm {
                    let temperature = data
                        .motion
                        .mean(window, |k| data.motion.temperature[k * n + j]);
                    series.temperature.push(temperature);
                }
            }
            series
        };
        data.joint_names()
            .into_iter()
            .enumerate()
            .map(series)
            .collect()
    }
}
