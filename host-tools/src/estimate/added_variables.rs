//! What of a fit's residual more columns would explain beside its own, without a fit: the least-squares solution with them, in some of
//! the windows. Rows are weighed by their joints' noise and not whitened, as held-out errors are.

use nalgebra::{DMatrix, DVector};

use super::bounded::Problem;
use super::fit::LimbFit;

/// Most windows that are looked at, spread over the recording: their residuals tell a sum of squares within 7 %, one standard deviation.
const MOST_WINDOWS: usize = 400;

/// A fit's residual and its columns.
pub(crate) struct LeftOver {
    /// The windows that are looked at, and of each row the place of its window among them, its joint and its weight.
    pub(crate) windows: Vec<usize>,
    rows: Vec<(usize, usize, f64)>,
    columns: DMatrix<f64>,
    residual: DVector<f64>,
    /// R of the columns and of what is known before data, and R⁻ᵀ Wᵀ of the residual.
    factor: DMatrix<f64>,
    told: DVector<f64>,
}

/// How far numbers are to go from where they are, in standard deviations before any data.
pub(crate) struct Step {
    pub(crate) by: Vec<f64>,
    /// Standard deviations after the data, of independent residuals.
    pub(crate) std: Vec<f64>,
    /// By how much the sum of squares falls, in units of the joints' noise.
    pub(crate) fall: f64,
}

impl LeftOver {
    /// What a fit leaves that predicts so; `None` if nothing determines it.
    pub(crate) fn of(fit: &LimbFit, predicted: &[f64]) -> Option<Self> {
        Self::of_windows(fit, predicted, &|_| true)
    }

    /// The same of the windows that are chosen.
    pub(crate) fn of_windows(
        fit: &LimbFit,
        predicted: &[f64],
        chosen: &dyn Fn(usize) -> bool,
    ) -> Option<Self> {
        let (data, n) = (fit.data, fit.data.joints());
        let all = data.motion.windows.len();
        let stride = all.div_ceil(MOST_WINDOWS).max(1);
        let windows: Vec<usize> = (0..all).step_by(stride).filter(|w| chosen(*w)).collect();
        let weight = |j: usize| (stride as f64).sqrt() / fit.noise[j];
        let rows: Vec<(usize, usize, f64)> = (windows.iter().enumerate())
            .flat_map(|(at, &w)| (0..n).map(move |j| (at, w, j)))
            .filter(|(_, w, j)| data.counts(*w, *j))
            .map(|(at, _, j)| (at, j, weight(j)))
            .collect();
        let made = data.rows(&fit.at, &fit.columns);
        let entries = fit.columns.entries.len();
        let mut columns = DMatrix::zeros(rows.len(), entries);
        let mut residual = DVector::zeros(rows.len());
        for (row, &(at, j, weight)) in rows.iter().enumerate() {
            let (w, own) = (windows[at], made.row(windows[at], j));
            for entry in 0..entries {
                if let Some(place) = fit.columns.place(j, entry) {
                    columns[(row, entry)] = weight * own[place];
                }
            }
            residual[row] = weight * (data.torque[w * n + j] - predicted[w * n + j]);
        }
        let mut numbers = columns.clone().insert_column(entries, 0.0);
        numbers.set_column(entries, &residual);
        let problem = Problem {
            data: numbers,
            ..fit.problem.clone()
        };
        let (factor, _) = problem.expanded(&fit.solution.theta)?;
        let told = factor.tr_solve_upper_triangular(&columns.tr_mul(&residual))?;
        Some(Self {
            windows,
            rows,
            columns,
            residual,
            factor,
            told,
        })
    }

    /// By how much the sum of squares falls, in units of the joints' noise, with a response that lies between two, and how far from the
    /// first to the second: responses are of all windows, N m, joint by joint.
    pub(crate) fn fall_between(&self, ends: [&[f64]; 2], joints: usize) -> (f64, f64) {
        let (square, right) = self.beside(&ends, joints);
        let fall = |share: f64| {
            let x = DVector::from_vec(vec![1.0 - share, share]);
            2.0 * right.dot(&x) - x.dot(&(&square * &x))
        };
        let bend = square[(0, 0)] - 2.0 * square[(0, 1)] + square[(1, 1)];
        let rise = right[1] - right[0] + square[(0, 0)] - square[(0, 1)];
        let share = if bend > 0.0 {
            (rise / bend).clamp(0.0, 1.0)
        } else {
            1.0
        };
        (fall(share), share)
    }

    /// The least-squares coefficients of responses in the windows that are looked at, N m, joint by joint, each a step from where its number is `known`
    /// to stand, in standard deviations before any data.
    pub(crate) fn coefficients(
        &self,
        responses: &[Vec<f64>],
        known: &[f64],
        joints: usize,
    ) -> Option<Step> {
        let responses: Vec<&[f64]> = responses.iter().map(Vec::as_slice).collect();
        let (square, right) = self.beside(&responses, joints);
        let own = right.len();
        let with_prior = (&square + DMatrix::identity(own, own)).cholesky()?;
        let by = with_prior.solve(&(&right - DVector::from_column_slice(known)));
        Some(Step {
            fall: 2.0 * right.dot(&by) - by.dot(&(&square * &by)),
            by: by.as_slice().to_vec(),
            std: with_prior
                .inverse()
                .diagonal()
                .map(f64::sqrt)
                .as_slice()
                .to_vec(),
        })
    }

    /// Of a response of all windows, joint by joint, what it is in those that are looked at.
    pub(crate) fn chosen(&self, response: &[f64], joints: usize) -> Vec<f64> {
        let all = self.windows.iter();
        let all = all.flat_map(|w| &response[w * joints..(w + 1) * joints]);
        all.copied().collect()
    }

    /// The responses' scalar products with each other and with the residual, the model's own columns and the prior taken out of all.
    fn beside(&self, responses: &[&[f64]], joints: usize) -> (DMatrix<f64>, DVector<f64>) {
        let of = |response: &&[f64]| {
            let rows = self.rows.iter();
            let own = rows.map(|(at, j, weight)| weight * response[at * joints + j]);
            DVector::from_iterator(self.rows.len(), own)
        };
        let own: Vec<DVector<f64>> = responses.iter().map(of).collect();
        let own = DMatrix::from_columns(&own);
        let mut known = self.columns.tr_mul(&own);
        // The diagonal of R is positive: every parameter has a prior.
        self.factor.tr_solve_upper_triangular_mut(&mut known);
        (
            own.tr_mul(&own) - known.tr_mul(&known),
            own.tr_mul(&self.residual) - known.tr_mul(&self.told),
        )
    }
}

#[cfg(test)]
mod tests;
