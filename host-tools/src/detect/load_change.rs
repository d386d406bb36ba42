//! A load that comes or goes within a log: a hand that picks something up, a foot that catches a strap.
//!
//! A model has one body for the whole log. Of what it leaves, the ten inertial parameters of a body are fitted before and after a time, whatever else the
//! model has as it is; the time and the body are those at which that explains most. All that the model has beside that body was fitted to both parts: for
//! the mass all of it is fitted once more, beside the change. It is no drift of a joint: one change explains what is left of every joint that carries
//! the body.

use nalgebra::{DMatrix, DVector, SMatrix, SVector};
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

    /// The sum of squares that the parameters explain at most.
    fn explained(&self, shrinkage: &SVector<f64, INERTIAL>) -> Option<f64> {
        let factor = (self.squares + SMatrix::from_diagonal(shrinkage)).cholesky()?;
        Some(factor.solve(&self.with_left).dot(&self.with_left))
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
        best_split(&sums).map(|(explained, at)| (explained, body, at))
    };
    let best = (0..n).filter_map(change).max_by(|a, b| a.0.total_cmp(&b.0));
    let (explained, joint, at) = best?;
    if !explains_most(all, all - explained, count) {
        return None;
    }
    // The change beside all that the model has.
    let from = *windows.get(at)?;
    let places: Vec<_> = values.places().collect();
    let columns = data.columns(values, &places, &[]);
    let rows = data.rows(values, &columns);
    let (known, own) = (columns.entries.len(), INERTIAL * joint);
    let size = known + INERTIAL;
    let (mut squares, mut with_left) = (DMatrix::<f64>::zeros(size, size), DVector::zeros(size));
    let mut row: Vec<(usize, f64)> = Vec::new();
    for &w in &windows {
        for j in judged(w) {
            let numbers = rows.row(w, j);
            let number = |entry: usize| Some(numbers[columns.place(j, entry)?] / noise[j]);
            row.clear();
            row.extend((0..known).filter_map(|entry| Some((entry, number(entry)?))));
            if w >= from {
                let changed = 0..INERTIAL;
                row.extend(changed.filter_map(|n| Some((known + n, number(own + n)?))));
            }
            for (a, x) in &row {
                with_left[*a] += x * left(w, j);
                row.iter().for_each(|(b, y)| squares[(*a, *b)] += x * y);
            }
        }
    }
    for k in 0..size {
        // What no row has is nothing.
        squares[(k, k)] += (SHRINKAGE * squares[(k, k)]).max(f64::MIN_POSITIVE);
    }
    let factor = squares.cholesky()?;
    let found = factor.solve(&with_left);
    let variance = factor.inverse()[(known, known)];
    let remains = (all - found.dot(&with_left)).max(count) / count;
    let mass = [found[known], (remains * variance).sqrt()];
    let from = data.motion.windows[from].t;
    (mass[0].abs() > SURE * mass[1]).then_some(LoadChange { joint, from, mass })
}

/// Of running sums the place at which a change explains most, and by how much more than what does not change.
fn best_split(sums: &[Products]) -> Option<(f64, usize)> {
    let (whole, last) = (sums.last()?, sums.len() - 1);
    let shrinkage = SHRINKAGE * whole.squares.diagonal();
    let alone = whole.explained(&shrinkage)?;
    let split = |at: usize| {
        let after = whole.minus(&sums[at]);
        Some((
            sums[at].explained(&shrinkage)? + after.explained(&shrinkage)? - alone,
            at,
        ))
    };
    let best = |from: usize, to: usize, by: usize| {
        let all = (from..to).step_by(by).filter_map(split);
        all.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let ends = (LEAST_SHARE * last as f64) as usize + 1;
    let by = last.div_ceil(TIMES);
    let near = best(ends, last.saturating_sub(ends), by)?.1;
    best(near.saturating_sub(by).max(ends), near + by + 1, 1)
}
