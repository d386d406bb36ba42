//! A joint's windows as series: what was measured, what a model says, and what the joint did meanwhile.

use proprio_core::effect::EffectKind;

use super::column::Entry;
use super::limb::LimbCriticism;
use super::residual::Series;
use crate::parameter::{INERTIAL_NAMES, name_at};

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

/// Which θ predicts.
#[derive(Clone, Copy)]
pub(crate) enum Predict<'a> {
    /// The one fitted to all data but the window's fold.
    HeldOut,
    /// The values that the model file gives.
    Given,
    /// The values of parameters by name, `m:FR_hip` or `coulomb:FR_hip`; of others, what the model file gives.
    Named(&'a Values<'a>),
}

/// The value of a parameter by its name.
pub type Values<'a> = dyn Fn(&str) -> Option<f64> + Sync + 'a;

impl LimbCriticism<'_> {
    /// θ from parameters by name.
    fn named(&self, values: &Values, names: &[String]) -> Vec<f64> {
        let entries = self.columns.entries.iter().zip(self.given());
        let value = |entry: &Entry| {
            let joint = names.get(entry.joint)?;
            let what = match entry.effect {
                None => INERTIAL_NAMES[entry.parameter].0,
                Some(effect) if entry.parameter == 0 => effect.name(),
                Some(_) => return None,
            };
            let value = values(&name_at(what, joint))?;
            let neutral = |effect: EffectKind| effect.description().parameters[0].neutral;
            Some(value - entry.effect.map_or(0.0, neutral))
        };
        entries
            .map(|(entry, given)| value(entry).unwrap_or(given))
            .collect()
    }

    /// The series of all joints, over the windows that the factors are of: in blocks, the joint not at rest.
    pub(crate) fn series(&self, predict: Predict, names: &[String]) -> Vec<JointSeries> {
        let combine = |theta: &Vec<f64>| self.columns.combined(theta);
        let theta: Vec<Vec<Vec<f64>>> = match predict {
            Predict::HeldOut => self.fit.held_out.iter().map(combine).collect(),
            Predict::Given => vec![combine(&self.given())],
            Predict::Named(values) => vec![combine(&self.named(values, names))],
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
        for window in self.windows.iter() {
            let theta = &theta[self.fold(window.block).min(theta.len() - 1)];
            let [first, last] = window.samples;
            let mean = |x: &dyn Fn(usize) -> f64| {
                let inner: f64 = (first + 1..last).map(x).sum();
                (inner + 0.5 * (x(first) + x(last))) / (last - first) as f64
            };
            for (j, series) in all.iter_mut().enumerate().filter(|(j, _)| window.moves[*j]) {
                let (torque, residual) = (window.equation(j).1, window.residual(j, &theta[j]));
                series.t.push(window.t);
                series.q.push(mean(&|k| self.motion.states[k * n + j].q));
                series.dq.push(mean(&|k| self.motion.states[k * n + j].dq));
                series.tau.push(torque);
                series.predicted.push(torque - residual);
                series.residual.push(residual);
                if warm {
                    series
                        .temperature
                        .push(mean(&|k| self.motion.states[k * n + j].temperature));
                }
            }
        }
        all
    }
}
