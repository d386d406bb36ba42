//! Errors of what a fit has not used: of each point by the others, of few points of each line by the others.

use nalgebra::DVector;

use super::fit::{FIRST_ERROR, HeldOut, Problem, elements, residual, weight};
use super::flexible::{At, Derived};
use super::layout::Layout;
use super::linear::{damped, stacked};
use crate::estimate::factor::HeapFactor;
use crate::parallel::by_number;

impl Problem<'_> {
    /// Errors of each point by a fit without it, at the end of these steps; of one or two points, of every fourth line by the others.
    pub(super) fn held_out(
        &self,
        layout: &Layout,
        (x, models): (&[f64], &[Vec<Derived>]),
        without_points: &[DVector<f64>],
        prior: &HeapFactor,
    ) -> Option<Vec<Vec<HeldOut>>> {
        let moved = |step: &DVector<f64>| -> Vec<f64> {
            x.iter().zip(step.iter()).map(|(x, s)| x + s).collect()
        };
        if self.points.len() > 2 {
            let errors = |point: usize| {
                let without = moved(&without_points[point]);
                self.point_errors(point, 0..self.used, layout, &without)
            };
            return by_number(0..self.points.len(), errors)
                .into_iter()
                .collect();
        }
        let mut errors = Vec::new();
        // Every fourth line in turn: neighbours of a sharp resonance stay in.
        const FOLDS: usize = 4;
        for point in 0..self.points.len() {
            for fold in 0..FOLDS {
                let kept = models.iter().enumerate().map(|(other, model)| {
                    let lines = (0..self.used).filter(|l| other != point || l % FOLDS != fold);
                    self.factor((other, None), lines, layout, model, FIRST_ERROR)
                });
                let kept: Vec<HeapFactor> = kept.collect();
                let step = damped(&stacked([prior].into_iter().chain(&kept)), 0.0);
                let lines = (fold..self.used).step_by(FOLDS);
                errors.push(self.point_errors(point, lines, layout, &moved(&step))?);
            }
        }
        Some(errors)
    }

    /// Errors of a point's mean at some lines.
    fn point_errors(
        &self,
        point: usize,
        lines: impl Iterator<Item = usize>,
        layout: &Layout,
        x: &[f64],
    ) -> Option<Vec<HeldOut>> {
        let own = self.points[point];
        let at = At::new(&self.plants[point], layout, x);
        let mut errors = Vec::new();
        for line in lines {
            let model = self.response(point, &at, line)?;
            let modelled = own.predicted(line, &model);
            for element in elements(own) {
                let found = residual(own, line, &own.mean[line], &modelled, element);
                errors.extend(found.map(|(error, std)| HeldOut {
                    magnitude: error.re,
                    square: error.norm_sqr() * weight(std, 0.0).powi(2),
                }));
            }
        }
        Some(errors)
    }
}
