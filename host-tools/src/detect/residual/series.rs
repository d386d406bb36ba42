//! What is judged: one joint's windows in time.

use super::NoiseFloor;
use crate::robust;
use std::ops::Range;

/// A joint's windows of 20 ms or so, one entry of each slice per window, in the order of time; SI, joint side.
///
/// Windows lie side by side; a jump in `t` is a gap, and nothing is correlated over it. Logs may follow each other.
#[derive(Debug, Clone, Copy)]
pub struct Series<'a> {
    /// What to call the joint.
    pub joint: &'a str,
    /// Centre of the window, s.
    pub t: &'a [f64],
    /// Mean position, rad.
    pub q: &'a [f64],
    /// Mean velocity, rad/s.
    pub dq: &'a [f64],
    /// Measured mean torque, N m.
    pub tau: &'a [f64],
    /// Measured − predicted mean torque, N m.
    pub residual: &'a [f64],
    /// Motor temperature, degrees Celsius.
    pub temperature: Option<&'a [f64]>,
    /// 1 while the leg's foot carries load, else 0.
    pub contact: Option<&'a [f64]>,
    /// Whether the joint slides: m for rad and N for N m.
    pub slides: bool,
    /// The log's noise floor; where nobody says, it is that of the residual.
    pub noise: Option<NoiseFloor>,
}

impl Series<'_> {
    /// # Panics
    /// If the slices differ in length.
    pub(super) fn check(&self) {
        let n = self.t.len();
        let slices = [self.q, self.dq, self.tau, self.residual];
        let optional = [self.temperature, self.contact].into_iter().flatten();
        assert!(
            slices.into_iter().chain(optional).all(|s| s.len() == n),
            "{}: slices of one length",
            self.joint
        );
    }

    /// What the model predicts, N m.
    ///
    /// It stands in for the measured torque wherever the residual is held against torque: the measured torque's own
    /// noise is part of the residual, and the two would correlate though nothing is wrong.
    pub(super) fn predicted(&self) -> Vec<f64> {
        let pairs = self.tau.iter().zip(self.residual);
        pairs.map(|(tau, residual)| tau - residual).collect()
    }

    /// Acceleration from the second difference of mean positions, rad/s²; NaN beside a gap.
    ///
    /// Δq̇/Δt will not do: the noise of the velocity at a window's ends is in the window's residual too (through the
    /// momentum), and the two would correlate though nothing is wrong. The position's noise is a thousand times smaller.
    pub(super) fn acceleration(&self, runs: &Runs) -> Vec<f64> {
        let mut ddq = vec![f64::NAN; self.t.len()];
        for run in &runs.0 {
            for k in run.start + 1..run.end.max(1) - 1 {
                let slope = |a: usize, b: usize| (self.q[b] - self.q[a]) / (self.t[b] - self.t[a]);
                let span = 0.5 * (self.t[k + 1] - self.t[k - 1]);
                ddq[k] = (slope(k, k + 1) - slope(k - 1, k)) / span;
            }
        }
        ddq
    }
}

/// A joint's windows, held.
#[derive(Debug)]
pub(super) struct Held {
    columns: [Vec<f64>; 5],
    temperature: Option<Vec<f64>>,
    contact: Option<Vec<f64>>,
    slides: bool,
}

/// Windows among which patterns are looked for at most, and how many side by side are kept of a longer series.
const MOST: usize = 10_000;
const SEGMENT: usize = 500;

impl Held {
    /// All windows of a short series; of a long one, segments spread evenly over it, so that cost does not grow.
    pub(super) fn thinned(series: &Series) -> Self {
        let stride = series.t.len().div_ceil(MOST).max(1);
        let keep = |values: &[f64]| -> Vec<f64> {
            values
                .chunks(SEGMENT)
                .step_by(stride)
                .flatten()
                .copied()
                .collect()
        };
        Self {
            columns: [series.t, series.q, series.dq, series.tau, series.residual].map(keep),
            temperature: series.temperature.map(keep),
            contact: series.contact.map(keep),
            slides: series.slides,
        }
    }

    pub(super) fn series<'a>(&'a self, joint: &'a str) -> Series<'a> {
        let [t, q, dq, tau, residual] = &self.columns;
        Series {
            joint,
            t,
            q,
            dq,
            tau,
            residual,
            temperature: self.temperature.as_deref(),
            contact: self.contact.as_deref(),
            slides: self.slides,
            noise: None,
        }
    }
}

