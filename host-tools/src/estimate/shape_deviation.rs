//! How surely a shape is known that was found by a scan.
//!
//! Near the shape s that was found the prediction ŷ is linear in it: with d = ∂ŷ/∂s, of the effect's own torque alone, and d⊥ what of that the joint's own columns cannot
//! take, the residuals r leave s a standard deviation of σ/|d⊥| if they are independent, and of √Σ(Σ d⊥ r)²/|d⊥|² by the spread of
//! the inner sums over blocks of time ([`super::deviation`]). No prior of the other parameters counts, which makes it rather too large.
//!
//! A shape that is off by d⊥·r/|d⊥|², more than two of its standard deviations, is moved by that (Gauss-Newton on what the linear
//! parameters leave: Golub & Pereyra 1973, variable projection).
//!
//! What depends on a shape is known as badly as the shape lets it: where one is off by its standard deviation, the others are fitted again,
//! and by how much each of them moves is a part of its own standard deviation.

use super::fit::LimbFit;
use super::grid::{possible, shape_parameter, size_of};
use super::groups::{Groups, stacked};
use super::shapes::orthonormal;
use crate::equation::dot::dot;
use crate::equation::rows::Rows;
use crate::equation::values::{Place, Values};
use crate::once::made_once;

/// How much more and less of a shape tells how the prediction changes with it, as a share.
const NEAR: f64 = 0.01;

/// A shape is moved that is off by more than so many of its standard deviations.
const REFUTED: f64 = 2.0;
/// A step of a shape is no longer than this share of it: the prediction is linear in it only near.
const LONGEST: f64 = 0.3;

/// What residuals say of a shape near the present one: by how much it is off, and the standard deviation of that.
struct ShapeTold {
    step: f64,
    std: f64,
}

/// Whether an effect has a shape that a scan finds: a limit is found by its own.
fn is_scanned((effect, _): &Place) -> bool {
    let description = effect.description();
    description.shape().is_some() && !description.is_limit()
}

