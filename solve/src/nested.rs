//! Every model that leaves effects out of a larger one, fitted and judged from factors alone.
//!
//! Two factors of each joint and fold of time are enough: one of weighed rows, to which models are fitted, and one of rows as they
//! are, by which a model's error is told. Leaving an effect out drops its columns. Each fold is predicted by the fit to all
//! others, so that the error is one on data that the fit has not seen. All of it is exact as far as the torque is linear in the
//! parameters; the weights are those of the larger model.

use std::sync::Arc;

use nalgebra::DVector;
use proprio_core::inertia::{INERTIAL, InertialParameters};

use crate::bounded::{Bounded, Problem};
use crate::factor::{HeapFactor, numbers_of};
use crate::far;
use crate::group::{Group, noises, stacked};

/// Times that the joints' noise is found again from the fit that it gives.
pub const NOISE_ROUNDS: usize = 3;

/// A limb: what is known of its parameters before any data, and its data.
#[derive(Debug, Clone, PartialEq)]
pub struct NestedLimb {
    /// Each body by the CAD, and its relative uncertainty.
    pub bodies: Vec<(InertialParameters<f64>, f64)>,
    /// All parameters that are no body's; they come after those in θ.
    pub others: Vec<Bounded>,
    /// Of each of `others`, the effect that it belongs to, counted from zero; none for what every model has.
    pub effect: Vec<Option<usize>>,
    /// The limb's joints.
    pub joints: Vec<NestedJoint>,
    /// Most that a fit leaves of what it has not seen where it leaves noise alone, (N m)²; zero where that is unknown.
    pub at_floor: f64,
}

/// A joint's data.
#[derive(Debug, Clone, PartialEq)]
pub struct NestedJoint {
    /// Of each entry of θ, its column in the joint's factors; none where the joint does not feel it.
    pub places: Vec<Option<usize>>,
    /// Of each fold, weighed rows.
    pub train: Vec<HeapFactor>,
    /// Of each fold, rows in N m.
    pub test: Vec<HeapFactor>,
}

/// A model's fits, fold by fold.
#[derive(Debug, Clone, PartialEq)]
pub struct NestedFit {
    /// Sum of squared errors \[fold\] \[joint\] on the fold that the fit has not seen, (N m)².
    pub squares: Vec<Vec<f64>>,
    /// θ of the fit to all other folds \[fold\]; zero for what the model leaves out.
    pub theta: Vec<Vec<f64>>,
}

impl NestedLimb {
    fn entries(&self) -> usize {
        INERTIAL * self.bodies.len() + self.others.len()
    }

    /// How many folds there are.
    pub fn folds(&self) -> usize {
        self.joints.first().map_or(0, |joint| joint.train.len())
    }

    /// The model that has the effects which are `there`; `None` if a number is not finite.
    pub fn fit(&self, there: &dyn Fn(usize) -> bool) -> Option<NestedFit> {
        let first = INERTIAL * self.bodies.len();
        let is_there = |e: &usize| {
            let effect = e.checked_sub(first).and_then(|n| self.effect[n]);
            effect.is_none_or(there)
        };
        let active: Vec<usize> = (0..self.entries()).filter(is_there).collect();
        let places =
            |joint: &NestedJoint| Arc::new(active.iter().map(|&e| joint.places[e]).collect());
        let groups = |joint: &NestedJoint| -> Vec<Group> {
            let places: Arc<Vec<Option<usize>>> = places(joint);
            let group = |factor: &HeapFactor| Group::new(factor.clone(), places.clone());
            joint.train.iter().map(group).collect()
        };
        let by_joint: Vec<Vec<Group>> = self.joints.iter().map(groups).collect();
        let sum = |but: Option<usize>| -> Option<Vec<Group>> {
            let of = |folds: &Vec<Group>| {
                let parts = folds.iter().enumerate().filter(|(f, _)| Some(*f) != but);
                Group::sum(parts.map(|(_, group)| group))
            };
            by_joint.iter().map(of).collect()
        };
        let all = sum(None)?;
        let sizes: Vec<f64> = all.iter().map(Group::size).collect();
        let mut problem = Problem {
            bodies: self.bodies.clone(),
            others: (active.iter())
                .filter_map(|e| e.checked_sub(first))
                .map(|n| self.others[n])
                .collect(),
            data: stacked(&all, &sizes),
            free: false,
        };
        let mut solution = problem.solve()?;
        let mut noise = sizes.clone();
        for _ in 0..NOISE_ROUNDS {
            noise = noises(&all, &solution.theta, &sizes);
            problem.data = stacked(&all, &noise);
            solution = problem.solve_from(&solution.theta)?;
        }
        let folds = |problem: &mut Problem, noise: &[f64], theta: &DVector<f64>| {
            let mut fit = NestedFit {
                squares: Vec::new(),
                theta: Vec::new(),
            };
            for f in 0..self.folds() {
                problem.data = stacked(&sum(Some(f))?, noise);
                let own = problem.theta_from(theta)?;
                let full = self.spread(&active, &own);
                let squares =
                    |joint: &NestedJoint| joint.test[f].sum_of_squares(&joint.combined(&full));
                fit.squares.push(self.joints.iter().map(squares).collect());
                fit.theta.push(full);
            }
            let finite = fit.squares.iter().flatten().all(|x| x.is_finite());
            finite.then_some(fit)
        };
        if problem.has_far_body(&solution) {
            // Released where that leaves noise alone: else what the model lacks would hide in an absurd mass.
            let (mut free, mut noise, mut far) = (problem.clone(), noise.clone(), solution.clone());
            for _ in 0..far::ROUNDS {
                if !free.release(&far) {
                    break;
                }
                far = free.solve_from(&far.theta)?;
                noise = noises(&all, &far.theta, &sizes);
                free.data = stacked(&all, &noise);
                far = free.solve_from(&far.theta)?;
            }
            let fit = folds(&mut free, &noise, &far.theta)?;
            if fit.squares.iter().flatten().sum::<f64>() <= self.at_floor {
                return Some(fit);
            }
        }
        folds(&mut problem, &noise, &solution.theta)
    }

