//! Errors of what a fit has not used: of each point by the others, of few points of each line by the others.

use nalgebra::DMatrix;

use super::fit::{FIRST_ERROR, HeldOut, LEAST_KNOWN, Problem, weight};
use super::flexible::At;
use super::layout::Layout;
use super::linear::{damped, stacked};
use crate::parallel::by_number;

impl Problem<'_> {
    /// Errors of each point by a fit without it; of one or two points, of every fourth line by the others.
    pub(super) fn held_out(
        &self,
        layout: &Layout,
        x: &[f64],
        groups: &[(usize, DMatrix<f64>)],
        prior: &DMatrix<f64>,
    ) -> Option<Vec<Vec<HeldOut>>> {
        let by_point = self.points.len() > 2;
        if by_point {
            let without = |point: usize| {
                let others = groups.iter().filter(|(own, _)| *own != point);
                let step = damped(&stacked(others.map(|(_, factor)| factor), prior), 0.0);
                let without: Vec<f64> = x.iter().zip(step.iter()).map(|(x, s)| x + s).collect();
                self.point_errors(point, 0..self.used, layout, &without)
            };
            return by_number(0..self.points.len(), without)
                .into_iter()
                .collect();
        }
        let mut errors = Vec::new();
        // Every fourth line in turn: neighbours of a sharp resonance stay in.
        const FOLDS: usize = 4;
        for point in 0..self.points.len() {
            for fold in 0..FOLDS {
                let mut kept = Vec::new();
                for other in 0..self.points.len() {
                    let model = self.model(other, layout, x)?;
                    for line in (0..self.used).filter(|l| other != point || l % FOLDS != fold) {
                        kept.push(self.rows(other, None, line..line + 1, &model, FIRST_ERROR));
                    }
                }
                let step = damped(&stacked(kept.iter(), prior), 0.0);
                let without: Vec<f64> = x.iter().zip(step.iter()).map(|(x, s)| x + s).collect();
                let mut own = Vec::new();
                for line in (fold..self.used).step_by(FOLDS) {
                    own.extend(self.point_errors(point, line..line + 1, layout, &without)?);
                }
                errors.push(own);
            }
        }
        Some(errors)
    }

    /// Errors of a point's mean at some lines.
    fn point_errors(
        &self,
        point: usize,
        lines: std::ops::Range<usize>,
        layout: &Layout,
        x: &[f64],
    ) -> Option<Vec<HeldOut>> {
        let own = self.points[point];
        let at = At::new(&self.plants[point], layout, x);
        let mut errors = Vec::new();
        for line in lines {
            let model = at.response(self.omega[line], self.dt)?;
            for (i, j) in (0..own.q.len()).flat_map(|i| (0..own.q.len()).map(move |j| (i, j))) {
                let error = (own.mean[line][(i, j)] / model[(i, j)]).ln();
                let variance = self.relative_variance(own, line, i, j);
                if variance < LEAST_KNOWN && error.is_finite() {
                    errors.push(HeldOut {
                        magnitude: error.re,
                        square: error.norm_sqr() * weight((0.5 * variance).sqrt(), 0.0).powi(2),
                    });
                }
            }
        }
        Some(errors)
    }
}
