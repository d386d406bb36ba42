//! Poses that do not fit the others: named, and left out of the fit.

use super::error::CalibrateError;
use super::fit::{Fit, Problem};
use super::poses::Poses;
use crate::robust::median;

/// A pose is an outlier if its studentised residual is this many times the median one. Of errors that are normal one pose in 10⁸ is; what a
/// model lacks is bounded and stays below.
const FAR: f64 = 6.0;
/// More outliers than this share are no accident, …
const MOST_SHARE: f64 = 0.1;
/// … but so many may be, however few the poses are.
const ALWAYS: usize = 1;

/// Poses beyond what errors of measurement explain, and how many times the median.
pub(super) fn of(fit: &Fit) -> Vec<(usize, f64)> {
    let sizes = fit.sizes();
    let Some(middle) = median(sizes.iter().map(|(_, size)| *size)).filter(|m| *m > 0.0) else {
        return Vec::new();
    };
    (sizes.into_iter())
        .map(|(pose, size)| (pose, size / middle))
        .filter(|(_, ratio)| *ratio > FAR)
        .collect()
}

/// Takes the worst pose out of the problem: another may only look bad beside it. Its place, and its error in mm.
pub(super) fn worst(
    problem: &mut Problem,
    fit: &Fit,
    found: Vec<(usize, f64)>,
) -> Option<(usize, f64)> {
    let (pose, _) = found.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    problem.used.retain(|&used| used != pose);
    let (_, range) = fit.rows.poses.iter().find(|(number, _)| *number == pose)?;
    let places = range.clone().filter(|&k| fit.rows.is_place[k]);
    let squares: f64 = places
        .clone()
        .map(|k| (fit.held_out[k] * fit.rows.unit[k]).powi(2))
        .sum();
    Some((
        pose,
        1e3 * (3.0 * squares / places.count().max(1) as f64).sqrt(),
    ))
}

/// Refuses more than may be.
pub(super) fn check(outliers: &[(usize, f64)], poses: &Poses) -> Result<(), CalibrateError> {
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