/// Stretches without a gap.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Runs(pub(super) Vec<Range<usize>>);

impl Runs {
    /// A gap is a step of more than one and a half times the median.
    pub(super) fn of(t: &[f64]) -> Self {
        let steps = t.windows(2).map(|w| w[1] - w[0]);
        let Some(step) = robust::median(steps.filter(|&d| d > 0.0)) else {
            return Self((0..t.len()).map(|k| k..k + 1).collect());
        };
        let together = |k: usize| {
            let d = t[k] - t[k - 1];
            d > 0.0 && d < 1.5 * step
        };
        let mut runs = Vec::new();
        let mut start = 0;
        for k in 1..=t.len() {
            if k == t.len() || !together(k) {
                runs.push(start..k);
                start = k;
            }
        }
        Self(runs)
    }

    /// Every `factor`-th window of every run: their indices, and the runs of what is left.
    pub(super) fn decimated(&self, factor: usize) -> (Vec<usize>, Self) {
        let mut indices = Vec::new();
        let mut runs = Vec::new();
        for run in &self.0 {
            let start = indices.len();
            indices.extend(run.clone().step_by(factor));
            runs.push(start..indices.len());
        }
        (indices, Self(runs))
    }

    /// Σ a(t) b(t + lag) and how many terms it has.
    pub(super) fn product(&self, a: &[f64], b: &[f64], lag: usize) -> (f64, usize) {
        let mut sum = 0.0;
        let mut count = 0;
        for run in &self.0 {
            if run.len() > lag {
                let first = &a[run.start..run.end - lag];
                let second = &b[run.start + lag..run.end];
                sum += first.iter().zip(second).map(|(a, b)| a * b).sum::<f64>();
                count += first.len();
            }
        }
        (sum, count)
    }
}

/// Values less their mean; what is not a number becomes 0, that is: says nothing.
pub(super) fn centred(values: &[f64]) -> Vec<f64> {
    let known = || values.iter().filter(|v| v.is_finite());
    let mean = known().sum::<f64>() / known().count().max(1) as f64;
    let less = |v: &f64| if v.is_finite() { v - mean } else { 0.0 };
    values.iter().map(less).collect()
}

/// Takes the projection on orthonormal directions off; what is not a number stays so and counts as 0.
pub(super) fn project_out(values: &mut [f64], directions: &[Vec<f64>]) {
    for direction in directions {
        let known = values.iter().zip(direction).filter(|(v, _)| v.is_finite());
        let product: f64 = known.map(|(v, d)| v * d).sum();
        for (v, d) in values.iter_mut().zip(direction) {
            *v -= product * d;
        }
    }
}

/// Sum of squares.
pub(super) fn square(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_part_runs() {
        let t = [0.0, 0.02, 0.04, 0.1, 0.12, 0.02, 0.04];
        let runs = Runs::of(&t);
        assert_eq!(runs, Runs(vec![0..3, 3..5, 5..7]));
        let (indices, decimated) = runs.decimated(2);
        assert_eq!(indices, [0, 2, 3, 5]);
        assert_eq!(decimated, Runs(vec![0..2, 2..3, 3..4]));
        let ones = [1.0; 7];
        assert_eq!(runs.product(&ones, &ones, 0), (7.0, 7));
        assert_eq!(runs.product(&ones, &ones, 1), (4.0, 4));
        assert_eq!(runs.product(&ones, &ones, 2), (1.0, 1));
    }

    #[test]
    fn a_parabola_has_its_acceleration() {
        let t: Vec<f64> = (0..6).map(|k| 0.02 * f64::from(k)).collect();
        let q: Vec<f64> = t.iter().map(|t| 1.5 * t * t).collect();
        let series = Series {
            joint: "x",
            t: &t,
            q: &q,
            dq: &q,
            tau: &q,
            residual: &q,
            temperature: None,
            contact: None,
            slides: false,
            noise: None,
        };
        let ddq = series.acceleration(&Runs::of(&t));
        assert!(ddq[0].is_nan() && ddq[5].is_nan());
        assert!(ddq[1..5].iter().all(|a| (a - 3.0).abs() < 1e-9), "{ddq:?}");
    }
}
