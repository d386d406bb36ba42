//! The width of a joint's play, found by trying.
//!
//! A torque is far from linear in a gap: while the link is free it is not there at all. So each of a grid of gaps is put into the
//! model, the whole limb is predicted, and what friction, a rotor and a constant torque of each joint then leave is counted, of all
//! joints: the link that a play lets go moves those after it and lacks in those before.

use proprio_core::effect::EffectKind;
use rayon::prelude::*;

use super::directions::Span;
use super::shapes::{Scan, refined};
use crate::equation::dot::dot;

/// The smallest gap that is tried (rad), each this much wider than the one before, and how many.
const SMALLEST: f64 = 2e-3;
const WIDER: f64 = 1.6;
const GAPS: i32 = 8;
/// A gap that takes away less than this share of the sum of squares is not looked for more closely: no effect counts that does
/// (`select::criteria::LEAST_GAIN`).
const LEAST_FALL: f64 = 0.01;

/// A joint's windows, the torque that was measured in them, and directions that its own columns may take of what is left.
struct Told {
    joint: usize,
    windows: Vec<usize>,
    basis: Span,
}

impl Scan<'_> {
    /// The gap of a joint's play under which least is left in the chosen folds; `None` if their windows are too few, or no gap leaves
    /// less than none.
    pub(super) fn best_gap(&self, joint: usize, chosen: &dyn Fn(usize) -> bool) -> Option<f64> {
        let place = (EffectKind::Backlash, joint);
        self.told(joint, chosen)?;
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
        // Bodies stay as they are, and with them what the gears transmit.
        let load = self.data.motion.load(&self.data.body, self.values);
        let fall = |gap: f64| {
            let mut values = self.values.clone();
            values.insert(place);
            values.set(place, 0, gap);
            let predicted = self.data.predicted_under(load.as_ref(), &values);
            -told
                .iter()
                .map(|told| self.left(told, &predicted))
                .sum::<f64>()
        };
        let mut grid: Vec<f64> = (0..GAPS).map(|k| SMALLEST * WIDER.powi(k)).collect();
        // One that was found before may lie between two of them.
        grid.extend(Some(self.at.get(place, 0)).filter(|known| *known > 0.5 * SMALLEST));
        grid.sort_unstable_by(f64::total_cmp);
        let falls: Vec<f64> = grid.par_iter().map(|&gap| fall(gap)).collect();
        let without = fall(0.0);
        if falls
            .iter()
            .all(|fall| *fall < (1.0 - LEAST_FALL) * without)
        {
            return None;
        }
        Some(refined(&grid, &falls, &fall))
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
