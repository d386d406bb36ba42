//! The width of a joint's play, found by trying.
//!
//! A torque is far from linear in a gap: while the link is free it is not there at all. So each of a grid of gaps is put into the
//! model, the whole limb is predicted, and what friction, a rotor and a constant torque of each joint then leave is counted, of all
//! joints: the link that a play lets go moves those after it and lacks in those before.

use proprio_core::effect::EffectKind;

use super::shapes::{Scan, refined};
use crate::equation::dot::dot;
use crate::equation::motion::TYPICAL_PLAY;

/// The smallest gap that is tried (rad), each this much wider than the one before, and how many.
const SMALLEST: f64 = 2e-3;
const WIDER: f64 = 1.6;
const GAPS: i32 = 8;
/// A gap that takes away less than this share of the sum of squares is not looked for more closely: no effect counts that does
/// (`select::criteria::LEAST_GAIN`).
const LEAST_FALL: f64 = 0.01;

/// A joint's windows, what the model leaves in them, and what its own columns may take of that.
struct Told {
    joint: usize,
    windows: Vec<usize>,
    residual: Vec<f64>,
    basis: Vec<Vec<f64>>,
}

impl Told {
    /// The sum of squares that is left where the prediction moves from `now` to `there`, (N m)².
    fn left(&self, joints: usize, there: &[f64], now: &[f64]) -> f64 {
        let moved = (self.windows.iter())
            .map(|w| there[w * joints + self.joint] - now[w * joints + self.joint]);
        let left: Vec<f64> = self
            .residual
            .iter()
            .zip(moved)
            .map(|(r, by)| r - by)
            .collect();
        let taken: f64 = self.basis.iter().map(|b| dot(b, &left).powi(2)).sum();
        dot(&left, &left) - taken
    }
}

impl Scan<'_> {
    /// The gap of a joint's play under which least is left in the chosen folds; `None` if their windows are too few.
    pub(super) fn best_gap(&self, joint: usize, chosen: &dyn Fn(usize) -> bool) -> Option<f64> {
        let place = (EffectKind::Backlash, joint);
        let n = self.data.joints();
        self.told(joint, chosen)?;
        let told = |j: usize| {
            let (windows, residual) = self.told(j, chosen)?;
            Some(Told {
                joint: j,
                basis: self.basis(&windows, j),
                windows,
                residual,
            })
        };
        let told: Vec<Told> = (0..n).filter_map(told).collect();
        // Bodies stay as they are, and with them what the gears transmit.
        let load = self.data.motion.load(&self.data.body, self.values);
        let now = self.data.predicted_under(load.as_ref(), self.values);
        let fall = |gap: f64| {
            let mut values = self.values.clone();
            values.insert(place);
            values.set(place, 0, gap);
            let there = self.data.predicted_under(load.as_ref(), &values);
            -told
                .iter()
                .map(|told| told.left(n, &there, &now))
                .sum::<f64>()
        };
        let mut grid: Vec<f64> = (0..GAPS).map(|k| SMALLEST * WIDER.powi(k)).collect();
        // One that was found before may lie between two of them.
        grid.extend(Some(self.at.get(place, 0)).filter(|known| *known > 0.5 * SMALLEST));
        grid.sort_unstable_by(f64::total_cmp);
        let falls: Vec<f64> = grid.iter().map(|&gap| fall(gap)).collect();
        let before: f64 = told.iter().map(|told| told.left(n, &now, &now)).sum();
        if falls.iter().all(|fall| -fall > (1.0 - LEAST_FALL) * before) {
            // No play: which gap explains nothing best does not matter.
            return Some(TYPICAL_PLAY);
        }
        Some(refined(&grid, &falls, &fall))
    }
}
