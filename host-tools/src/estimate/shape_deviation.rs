//! How surely a shape is known that was found by a scan.
//!
//! Near the shape s that was found the prediction ŷ is linear in it: with d = ∂ŷ/∂s, of the effect's own torque alone, and d⊥ what of that the joint's own columns cannot
//! take, the residuals r leave s a standard deviation of σ/|d⊥| if they are independent, and of √Σ(Σ d⊥ r)²/|d⊥|² by the spread of
//! the inner sums over blocks of time ([`super::deviation`]). No prior of the other parameters counts, which makes it rather too large. Of an effect
//! with two shapes D⊥ has two columns, and (D⊥ᵀD⊥)⁻¹ stands for 1/|d⊥|².
//!
//! A shape that is off by (D⊥ᵀD⊥)⁻¹D⊥ᵀr, more than two of its standard deviations, is moved by that (Gauss-Newton on what the linear
//! parameters leave: Golub & Pereyra 1973, variable projection); of two both are.
//!
//! What depends on a shape is known as badly as the shape lets it: where one is off by its standard deviation, the others are fitted again,
//! and by how much each of them moves is a part of its own standard deviation.

use nalgebra::{Matrix2, Vector2};

use super::fit::LimbFit;
use super::grid::{possible, size_of};
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

/// What residuals say of an effect's shapes near the present ones.
struct ShapesTold {
    /// By how much each is off.
    step: Vector2<f64>,
    /// Its standard deviation: infinite where the prediction does not depend on it.
    std: Vector2<f64>,
    /// How much of the first one's deviation is the second's, as a correlation.
    correlation: f64,
}

/// Whether an effect has a shape that a scan finds: a limit is found by its own.
fn is_scanned((effect, _): &Place) -> bool {
    let description = effect.description();
    description.has_shape() && !description.is_limit()
}

