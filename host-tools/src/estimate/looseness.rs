//! How far a link can move against its motor, found by trying: the width of a play, the compliance of a spring.
//!
//! A torque is far from linear in them: in a play the link is free for a while, on a spring it has a resonance. So each of a grid of
//! values is put into the model, the whole limb is predicted, and what friction, a rotor and a constant torque of each joint then leave
//! is counted, of all joints: the link that is let go moves those after it and lacks in those before.

use proprio_core::effect::EffectKind;
use rayon::prelude::*;

use super::directions::Span;
use super::limb_data::LimbData;
use super::shapes::{Scan, refined};
use crate::equation::dot::dot;
use crate::equation::values::{Place, Values};

/// The smallest gap that is tried (rad), each this much wider than the one before, and how many.
const SMALLEST: f64 = 2e-3;
const WIDER: f64 = 1.6;
const GAPS: i32 = 8;
/// Resonances of springs that are tried, from this multiple of the motion's usual frequency on, each so many times the one before: the
/// torque is far from what a column says of it up to three times the motion's frequency.
const LOWEST: f64 = 0.8;
const HIGHER: f64 = 1.25;
const RESONANCES: i32 = 14;
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
        Some(refined(&grid, &falls, &fall))
    }

    fn values_to_try(&self, place: Place) -> Vec<f64> {
        let known = self.at.get(place, 0);
        if self.is_near && known > 0.0 {
            let next = match place.0 {
                EffectKind::Elasticity => HIGHER * HIGHER,
                _ => WIDER,
            };
            return [-1, 0, 1].map(|k| known * next.powi(k)).to_vec();
        }
        let mut grid = values_to_try(self.data, self.values, place);
        if place.0 == EffectKind::Backlash {
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

/// The gaps (rad) or compliances (rad/(N m)) that are tried where none is known, from least to most.
pub(crate) fn values_to_try(data: &LimbData, values: &Values, place: Place) -> Vec<f64> {
    if place.0 != EffectKind::Elasticity {
        return (0..GAPS).map(|k| SMALLEST * WIDER.powi(k)).collect();
    }
    let inertia = (data.motion).mean_inertia(&data.body, values, place.1);
    let lowest = LOWEST * usual_frequency(data, place.1);
    let compliance = |k: i32| (inertia * (lowest * HIGHER.powi(k)).powi(2)).recip();
    (0..RESONANCES).rev().map(compliance).collect()
}

/// Acceleration over velocity of a joint, root mean squares, rad/s.
fn usual_frequency(data: &LimbData, joint: usize) -> f64 {
    let state = &data.motion.joint[joint].state;
    let square = |n: usize| state.iter().map(|state| state[n] * state[n]).sum::<f64>();
    (square(2) / square(1).max(f64::MIN_POSITIVE))
        .sqrt()
        .max(1.0)
}
