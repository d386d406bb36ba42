//! The limb's model fitted: to all data, to all folds but one, and with everything that the catalogue has.

use nalgebra::Vector3;
use proprio_core::effect::EffectKind;

use super::super::blocks::HeapFactor;
use super::super::column::{Columns, Entry};
use super::super::motion::Corrections;
use super::super::triangle::{Triangle, misfit};
use super::{LimbCriticism, Place};

/// Times that noise and the hold on bodies are found again from the fit that they give.
const ITERATIONS: usize = 5;

/// The model fitted.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fit {
    /// θ by all data.
    pub(crate) theta: Vec<f64>,
    /// Standard deviations of the active entries, if residuals are independent; zero for the others.
    pub(crate) std: Vec<f64>,
    /// Noise of each joint: root mean square of its whitened residuals, N m.
    pub(crate) noise: Vec<f64>,
    /// θ of each fold by the data of all others.
    pub(crate) held_out: Vec<Vec<f64>>,
    /// Sum of squared whitened residuals \[fold\] \[joint\] of the fold's own data under that θ, (N m)².
    pub(crate) rss: Vec<Vec<f64>>,
    /// Of each fold under the θ of the others.
    pub(crate) held_out_squares: Squares,
}

/// Held-out sums of squared residuals as they are, not whitened, (N m)².
#[derive(Debug, Clone, Default)]
pub(crate) struct Squares {
    /// Of each joint, over all folds.
    pub(crate) by_joint: Vec<f64>,
    /// Of each fold, over all joints.
    pub(crate) by_fold: Vec<f64>,
}

impl Squares {
    /// Of all joints, over all folds, in units of these noises (N m).
    pub(crate) fn weighted(&self, noise: &[f64]) -> f64 {
        weighted(&self.by_joint, noise)
    }
}

/// Sum of the joints' squares in units of their noise.
pub(crate) fn weighted(squares: &[f64], noise: &[f64]) -> f64 {
    let squares = squares.iter().zip(noise);
    squares
        .map(|(square, noise)| square / (noise * noise))
        .sum()
}

/// All that going over the data again changes but what is made of the data: to come back to.
#[derive(Debug, Clone)]
pub(crate) struct Values {
    pub(crate) fit: Fit,
    corrections: Corrections,
    gap_std: Vec<f64>,
    columns: Columns,
    loads: Vec<Vector3<f64>>,
}