impl LimbFit<'_> {
    /// How far the entry's value moves with shapes that are off by one standard deviation each; zero where none is scanned.
    pub(super) fn moved_by_shapes(&self, entry: usize) -> f64 {
        let squares = made_once(&self.moved_by_shapes, || {
            let mut squares = vec![0.0; self.columns.entries.len()];
            for &place in self.places.iter().filter(|place| is_scanned(place)) {
                for moved in self.moved_by(place) {
                    let both = squares.iter_mut().zip(moved);
                    both.for_each(|(square, by)| *square += by * by);
                }
            }
            squares
        });
        squares[entry].sqrt()
    }

    /// By how much each entry of θ moves where the shapes of an effect are off by their standard deviations: independent directions apart, for two
    /// that stand for each other are off together.
    fn moved_by(&self, place: Place) -> Vec<Vec<f64>> {
        let rows = self.data.rows(&self.at, &self.columns);
        let Some(told) = self.shapes_told(place, &rows) else {
            return Vec::new();
        };
        // One that the prediction does not depend on moves nothing.
        let [first, second] = told
            .std
            .map(|std| if std.is_finite() { std } else { 0.0 })
            .into();
        let alone = (1.0 - told.correlation.powi(2)).max(0.0).sqrt();
        let directions = [[first, told.correlation * second], [0.0, alone * second]];
        let count = place.0.description().shapes().count();
        let moved = |by: &[f64; 2]| self.moved_along(place, *by);
        directions[..count].iter().filter_map(moved).collect()
    }

    /// The same where the shapes are off by so much.
    fn moved_along(&self, place: Place, by: [f64; 2]) -> Option<Vec<f64>> {
        let data = self.data;
        let mut at = self.at.clone();
        for (n, by) in place.0.description().shapes().zip(by) {
            let (shape, upper) = (at.get(place, n), place.0.description().parameters[n].upper);
            // A shape that is hardly known at all does not become another effect.
            let most = 0.5 * size_of(data, (place, n), shape);
            at.set(place, n, (shape + by.clamp(-most, most)).min(upper));
        }
        let columns = data.columns(&at, &self.places, &[]);
        let rows = data.rows(&at, &columns);
        let all = Groups::of_factors(&columns, self.weights.blocks(data, &columns, &rows));
        let mut problem = self.problem.clone();
        problem.data = stacked(&all.sum(|_| true), &self.noise);
        let there = problem.theta_from(&self.solution.theta)?;
        Some((there - &self.solution.theta).as_slice().to_vec())
    }

    /// How surely a shape of an effect, its parameter `n`, is known: by the prior alone where the prediction does not tell it.
    pub(crate) fn known_shape(&self, place: Place, n: usize) -> f64 {
        let prior = self.data.prior(place, n).1;
        self.shape_std(place, n).map_or(prior, |std| std.min(prior))
    }

    /// Standard deviation of a shape of an effect; `None` where the prediction does not depend on it.
    fn shape_std(&self, place: Place, n: usize) -> Option<f64> {
        if place.0.description().is_limit() {
            let told = self.limits.iter().find(|(limited, _)| *limited == place);
            return told.map(|(_, std)| *std);
        }
        let rows = self.data.rows(&self.at, &self.columns);
        let at = place.0.description().shapes().position(|shape| shape == n);
        Some(self.shapes_told(place, &rows)?.std[at.unwrap_or(0)])
    }

    /// The fit's values with those shapes moved that its residuals refute; `None` if they refute none. A scan stands beside friction, a rotor
    /// and a constant torque alone, so that what the bodies or other effects explain may pull a shape away.
    pub(super) fn with_shapes_moved(&self, rows: &Rows, held: &[Place]) -> Option<Values> {
        let mut values = None;
        let scanned = |place: &&Place| is_scanned(place) && !held.contains(place);
        for &place in self.places.iter().filter(scanned) {
            let Some(told) = self.shapes_told(place, rows) else {
                continue;
            };
            let both = || told.step.iter().zip(told.std.iter());
            if !both().any(|(step, std)| step.abs() > REFUTED * std) {
                continue;
            }
            let shapes = place.0.description().shapes();
            let shapes = shapes.map(|n| (n, self.values.get(place, n)));
            let longest = |(n, shape)| LONGEST * size_of(self.data, (place, n), shape);
            // In the direction of both, as far as the one goes that is the first to have gone too far.
            let shares = shapes.clone().zip(&told.step);
            let shares = shares.map(|(own, step)| longest(own) / step.abs());
            let share = shares.fold(1.0, f64::min);
            for ((n, shape), step) in shapes.zip(&told.step) {
                let next = possible((place.0, n), shape + share * step);
                if next != shape {
                    let moved = values.get_or_insert_with(|| self.values.clone());
                    moved.set(place, n, next);
                }
            }
        }
        values
    }

    /// What the residuals say of an effect's shapes; `None` where the prediction depends on none, or on two in the same way.
    fn shapes_told(&self, place: Place, rows: &Rows) -> Option<ShapesTold> {
        let (data, n, joint) = (self.data, self.data.joints(), place.1);
        let windows: Vec<usize> = (0..data.motion.windows.len())
            .filter(|&w| data.counts(w, joint))
            .collect();
        let slopes = |parameter: usize| {
            let shape = self.values.get(place, parameter);
            let near = NEAR * size_of(data, (place, parameter), shape);
            let [less, more] =
                [-near, near].map(|by| self.explained(place, (parameter, shape + by), &windows));
            let slope = |n: usize| (more[n] - less[n]) / (2.0 * near);
            let slopes = (0..windows.len()).map(slope).collect();
            self.beside_own_columns(rows, joint, &windows, slopes)
        };
        let told: Vec<Option<Vec<f64>>> = place.0.description().shapes().map(slopes).collect();
        if told.iter().all(Option::is_none) {
            return None;
        }
        let numbers = self.columns.combined(self.solution.theta.as_slice());
        let own = |shape: usize, at: usize| {
            let own = told.get(shape).and_then(Option::as_ref);
            own.map_or(0.0, |own| own[at])
        };
        let mut gram = Matrix2::zeros();
        let mut blocks = vec![Vector2::zeros(); data.blocks.count()];
        let (mut left, mut along) = (0.0, Vector2::zeros());
        for (at, w) in windows.iter().enumerate() {
            let residual = data.torque[w * n + joint] - dot(&numbers[joint], rows.row(*w, joint));
            let own = Vector2::new(own(0, at), own(1, at));
            gram += own * own.transpose();
            blocks[data.motion.windows[*w].block] += own * residual;
            along += own * residual;
            left += residual * residual;
        }
        // What there is not, or is not told, stands beside the other as if it were known.
        let is_told = [0, 1].map(|shape| told.get(shape).is_some_and(Option::is_some));
        for shape in (0..2).filter(|shape| !is_told[*shape]) {
            gram[(shape, shape)] = 1.0;
        }
        let inverse = gram.try_inverse()?;
        let by_blocks = blocks
            .iter()
            .map(|own| inverse * own * own.transpose() * inverse);
        let by_blocks: Matrix2<f64> = by_blocks.sum();
        let independent = inverse * (left / windows.len() as f64);
        let std = |shape: usize| match is_told[shape] {
            true => independent[(shape, shape)]
                .max(by_blocks[(shape, shape)])
                .sqrt(),
            false => f64::INFINITY,
        };
        Some(ShapesTold {
            step: inverse * along,
            std: Vector2::new(std(0), std(1)),
            correlation: inverse[(0, 1)] / (inverse[(0, 0)] * inverse[(1, 1)]).sqrt(),
        })
    }

    /// What an effect explains in windows of its joint where one of its shapes has this value, N m.
    fn explained(
        &self,
        place: Place,
        (parameter, shape): (usize, f64),
        windows: &[usize],
    ) -> Vec<f64> {
        let (data, joint) = (self.data, place.1);
        let mut values = self.values.clone();
        values.set(place, parameter, shape);
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
