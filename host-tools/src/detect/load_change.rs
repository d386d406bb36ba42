//! A load that comes or goes within a log: a hand that picks something up, a foot that catches a strap.
//!
//! A model has one body for the whole log. Of what it leaves, the ten inertial parameters of a body are fitted before and after a time, whatever else the
//! model has as it is; the time and the body are those at which that explains most. It is no drift of a joint: one change explains what is left
//! of every joint that carries the body.

use nalgebra::{SMatrix, SVector};
use proprio_core::inertia::INERTIAL;

use super::bodies::AT_FLOOR;
use super::residual::NoiseFloor;
use crate::equation::column::Column;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::select::criteria::step::explains_most;

/// Times that are looked at first; then those between the best one's neighbours.
const TIMES: usize = 200;
/// Neither part of the log is shorter than this share of it.
const LEAST_SHARE: f64 = 0.05;
/// A mass that is not so many standard deviations from nothing is no load.
const SURE: f64 = 5.0;
/// Shrinkage as a share of a column's square: what all windows together do not tell is not told of a part.
const SHRINKAGE: f64 = 1e-6;

/// A body that changes at a time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct LoadChange {
    /// The joint that moves the body.
    pub(crate) joint: usize,
    /// When, s.
    pub(crate) from: f64,
    /// By how much, kg, and its standard deviation.
    pub(crate) mass: [f64; 2],
}

/// Products of a body's columns with each other and with what a model leaves, in units of the noise.
#[derive(Clone, Copy, Default)]
struct Products {
    squares: SMatrix<f64, INERTIAL, INERTIAL>,
    with_left: SVector<f64, INERTIAL>,
}

impl Products {
    fn add(&mut self, row: &SVector<f64, INERTIAL>, left: f64) {
        self.squares.ger(1.0, row, row, 1.0);
        self.with_left.axpy(left, row, 1.0);
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            squares: self.squares - other.squares,
            with_left: self.with_left - other.with_left,
        }
    }

    /// The parameters that explain most, the mass's variance in units of the noise, and the sum of squares that they explain.
    fn solved(&self, shrinkage: &SVector<f64, INERTIAL>) -> Option<(f64, f64, f64)> {
        let factor = (self.squares + SMatrix::from_diagonal(shrinkage)).cholesky()?;
        let found = factor.solve(&self.with_left);
        let mass = SVector::<f64, INERTIAL>::ith(0, 1.0);
        Some((found[0], factor.solve(&mass)[0], found.dot(&self.with_left)))
    }
}

/// The change that explains most of what a model with these `values` leaves of one log's limb beyond its joints' noise, where it predicts so: none where
/// little is left, or another cause has most of it.
pub(crate) fn of(
    data: &LimbData,
    values: &Values,
    predicted: &[f64],
    noise: &[Option<NoiseFloor>],
) -> Option<LoadChange> {
    let n = data.joints();
    let noise: Vec<f64> = (noise.iter())
        .map(|noise| Some(noise.as_ref()?.rms))
        .collect::<Option<_>>()?;
    if data.recording.log_starts.len() > 1 {
        return None;
    }
    let windows: Vec<usize> = (0..data.motion.windows.len())
        .filter(|&w| (0..n).any(|j| data.counts(w, j)))
        .collect();
    let judged = |w: usize| (0..n).filter(move |&j| data.counts(w, j));
    let left = |w: usize, j: usize| (data.torque[w * n + j] - predicted[w * n + j]) / noise[j];
    let (mut all, mut count) = (0.0, 0.0);
    for &w in &windows {
        for j in judged(w) {
            all += left(w, j).powi(2);
            count += 1.0;
        }
    }
    if all <= AT_FLOOR * count {
        return None;
    }
    let columns = data.columns(values, &[], &[]);
    let rows = data.rows(values, &columns);
    let change = |body: usize| {
        let first =
            |j: usize| (columns.of_joint[j].iter()).position(|c| *c == Column::Inertial(body, 0));
        let first: Vec<Option<usize>> = (0..n).map(first).collect();
        let mut sums = vec![Products::default()];
        for &w in &windows {
            let mut sum = sums[sums.len() - 1];
            for j in judged(w) {
                let Some(first) = first[j] else { continue };
                let row = &rows.row(w, j)[first..first + INERTIAL];
                let row = SVector::from_column_slice(row) / noise[j];
                sum.add(&row, left(w, j));
            }
            sums.push(sum);
        }
        best_split(&sums)
            .map(|(at, mass, variance, explained)| (explained, body, at, mass, variance))
    };
    let best = (0..n).filter_map(change).max_by(|a, b| a.0.total_cmp(&b.0));
    let (explained, joint, at, mass, variance) = best?;
    let error = ((all - explained).max(count) / count * variance).sqrt();
    let found = LoadChange {
        joint,
        from: data.motion.windows[*windows.get(at)?].t,
        mass: [mass, error],
    };
    (explains_most(all, all - explained, count) && mass.abs() > SURE * error).then_some(found)
}

/// Of running sums the place at which a change explains most: with it the mass that comes, its variance in units of the noise, and by how much a model
/// with the change explains more than one without.
fn best_split(sums: &[Products]) -> Option<(usize, f64, f64, f64)> {
    let (whole, last) = (sums.last()?, sums.len() - 1);
    let shrinkage = SHRINKAGE * whole.squares.diagonal();
    let alone = whole.solved(&shrinkage)?.2;
    let split = |at: usize| {
        let before = sums[at].solved(&shrinkage)?;
        let after = whole.minus(&sums[at]).solved(&shrinkage)?;
        let explained = before.2 + after.2 - alone;
        Some((at, after.0 - before.0, after.1 + before.1, explained))
    };
    let best = |from: usize, to: usize, by: usize| {
        let all = (from..to).step_by(by).filter_map(split);
        all.max_by(|a, b| a.3.total_cmp(&b.3))
    };
    let ends = (LEAST_SHARE * last as f64) as usize + 1;
    let by = last.div_ceil(TIMES);
    let near = best(ends, last.saturating_sub(ends), by)?.0;
    best(near.saturating_sub(by).max(ends), near + by + 1, 1)
}
