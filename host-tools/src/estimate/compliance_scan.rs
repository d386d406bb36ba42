//! How far a link can move against its motor, found by trying: the width of a play, the compliance of a spring.
//!
//! A torque is far from linear in them: in a play the link is free for a while, on a spring it has a resonance. So each of a grid of
//! values is put into the model, the whole limb is predicted, and what the model's other parameters then leave is counted, of all joints:
//! the link that is let go moves those after it and lacks in those before, and where it sags the bodies have stood for that.

use proprio_core::effect::Enters;

pub(crate) use super::grid::values_to_try;
use super::grid::{SMALLEST, step_near};
use super::refit::{Refit, Told};
use super::shapes::{Scan, refined};
use crate::equation::values::Place;
use crate::parallel::side_by_side;

/// A value that takes away less than this share of the sum of squares is not looked for more closely: no effect counts that does
/// (`select::criteria::LEAST_GAIN`).
const LEAST_FALL: f64 = 0.01;

impl Scan<'_> {
    /// The gap or the compliance of a joint under which least is left in the chosen folds; `None` if their windows are too few, or no
    /// value leaves less than none.
    pub(super) fn best_looseness(
        &self,
        place: Place,
        chosen: &dyn Fn(usize) -> bool,
    ) -> Option<f64> {
        self.told(place.1, chosen)?;
        let told = |joint: usize| {
            let (windows, now) = self.told(joint, chosen)?;
            Some(Told {
                joint,
                windows,
                now,
            })
        };
        let told: Vec<Told> = (0..self.data.joints()).filter_map(told).collect();
        let mut judged = vec![false; self.data.motion.windows.len()];
        for told in &told {
            told.windows.iter().for_each(|&w| judged[w] = true);
        }
        let judged = |w: usize| judged[w];
        let refit = Refit::of((self.data, self.values), place, told, &judged)?;
        let with = self.data.loose_link(self.values, place, &judged);
        let fall = |value: f64| -refit.left(&with.predicted(value));
        let grid = self.values_to_try(place);
        let tried: Vec<f64> = grid.iter().copied().chain([0.0]).collect();
        let mut falls = side_by_side(&tried, |&value| fall(value));
        let without = falls.pop()?;
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
}
