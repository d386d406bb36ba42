//! Whether a target or the measuring system moved between two poses.

use nalgebra::DMatrix;

use super::columns::{Column, Unknown};
use super::error::CalibrateError;
use super::fit::{Fit, Problem};
use super::held_out;
use crate::robust::gain;

/// Fewest poses on either side of a move.
const LEAST_POSES: usize = 4;
/// A move is believed if the held-out error falls below this share …
const FALLS_TO: f64 = 0.7;
/// … by a mean gain of so many of its standard errors: some sixty moves are tried.
const LEAST_Z: f64 = 4.0;
/// What a move is taken to be before the data: 10 mm, 10 mrad.
const SIZE: f64 = 0.01;

/// Refuses poses in the midst of which something moved.
pub(super) fn check(problem: &Problem, fit: &Fit) -> Result<(), CalibrateError> {
    let mut things: Vec<(String, Vec<Unknown>)> = (problem.poses.targets.iter().enumerate())
        .map(|(t, name)| {
            (
                format!("target {name}"),
                (0..3).map(|k| Unknown::Target(t, k)).collect(),
            )
        })
        .collect();
    let mount = (0..6).map(Unknown::Mount).collect();
    things.push(("the measuring system or the robot's base".to_owned(), mount));
    let before = held_out::by_pose(&fit.rows, &fit.held_out);
    let sum = |x: &[f64]| x.iter().sum::<f64>();
    let mut best: Option<(f64, usize, usize, DMatrix<f64>)> = None;
    for (n, (_, unknowns)) in things.iter().enumerate() {
        let columns: Vec<Column> = (unknowns.iter())
            .map(|&unknown| Column::about_zero(unknown, SIZE))
            .collect();
        let whole = fit.more(problem, &columns);
        let last = fit.rows.poses.len().saturating_sub(LEAST_POSES);
        for split in LEAST_POSES..=last {
            let Some((_, range)) = fit.rows.poses.get(split) else {
                continue;
            };
            let mut after = whole.clone();
            after.rows_mut(0, range.start).fill(0.0);
            let errors = fit.solved.held_out_with(&fit.rows, Some(&after));
            let by_pose = held_out::by_pose(&fit.rows, &errors);
            let error = sum(&by_pose);
            let falls = (error / sum(&before)).sqrt() < FALLS_TO;
            if falls
                && best.as_ref().is_none_or(|(least, ..)| error < *least)
                && gain(&before, &by_pose) >= LEAST_Z
            {
                best = Some((error, n, split, after));
            }
        }
    }
    let Some((_, thing, split, columns)) = best else {
        return Ok(());
    };
    let errors = fit.solved.held_out_with(&fit.rows, Some(&columns));
    let step = fit.solved.further_steps(&fit.rows, &columns);
    let called = |n: usize| problem.poses.called(fit.rows.poses[n].0);
    Err(CalibrateError::Moved {
        what: things[thing].0.clone(),
        by: 1e3 * SIZE * step.iter().take(3).map(|x| x * x).sum::<f64>().sqrt(),
        before: called(split - 1),
        after: called(split),
        error: fit.error_mm(),
        split: 1e3 * held_out::place_rms(&fit.rows, &errors),
    })
}