impl LimbFit<'_> {
    /// How far the entry's value moves with shapes that are off by one standard deviation each; zero where none is scanned.
    pub(super) fn moved_by_shapes(&self, entry: usize) -> f64 {
        let squares = made_once(&self.moved_by_shapes, || {
            let mut squares = vec![0.0; self.columns.entries.len()];
            for &place in self.places.iter().filter(|place| is_scanned(place)) {
                let moved = self.moved_by(place).unwrap_or_default();
                let both = squares.iter_mut().zip(moved);
                both.for_each(|(square, by)| *square += by * by);
            }
            squares
        });
        squares[entry].sqrt()
    }

    /// By how much each entry of θ moves where the shape of an effect is off by its standard deviation.
    fn moved_by(&self, place: Place) -> Option<Vec<f64>> {
        let (data, n) = (self.data, shape_parameter(place.0));
        let (std, parameter) = (self.shape_std(place)?, place.0.description().parameters[n]);
        let shape = self.at.get(place, n);
        let mut at = self.at.clone();
        // A shape that is hardly known at all does not become another effect.
        at.set(
            place,
            n,
            (shape + std.min(0.5 * size_of(data, place, shape))).min(parameter.upper),
        );
        let columns = data.columns(&at, &self.places, &[]);
        let rows = data.rows(&at, &columns);
        let all = Groups::of_factors(&columns, self.weights.blocks(data, &columns, &rows));
        let mut problem = self.problem.clone();
        problem.data = stacked(&all.sum(|_| true), &self.noise);
        let there = problem.solve_from(&self.solution.theta)?;
        Some((there.theta - &self.solution.theta).as_slice().to_vec())
    }

    /// How surely an effect's shape is known: by the prior alone where the prediction does not tell it.
    pub(crate) fn known_shape(&self, place: Place) -> f64 {
        let prior = self.data.prior(place, shape_parameter(place.0)).1;
        self.shape_std(place).map_or(prior, |std| std.min(prior))
    }

    /// Standard deviation of an effect's shape; `None` where the prediction does not depend on it.
    fn shape_std(&self, place: Place) -> Option<f64> {
        if place.0.description().is_limit() {
            let told = self.limits.iter().find(|(limited, _)| *limited == place);
            return told.map(|(_, std)| *std);
        }
        let rows = self.data.rows(&self.at, &self.columns);
        self.shape_told(place, &rows).map(|told| told.std)
    }

    /// The fit's values with those shapes moved that its residuals refute; `None` if they refute none. A scan stands beside friction, a rotor
    /// and a constant torque alone, so that what the bodies or other effects explain may pull a shape away.
    pub(super) fn with_shapes_moved(&self, rows: &Rows, held: &[Place]) -> Option<Values> {
        let mut values = None;
        let scanned = |place: &&Place| is_scanned(place) && !held.contains(place);
        for &place in self.places.iter().filter(scanned) {
            let (n, shape) = (
                shape_parameter(place.0),
                self.values.get(place, shape_parameter(place.0)),
            );
            let Some(told) = self.shape_told(place, rows) else {
                continue;
            };
            if told.step.abs() > REFUTED * told.std {
                let longest = LONGEST * size_of(self.data, place, shape);
                let step = told.step.clamp(-longest, longest);
                let next = possible(place.0, shape + step);
                if next != shape {
                    let moved = values.get_or_insert_with(|| self.values.clone());
                    moved.set(place, n, next);
                }
            }
        }
        values
    }

    /// What the residuals say of a shape; `None` where the prediction does not depend on it.
    fn shape_told(&self, place: Place, rows: &Rows) -> Option<ShapeTold> {
        let (data, n, joint) = (self.data, self.data.joints(), place.1);
        let windows: Vec<usize> = (0..data.motion.windows.len())
            .filter(|&w| data.counts(w, joint))
            .collect();
        let parameter = shape_parameter(place.0);
        let shape = self.values.get(place, parameter);
        let near = NEAR * size_of(data, place, shape);
        let [less, more] = [-near, near].map(|by| self.explained(place, shape + by, &windows));
        let slope = |n: usize| (more[n] - less[n]) / (2.0 * near);
        let own = self.beside_own_columns(
            rows,
            joint,
            &windows,
            (0..windows.len()).map(slope).collect(),
        )?;
        let numbers = self.columns.combined(self.solution.theta.as_slice());
        let square = dot(&own, &own);
        let mut blocks = vec![0.0; data.blocks.count()];
        let (mut left, mut along) = (0.0, 0.0);
        for (w, own) in windows.iter().zip(&own) {
            let residual = data.torque[w * n + joint] - dot(&numbers[joint], rows.row(*w, joint));
            blocks[data.motion.windows[*w].block] += own * residual;
            along += own * residual;
            left += residual * residual;
        }
        let independent = (left / windows.len() as f64 / square).sqrt();
        let by_blocks = blocks.iter().map(|x| x * x).sum::<f64>().sqrt() / square;
        Some(ShapeTold {
            step: along / square,
            std: independent.max(by_blocks),
        })
    }

    /// What an effect of this shape explains in windows of its joint, N m.
    fn explained(&self, place: Place, shape: f64, windows: &[usize]) -> Vec<f64> {
        let (data, joint) = (self.data, place.1);
        let mut values = self.values.clone();
        values.set(place, shape_parameter(place.0), shape);
        let columns = data.columns_of_effect(place, &values);
        let rows = data.rows(&values, &columns);
        let numbers = &columns.numbers(&values)[joint];
        let of = |&w: &usize| dot(numbers, rows.row(w, joint));
        windows.iter().map(of).collect()
    }

    /// What of a joint's prediction its own columns cannot take; `None` if they take all of it.
    fn beside_own_columns(
        &self,
        rows: &Rows,
        joint: usize,
        windows: &[usize],
        mut predicted: Vec<f64>,
    ) -> Option<Vec<f64>> {
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for column in 0..self.columns.of_joint[joint].len() {
            let column = windows.iter().map(|&w| rows.row(w, joint)[column]);
            basis.extend(orthonormal(column.collect(), &basis));
        }
        let size = dot(&predicted, &predicted).sqrt();
        let taken: Vec<f64> = basis.iter().map(|along| dot(along, &predicted)).collect();
        for (along, taken) in basis.iter().zip(taken) {
            predicted
                .iter_mut()
                .zip(along)
                .for_each(|(x, b)| *x -= taken * b);
        }
        let left = dot(&predicted, &predicted).sqrt();
        (left > 1e-6 * size).then_some(predicted)
    }
}
