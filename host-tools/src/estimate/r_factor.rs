//! A limb's weighted least-squares problem as one triangle, the parameters under test last.
//!
//! Rows of the joints' factors, each divided by its joint's noise, and those of the prior are folded into one triangle: the order of the
//! columns decides which nested models can be read off. With the active columns first, a model without the rest is the leading triangle, and a model with a few of the
//! rest needs only a small problem in the trailing rows.

use proprio_core::inertia::{INERTIAL, InertialParameters};

use super::factor::HeapFactor;
use super::groups::weighed;
use crate::equation::column::Columns;
use crate::equation::dot::dot;

/// Priors and what they are of.
pub(crate) struct Prior {
    /// Rows over the inertial parameters of each body: ten numbers of R and one of z.
    pub(crate) bodies: Vec<Vec<[f64; 11]>>,
    /// How many times nearer to the CAD each body is held: one, unless the data would carry it off.
    pub(crate) tightness: Vec<f64>,
}

/// The rows of a body that is known within a share of itself, as [`InertialParameters::prior`] takes it.
pub(crate) fn prior_of_body(
    body: &InertialParameters<f64>,
    relative: f64,
) -> Vec<[f64; INERTIAL + 1]> {
    let factor = body.prior(relative);
    let row = |k: usize| {
        let mut row = [0.0; INERTIAL + 1];
        if let Some(factor) = &factor {
            row[k..].copy_from_slice(factor.row(k));
        }
        row
    };
    (0..INERTIAL).map(row).collect()
}

/// R and z of a limb, unit noise.
pub(crate) struct RFactor {
    factor: HeapFactor,
    /// How many entries are active.
    active: usize,
    /// Of each entry under test, and of the right-hand side, its column of R from the first row on that is not the active ones'.
    trailing: Vec<Vec<f64>>,
}

/// An effect under test, with a solution that has it.
pub(crate) struct Trial {
    /// Its parameters.
    pub(crate) value: Vec<f64>,
    /// Their standard deviations, if residuals are independent.
    pub(crate) std: Vec<f64>,
    /// How much the weighted sum of squares falls, in the data it was fitted to.
    pub(crate) fall: f64,
}

impl RFactor {
    /// The problem of `data` with these noises (N m), the first `active` entries of θ active and the others under test. The inertial
    /// entries come first of all.
    pub(crate) fn new(
        columns: &Columns,
        prior: &Prior,
        data: &[HeapFactor],
        noise: &[f64],
        active: usize,
    ) -> Self {
        let n = columns.entries.len();
        let joints = data.iter().zip(noise).enumerate();
        let rows = joints.flat_map(|(joint, (factor, noise))| {
            let places: Vec<Option<usize>> = (0..n).map(|e| columns.place(joint, e)).collect();
            weighed(factor, &places, 1.0 / noise)
        });
        let mut factor = HeapFactor::new(n);
        factor.fold_sorted(rows.chain(prior_rows(columns, prior)).collect());
        let column = |c: usize| -> Vec<f64> {
            let rows = active..n.min(c + 1);
            let mut own: Vec<f64> = rows.map(|k| factor.row(k)[c - k]).collect();
            own.resize(n - active, 0.0);
            own
        };
        Self {
            trailing: (active..=n).map(column).collect(),
            factor,
            active,
        }
    }

    /// θ of the active model as a whole vector of all entries, zero where not active, and with `trial` the values of the
    /// entries under test.
    pub(crate) fn solve(&self, trial: &[(usize, f64)]) -> Vec<f64> {
        let (n, a) = (self.factor.columns(), self.active);
        let mut theta = vec![0.0; n];
        for &(entry, value) in trial.iter().filter(|(entry, _)| *entry >= a) {
            theta[entry] = value;
        }
        for k in (0..a).rev() {
            let row = self.factor.row(k);
            let known = trial.iter().filter(|(entry, _)| *entry >= a);
            let right = row[n - k] - known.map(|(entry, x)| row[entry - k] * x).sum::<f64>();
            theta[k] = (right - dot(&row[1..a - k], &theta[k + 1..a])) / row[0];
        }
        theta
    }

    /// θ with all entries under test in the model.
    pub(crate) fn solve_all(&self) -> Vec<f64> {
        let mut theta = vec![0.0; self.factor.columns()];
        self.factor.solve_before(theta.len(), &mut theta);
        theta
    }

