//! Poses that do not fit the others: named, and left out of the fit.
//!
//! They are looked for with all that a robot may have, mount, targets, frames and elasticity, by a fit that far poses pull less and less
//! (Cauchy's weights: Huber & Ronchetti 2009, §7.8): a pose that is wrong by more than the model would otherwise hide what the model lacks.

use nalgebra::DVector;

use super::chain::State;
use super::columns::{self, Column};
use super::error::CalibrateError;
use super::fit::Problem;
use super::held_out;
use super::poses::Poses;
use super::start;
use crate::robust::median;

/// A pose is an outlier if its residual is this many times the median one. Of errors that are normal one pose in 10⁸ is; what a model lacks is
/// bounded and stays below.
const FAR: f64 = 6.0;
/// Where Cauchy's weight is a half, in medians of the residuals' sizes: 95 % efficiency for normal errors is at 2.4 standard deviations.
const HALF_WEIGHT: f64 = 2.4;
/// Rounds of weights; they settle in five.
const ROUNDS: usize = 10;
/// More outliers than this share are no accident, …
const MOST_SHARE: f64 = 0.1;
/// … but so many may be, however few the poses are.
const ALWAYS: usize = 1;

/// Poses beyond what errors of measurement explain, each with its error in mm, by a fit of these columns.
///
/// # Errors
/// [`CalibrateError::Outliers`] if they are more than may be.
pub(super) fn find(
    problem: &Problem,
    started: &State,
    columns: Vec<Column>,
) -> Result<Vec<(usize, f64)>, CalibrateError> {
    let fit = problem.fit(columns, started, start::UNKNOWN_NOISE);
    let rows = columns::rows(
        problem.chain,
        &fit.state,
        &problem.used(),
        &fit.columns,
        fit.noise,
    );
    let prior = fit
        .columns
        .iter()
        .map(|c| -fit.state.value(problem.chain, c.unknown) / c.prior);
    let prior = DVector::from_iterator(fit.columns.len(), prior);
    let mut sizes = vec![1.0; rows.poses.len()];
    let mut middle = 1.0;
    let mut left = rows.b.clone();
    for _ in 0..ROUNDS {
        let mut weighted = rows.clone();
        for ((_, range), size) in rows.poses.iter().zip(&sizes) {
            let far = size / (HALF_WEIGHT * middle);
            let scale = 1.0 / (middle * (1.0 + far * far).sqrt());
            weighted
                .w
                .rows_mut(range.start, range.len())
                .scale_mut(scale);
            weighted
                .b
                .rows_mut(range.start, range.len())
                .scale_mut(scale);
        }
        left = &rows.b - &rows.w * held_out::solve(&weighted, &prior).step;
        sizes = (rows.poses.iter())
            .map(|(_, range)| {
                let own = left.rows(range.start, range.len());
                own.norm() / (range.len().max(1) as f64).sqrt()
            })
            .collect();
        middle = match median(sizes.iter().copied()) {
            Some(middle) if middle > 0.0 => middle,
            _ => return Ok(Vec::new()),
        };
    }
    let mut found = Vec::new();
    for ((pose, range), size) in rows.poses.iter().zip(&sizes) {
        if *size > FAR * middle {
            let places = range.clone().filter(|&k| rows.is_place[k]);
            let squares: f64 = places.map(|k| (left[k] * rows.unit[k]).powi(2)).sum();
            found.push((*pose, 1e3 * squares.sqrt()));
        }
    }
    check(&found, problem.poses)?;
    Ok(found)
}

/// Refuses more than may be.
fn check(outliers: &[(usize, f64)], poses: &Poses) -> Result<(), CalibrateError> {
    let most = ((MOST_SHARE * poses.count() as f64) as usize).max(ALWAYS);
    if outliers.len() <= most {
        return Ok(());
    }
    let which = outliers
        .iter()
        .map(|(pose, mm)| format!("{} by {mm:.1} mm", poses.called(*pose)));
    Err(CalibrateError::Outliers {
        count: outliers.len(),
        poses: poses.count(),
        which: which.collect::<Vec<_>>().join(", "),
    })
}
