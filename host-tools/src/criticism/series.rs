//! A joint's windows as series: what was measured, what a model says, and what the joint did meanwhile.

use super::limb::LimbCriticism;
use super::residual::Series;

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
        }
    }

    /// Root mean square of the residuals, N m.
    pub fn rms(&self) -> f64 {
        let sum: f64 = self.residual.iter().map(|r| r * r).sum();
        (sum / self.residual.len().max(1) as f64).sqrt()
    }
}

/// Which θ predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Predict {
    /// The one fitted to all data but the window's fold.
    HeldOut,
    /// The values that the model file gives.
    Given,
}

impl LimbCriticism<'_> {
    /// The series of all joints, over the windows that the factors are of: in blocks, the joint not at rest.
    pub(crate) fn series(&self, predict: Predict, names: &[String]) -> Vec<JointSeries> {
        let combine = |theta: &Vec<f64>| self.columns.combined(theta);
        let theta: Vec<Vec<Vec<f64>>> = match predict {
            Predict::HeldOut => self.fit.held_out.iter().map(combine).collect(),
            Predict::Given => vec![combine(&self.given())],
        };
        let n = self.recording.joints;
        let mut all: Vec<JointSeries> = names
            .iter()
            .map(|joint| JointSeries {
                joint: joint.clone(),
                ..JointSeries::default()
            })
            .collect();
        let warm = self.recording.temperature.iter().all(|t| t.is_finite());
        self.rows().for_each_window(|window| {
            let Some(block) = window.block else { return };
            let theta = &theta[self.fold(block).min(theta.len() - 1)];
            let [first, last] = window.samples;
            let mean = |x: &dyn Fn(usize) -> f64| {
                let inner: f64 = (first + 1..last).map(x).sum();
                (inner + 0.5 * (x(first) + x(last))) / (last - first) as f64
            };
            for (j, series) in all.iter_mut().enumerate().filter(|(j, _)| window.moves[*j]) {
                let Some((torque, columns)) = window.rows[j].split_last() else {
                    continue;
                };
                let predicted: f64 = columns
                    .iter()
                    .zip(&theta[j])
                    .map(|(x, theta)| x * theta)
                    .sum();
                series.t.push(window.t);
                series.q.push(mean(&|k| self.motion.states[k * n + j].q));
                series.dq.push(mean(&|k| self.motion.states[k * n + j].dq));
                series.tau.push(*torque);
                series.predicted.push(predicted);
                series.residual.push(torque - predicted);
                if warm {
                    series
                        .temperature
                        .push(mean(&|k| self.motion.states[k * n + j].temperature));
                }
            }
        });
        all
    }
}
