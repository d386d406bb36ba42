//! How far a link can move against its motor, found by trying: the width of a play, the compliance of a spring.
//!
//! A torque is far from linear in them: in a play the link is free for a while, on a spring it has a resonance. So each of a grid of
//! values is put into the model, the whole limb is predicted, and what friction, a rotor and a constant torque of each joint then leave
//! is counted, of all joints: the link that is let go moves those after it and lacks in those before.

use proprio_core::effect::Enters;
use rayon::prelude::*;

use super::directions::Span;
pub(crate) use super::grid::values_to_try;
use super::grid::{SMALLEST, step_near};
use super::shapes::{Scan, refined};
use crate::equation::dot::dot;
use crate::equation::values::Place;

/// A value that takes away less than this share of the sum of squares is not looked for more closely: no effect counts that does
/// (`select::criteria::LEAST_GAIN`).
const LEAST_FALL: f64 = 0.01;

/// A joint's windows, the torque that was measured in them, and directions that its own columns may take of what is left.
struct Told {
    joint: usize,
    windows: Vec<usize>,
    basis: Span,
}

impl Scan<'_> {
    /// The gap or the compliance of a joint under which least is left in the chosen folds; `None` if their windows are too few, or no
    /// value leaves less than none.
    pub(super) fn best_looseness(
        &self,
        place: Place,
        chosen: &dyn Fn(usize) -> bool,
    ) -> Option<f64> {
        self.told(place.1, chosen)?;
        let told = |j: usize| {
            let (windows, _) = self.told(j, chosen)?;
            let basis = self.basis(&windows, j);
            Some(Told {
                joint: j,
                windows,
                basis,
            })
        };
        let told: Vec<Told> = (0..self.data.joints()).filter_map(told).collect();
        let mut judged = vec![false; self.data.motion.windows.len()];
        for told in &told {
            told.windows.iter().for_each(|&w| judged[w] = true);
        }
        let judged = |w: usize| judged[w];
        let with = self.data.loose_link(self.values, place, &judged);
        let fall = |value: f64| {
            let predicted = with.predicted(value);
            let left = told.iter().map(|told| self.left(told, &predicted));
            -left.sum::<f64>()
        };
        let grid = self.values_to_try(place);
        let falls = || -> Vec<f64> { grid.par_iter().map(|&value| fall(value)).collect() };
        let (falls, without) = rayon::join(falls, || fall(0.0));
        if falls
            .iter()
            .all(|fall| *fall < (1.0 - LEAST_FALL) * without)
        {
            return None;
        }
        Some(refined(&grid, &falls, 0.0, &fall))
    }

    fn values_to_try(&self, place: Place) -> Vec<f64> {
        let known = self.at.get(place, 0);
        if self.is_near && known > 0.0 {
            let next = step_near(place.0);
            return [-1, 0, 1].map(|k| known * next.powi(k)).to_vec();
        }
        let mut grid = values_to_try(self.data, self.values, place);
        if place.0.description().enters == Enters::Trial {
            // One that was found before may lie between two of them.
            grid.extend(Some(known).filter(|known| *known > 0.5 * SMALLEST));
            grid.sort_unstable_by(f64::total_cmp);
        }
        grid
    }

    /// The sum of squares that a prediction leaves of a joint, (N m)².
    fn left(&self, told: &Told, predicted: &[f64]) -> f64 {
        let at = |w: &usize| w * self.data.joints() + told.joint;
        let left = told
            .windows
            .iter()
            .map(|w| self.data.torque[at(w)] - predicted[at(w)]);
        let left: Vec<f64> = left.collect();
        let taken: f64 = told.basis.iter().map(|b| dot(b, &left).powi(2)).sum();
        dot(&left, &left) - taken
    }
}
