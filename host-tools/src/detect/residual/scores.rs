//! How good a prediction is, in the numbers users know.

use serde::Serialize;

use super::series::{Series, centred, square};

/// How well a joint's torque is predicted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scores {
    /// Windows.
    pub n: usize,
    /// Root mean square of the error, N m.
    pub rms: f64,
    /// NRMSE fit as MATLAB's `compare` has it: 100 (1 − ‖y − ŷ‖ / ‖y − ȳ‖), %; none if the torque never changes.
    pub fit_percent: Option<f64>,
    /// Variance accounted for: 100 (1 − var(y − ŷ) / var(y)), %; none if the torque never changes.
    pub vaf_percent: Option<f64>,
    /// Mean error, N m.
    pub bias: f64,
    /// Largest error, N m.
    pub max: f64,
}

impl Scores {
    /// Of the series' residual.
    pub fn of(series: &Series) -> Self {
        let n = series.residual.len();
        let per = 1.0 / n.max(1) as f64;
        let error = square(series.residual);
        let torque = square(&centred(series.tau));
        let share = |part: f64| (torque > 0.0).then_some(100.0 * (1.0 - part));
        Self {
            n,
            rms: (error * per).sqrt(),
            fit_percent: share((error / torque).sqrt()),
            vaf_percent: share(square(&centred(series.residual)) / torque),
            bias: series.residual.iter().sum::<f64>() * per,
            max: series.residual.iter().fold(0.0, |max, r| r.abs().max(max)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scores_are_those_of_their_definitions() {
        let zero = [0.0; 4];
        let series = Series {
            joint: "x",
            t: &[0.0, 1.0, 2.0, 3.0],
            q: &zero,
            dq: &zero,
            tau: &[1.0, -1.0, 3.0, 5.0],
            residual: &[1.0, -1.0, 1.0, 1.0],
            temperature: None,
            contact: None,
            slides: false,
            noise: None,
        };
        let scores = Scores::of(&series);
        assert_eq!(
            (scores.n, scores.rms, scores.bias, scores.max),
            (4, 1.0, 0.5, 1.0)
        );
        // ‖y − ȳ‖² = 1 + 9 + 1 + 9, ‖e‖² = 4, var(e) = 4 − 4·0.25.
        assert!((scores.fit_percent.unwrap() - 100.0 * (1.0 - 0.2f64.sqrt())).abs() < 1e-12);
        assert!((scores.vaf_percent.unwrap() - 85.0).abs() < 1e-12);
        let still = Series {
            tau: &zero,
            ..series
        };
        assert_eq!(Scores::of(&still).fit_percent, None);
    }
}