impl LimbCriticism<'_> {
    /// The entries of the model: all inertial ones, then its effects'.
    pub(crate) fn active_entries(&self) -> Vec<usize> {
        self.entries_with(&self.active)
    }

    pub(super) fn entries_with(&self, active: &[Place]) -> Vec<usize> {
        let is_active = |e: &Entry| {
            e.effect
                .is_none_or(|effect| active.contains(&(effect, e.joint)))
        };
        (0..self.columns.entries.len())
            .filter(|&k| is_active(&self.columns.entries[k]))
            .collect()
    }

    /// Fits the model: to all data and to the data of all folds but one. Each joint's noise is its own residual's.
    pub(crate) fn refit(&mut self) {
        let active = self.active_entries();
        let entries = self.columns.entries.len();
        let mut noise: Vec<f64> = self.all.iter().map(torque_size).collect();
        if self.fit.noise.len() == noise.len() {
            noise.clone_from(&self.fit.noise);
        }
        let mut fit = Fit::default();
        self.prior.relax();
        for _ in 0..ITERATIONS {
            let triangle =
                Triangle::new(&self.columns, &self.prior, &self.all, &noise, &active, &[]);
            fit.theta = triangle.solve(entries, &[]);
            fit.std = vec![0.0; entries];
            active
                .iter()
                .zip(triangle.std())
                .for_each(|(&k, std)| fit.std[k] = std.hypot(self.scan_error(k)));
            noise = self.residuals(&fit.theta, active.len());
            self.prior.hold(&fit.theta);
        }
        fit.held_out = self.solve_folds(&active, &noise);
        fit.rss = self.score(&fit.held_out);
        fit.held_out_squares = self.squares(&fit.held_out);
        fit.noise = noise;
        self.fit = fit;
    }

    /// Root mean square of each joint's residuals under θ, of which so many entries were fitted, N m.
    fn residuals(&self, theta: &[f64], fitted: usize) -> Vec<f64> {
        let of = |(joint, factor): (usize, &HeapFactor)| {
            let square = misfit(&self.columns, joint, factor, theta);
            let freedom = (factor.rows() - fitted as f64 / self.recording.joints as f64).max(1.0);
            (square / freedom).sqrt().max(1e-3 * torque_size(factor))
        };
        self.all.iter().enumerate().map(of).collect()
    }

    /// Each fold's sums under its θ.
    pub(crate) fn squares(&self, theta: &[Vec<f64>]) -> Squares {
        let theta: Vec<Vec<Vec<f64>>> = theta
            .iter()
            .map(|theta| self.columns.combined(theta))
            .collect();
        let mut squares = Squares {
            by_joint: vec![0.0; self.recording.joints],
            by_fold: vec![0.0; theta.len()],
        };
        for window in self.windows.iter() {
            let fold = self.fold(window.block);
            for j in (0..self.recording.joints).filter(|j| window.moves[*j]) {
                let square = window.residual(j, &theta[fold][j]).powi(2);
                squares.by_joint[j] += square;
                squares.by_fold[fold] += square;
            }
        }
        squares
    }

    /// A joint's residuals, window by window, each under the θ of the other folds, N m.
    pub(crate) fn held_out_residuals(&self, joint: usize) -> Vec<f64> {
        let combine = |theta: &Vec<f64>| self.columns.combined(theta).swap_remove(joint);
        let theta: Vec<Vec<f64>> = self.fit.held_out.iter().map(combine).collect();
        let moving = self.windows.iter().filter(|window| window.moves[joint]);
        moving
            .map(|window| window.residual(joint, &theta[self.fold(window.block)]))
            .collect()
    }

    /// Each joint's noise floor: what even all effects of the catalogue together, each within its prior, leave of its
    /// torque, N m.
    pub(crate) fn floor(&self) -> Vec<f64> {
        let theta = self.saturated();
        let squares = self.squares(&vec![theta; self.tests.len()]).by_joint;
        let fitted = self.columns.entries.len() as f64 / self.recording.joints as f64;
        let of = |(square, factor): (f64, &HeapFactor)| {
            let freedom = (factor.rows() - fitted).max(1.0);
            (square / freedom).sqrt().max(1e-3 * torque_size(factor))
        };
        squares.into_iter().zip(&self.all).map(of).collect()
    }

    /// θ with all effects of the catalogue in the model.
    pub(crate) fn saturated(&self) -> Vec<f64> {
        let all: Vec<usize> = (0..self.columns.entries.len()).collect();
        let triangle = Triangle::new(
            &self.columns,
            &self.prior,
            &self.all,
            &self.fit.noise,
            &all,
            &[],
        );
        triangle.solve(all.len(), &[])
    }

    pub(super) fn solve_folds(&self, active: &[usize], noise: &[f64]) -> Vec<Vec<f64>> {
        let entries = self.columns.entries.len();
        let solve = |train: &Vec<HeapFactor>| {
            Triangle::new(&self.columns, &self.prior, train, noise, active, &[]).solve(entries, &[])
        };
        self.trains.iter().map(solve).collect()
    }

    /// Each fold's sum of squares, joint by joint, under its θ.
    pub(super) fn score(&self, theta: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let of = |(test, theta): (&Vec<HeapFactor>, &Vec<f64>)| self.score_fold(test, theta);
        self.tests.iter().zip(theta).map(of).collect()
    }

    pub(super) fn score_fold(&self, test: &[HeapFactor], theta: &[f64]) -> Vec<f64> {
        test.iter()
            .enumerate()
            .map(|(joint, factor)| misfit(&self.columns, joint, factor, theta))
            .collect()
    }

    /// Whether an effect of the model does nothing: the held-out error does not rise without it or, for one that is taken out
    /// of the data before, its value is within twice its error of none.
    pub(crate) fn is_superfluous(&self, place: Place) -> bool {
        let entries = self.columns.of_effect(place.0, place.1);
        let none = Corrections::none(self.recording.joints);
        let is_correction = none.clone().get_mut(place.0, place.1, 0).is_some();
        if is_correction {
            return entries.iter().all(|&k| {
                let parameter = self.columns.entries[k].parameter;
                let now = self.corrections.get(place.0, place.1, parameter) + self.fit.theta[k];
                (now - none.get(place.0, place.1, parameter)).abs() < 2.0 * self.fit.std[k]
            });
        }
        let rest: Vec<Place> = self
            .active
            .iter()
            .copied()
            .filter(|p| *p != place)
            .collect();
        let held_out = self.solve_folds(&self.entries_with(&rest), &self.fit.noise);
        let rss = self.score(&held_out);
        let rises = rss.iter().zip(&self.fit.rss);
        rises
            .map(|(without, with)| self.weighted_fall(without, with))
            .sum::<f64>()
            <= 0.0
    }

    pub(super) fn weighted_fall(&self, before: &[f64], after: &[f64]) -> f64 {
        let falls = before.iter().zip(after).zip(&self.fit.noise);
        falls
            .map(|((before, after), noise)| (before - after) / (noise * noise))
            .sum()
    }

    /// Takes an effect into the model.
    pub(crate) fn add(&mut self, place: Place) {
        self.active.push(place);
        self.refit();
        if place.0 == EffectKind::Backlash {
            self.find_gap(place.1);
        }
    }

    /// Whether the model has an effect whose column is only a derivative, so that [`rebuild`](Self::rebuild) makes it better.
    pub(crate) fn is_linearised(&self) -> bool {
        self.active.iter().any(|&place| self.is_correction(place))
    }

    /// Whether an effect is taken out of the data before, and only its derivative is a column.
    pub(crate) fn is_correction(&self, (effect, joint): Place) -> bool {
        let mut none = Corrections::none(self.recording.joints);
        effect == EffectKind::Payload
            || effect != EffectKind::VelocityGain && none.get_mut(effect, joint, 0).is_some()
    }

    /// Goes over the data again, twice where a load's place is sought: its inertia grows with the square of it.
    pub(crate) fn relinearise(&mut self) {
        self.rebuild();
        if self
            .active
            .iter()
            .any(|place| place.0 == EffectKind::Payload)
        {
            self.rebuild();
        }
    }

    /// Takes an effect out of the model if that makes the held-out sum of squares, in units of the joints' noise, larger by this
    /// factor at most. Whether it did.
    pub(crate) fn remove_unless_worse(&mut self, place: Place, most: f64) -> bool {
        let with = self.values();
        self.remove(place);
        let weighted = |fit: &Fit| fit.held_out_squares.weighted(&with.fit.noise);
        if weighted(&self.fit) <= most * weighted(&with.fit) {
            return true;
        }
        self.active.push(place);
        self.set_values(with);
        self.rebuild();
        false
    }

    /// The present values.
    pub(crate) fn values(&self) -> Values {
        Values {
            fit: self.fit.clone(),
            corrections: self.corrections.clone(),
            gap_std: self.gap_std.clone(),
            columns: self.columns.clone(),
            loads: self.loads.clone(),
        }
    }

    /// Comes back to values; [`rebuild`](Self::rebuild) or [`remove`](Self::remove) is to follow.
    pub(crate) fn set_values(&mut self, values: Values) {
        (self.fit, self.corrections) = (values.fit, values.corrections);
        (self.gap_std, self.columns, self.loads) = (values.gap_std, values.columns, values.loads);
    }

    /// Takes an effect out of the model.
    pub(crate) fn remove(&mut self, place: Place) {
        self.active.retain(|p| *p != place);
        for entry in self.columns.of_effect(place.0, place.1) {
            // Else it would be taken into the corrections that start anew.
            self.fit.theta[entry] = 0.0;
        }
        if place.0 == EffectKind::Payload {
            self.loads[place.1] = self.coms[place.1];
            return self.rebuild();
        }
        let none = Corrections::none(self.recording.joints);
        let mut corrected = false;
        for parameter in 0..place.0.description().parameters.len() {
            let neutral = none.get(place.0, place.1, parameter);
            if let Some(correction) = self.corrections.get_mut(place.0, place.1, parameter) {
                *correction = neutral;
                corrected = true;
            }
        }
        if corrected {
            self.rebuild();
        } else {
            self.refit();
        }
    }
}

/// Root mean square of a joint's torque, N m.
fn torque_size(factor: &HeapFactor) -> f64 {
    (factor.sum_of_squares(&[]) / factor.rows().max(1.0))
        .sqrt()
        .max(1e-9)
}