    /// Standard deviations of the active entries, in their order.
    #[cfg(test)]
    pub(crate) fn std(&self) -> Vec<f64> {
        let a = self.active;
        let mut variance = vec![0.0; a];
        let mut column = vec![0.0; a];
        for j in 0..a {
            for k in (0..=j).rev() {
                let right = if k == j { 1.0 } else { 0.0 };
                let row = self.factor.row(k);
                let sum: f64 = (k + 1..=j).map(|c| row[c - k] * column[c]).sum();
                column[k] = (right - sum) / row[0];
                variance[k] += column[k] * column[k];
            }
        }
        variance.iter().map(|v| v.sqrt()).collect()
    }

    /// The solution with a group of entries under test beside the active ones; `None` if nothing determines them.
    pub(crate) fn trial(&self, group: &[usize]) -> Option<Trial> {
        let columns: Option<Vec<&Vec<f64>>> = (group.iter())
            .map(|entry| self.trailing.get(entry.checked_sub(self.active)?))
            .collect();
        let mut z = self.trailing.last()?.clone();
        let g = group.len();
        // Gram-Schmidt with the columns' coefficients kept: a small upper triangle.
        let (mut basis, mut upper, mut right): (Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>) =
            Default::default();
        for column in columns? {
            let mut x = column.clone();
            let size = norm(&x);
            let mut coefficients = vec![0.0; g];
            for (k, b) in basis.iter().enumerate() {
                coefficients[k] = dot(b, &x);
                x.iter_mut()
                    .zip(b)
                    .for_each(|(x, b)| *x -= coefficients[k] * b);
            }
            let length = norm(&x);
            if length.is_nan() || length <= 1e-9 * size {
                return None;
            }
            x.iter_mut().for_each(|x| *x /= length);
            coefficients[basis.len()] = length;
            let share = dot(&x, &z);
            z.iter_mut().zip(&x).for_each(|(z, x)| *z -= share * x);
            right.push(share);
            upper.push(coefficients);
            basis.push(x);
        }
        let mut value = vec![0.0; g];
        for k in (0..g).rev() {
            let sum: f64 = (k + 1..g).map(|c| upper[c][k] * value[c]).sum();
            value[k] = (right[k] - sum) / upper[k][k];
        }
        Some(Trial {
            value,
            std: inverse_norms(&upper),
            fall: right.iter().map(|x| x * x).sum(),
        })
    }
}

/// What is known before any data, as rows over θ and the right-hand side, each with its first entry.
fn prior_rows(columns: &Columns, prior: &Prior) -> Vec<(usize, Vec<f64>)> {
    let n = columns.entries.len();
    let mut all = Vec::new();
    let bodies = prior.bodies.iter().zip(&prior.tightness);
    for (first, (body, tightness)) in (0..).step_by(INERTIAL).zip(bodies) {
        for (k, numbers) in body.iter().enumerate() {
            let mut row = vec![0.0; n + 1];
            for (to, x) in row[first + k..first + INERTIAL]
                .iter_mut()
                .zip(&numbers[k..])
            {
                *to = x * tightness;
            }
            row[n] = numbers[INERTIAL] * tightness;
            all.push((first + k, row));
        }
    }
    for k in INERTIAL * prior.bodies.len()..n {
        let entry = &columns.entries[k];
        let mut row = vec![0.0; n + 1];
        row[k] = 1.0 / entry.std;
        row[n] = entry.mean / entry.std;
        all.push((k, row));
    }
    all
}

/// Row norms of the inverse of an upper triangle given by columns.
fn inverse_norms(upper: &[Vec<f64>]) -> Vec<f64> {
    let g = upper.len();
    let mut squares = vec![0.0; g];
    for j in 0..g {
        let mut column = vec![0.0; g];
        for k in (0..=j).rev() {
            let right = if k == j { 1.0 } else { 0.0 };
            let sum: f64 = (k + 1..=j).map(|c| upper[c][k] * column[c]).sum();
            column[k] = (right - sum) / upper[k][k];
            squares[k] += column[k] * column[k];
        }
    }
    squares.iter().map(|s: &f64| s.sqrt()).collect()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Sum of squared residuals of a joint's factor under θ, of which only a few entries beyond the first `active` are not zero, (N m)².
pub(crate) fn misfit(
    columns: &Columns,
    (joint, factor): (usize, &HeapFactor),
    theta: &[f64],
    active: usize,
) -> f64 {
    let (mut first, mut others) = (Vec::new(), Vec::new());
    for (entry, value) in theta.iter().enumerate() {
        match columns.place(joint, entry) {
            // Columns stand in the order of the entries; some share one.
            Some(place) if place < first.len() => first[place] += value,
            Some(place) if entry < active && place == first.len() => first.push(*value),
            Some(place) if *value != 0.0 => others.push((place, *value)),
            _ => {}
        }
    }
    factor.sum_of_squares_of_few(&first, &others)
}

#[cfg(test)]
mod tests;