    fn spread(&self, active: &[usize], theta: &DVector<f64>) -> Vec<f64> {
        let mut full = vec![0.0; self.entries()];
        for (&e, value) in active.iter().zip(theta.iter()) {
            full[e] = *value;
        }
        full
    }

    /// All of it as numbers, which [`NestedLimb::read`] takes.
    pub fn write(&self, to: &mut Vec<f64>) {
        let count = |n: usize| n as f64;
        to.extend(
            [
                self.bodies.len(),
                self.others.len(),
                self.joints.len(),
                self.folds(),
            ]
            .map(count),
        );
        to.push(self.at_floor);
        for (body, relative) in &self.bodies {
            to.extend(body.0.iter());
            to.push(*relative);
        }
        for (other, effect) in self.others.iter().zip(&self.effect) {
            to.extend([other.mean, other.std, other.lower, other.upper]);
            to.push(effect.map_or(-1.0, count));
        }
        for joint in &self.joints {
            let columns = joint.train.first().map_or(0, HeapFactor::columns);
            to.push(count(columns));
            to.extend(joint.places.iter().map(|place| place.map_or(-1.0, count)));
            for factor in joint.train.iter().chain(&joint.test) {
                to.push(factor.rows());
                to.extend_from_slice(factor.numbers());
            }
        }
    }

    /// What [`NestedLimb::write`] gave out, from the beginning of `from`, which then begins after it; `None` if it is something else.
    pub fn read(from: &mut &[f64]) -> Option<Self> {
        let [bodies, others, joints, folds] = [(); 4].map(|()| size(from));
        let (bodies, others, joints, folds) = (bodies?, others?, joints?, folds?);
        let at_floor = *take(from, 1)?.first()?;
        let body = |_| {
            let numbers = take(from, INERTIAL + 1)?;
            let inertia =
                InertialParameters(nalgebra::SVector::from_column_slice(&numbers[..INERTIAL]));
            Some((inertia, numbers[INERTIAL]))
        };
        let bodies: Vec<_> = (0..bodies).map(body).collect::<Option<_>>()?;
        let mut limb = Self {
            bodies,
            others: Vec::new(),
            effect: Vec::new(),
            joints: Vec::new(),
            at_floor,
        };
        for _ in 0..others {
            let &[mean, std, lower, upper, effect] = take(from, 5)? else {
                return None;
            };
            limb.others.push(Bounded {
                mean,
                std,
                lower,
                upper,
            });
            limb.effect.push(place(effect));
        }
        for _ in 0..joints {
            let columns = size(from)?;
            let places: Vec<_> = take(from, limb.entries())?
                .iter()
                .map(|&x| place(x))
                .collect();
            if places.iter().flatten().any(|&p| p >= columns) {
                return None;
            }
            let mut factors = Vec::new();
            for _ in 0..2 * folds {
                let rows = *take(from, 1)?.first()? as usize;
                let packed = take(from, numbers_of(columns))?.to_vec();
                factors.push(HeapFactor::from_numbers(columns, rows, packed)?);
            }
            let test = factors.split_off(folds);
            limb.joints.push(NestedJoint {
                places,
                train: factors,
                test,
            });
        }
        Some(limb)
    }
}

impl NestedJoint {
    /// θ as multiples of the joint's columns.
    fn combined(&self, theta: &[f64]) -> Vec<f64> {
        let mut own = vec![0.0; self.test.first().map_or(0, HeapFactor::columns)];
        for (place, value) in self.places.iter().zip(theta) {
            if let Some(place) = place {
                own[*place] += value;
            }
        }
        own
    }
}

/// The next `n` numbers.
fn take<'a>(from: &mut &'a [f64], n: usize) -> Option<&'a [f64]> {
    let (taken, rest) = from.split_at_checked(n)?;
    *from = rest;
    Some(taken)
}

/// A count that is no larger than what it counts could be.
fn size(from: &mut &[f64]) -> Option<usize> {
    let n = *take(from, 1)?.first()?;
    (n >= 0.0 && n <= from.len() as f64 && n.fract() == 0.0).then_some(n as usize)
}

/// A place; none below zero.
fn place(number: f64) -> Option<usize> {
    (number >= 0.0).then_some(number as usize)
}

#[cfg(test)]
mod tests;
