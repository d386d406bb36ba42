//! A limb's weighted least-squares problem as one triangle, the parameters under test last.
//!
//! Rows of the joints' factors, each divided by its joint's noise, are folded onto the prior's triangle by Householder
//! reflections (Golub & Van Loan §5.2), column by column: the order of the columns decides which nested models can be read
//! off. With the active columns first, a model without the rest is the leading triangle, and a model with a few of the
//! rest needs only a small problem in the trailing rows.

use super::blocks::HeapFactor;
use crate::equation::column::Columns;
use crate::equation::dot::dot;

/// Priors and what they are of.
pub(crate) struct Prior {
    /// Rows over the inertial parameters of each body: ten numbers of R and one of z.
    pub(crate) bodies: Vec<Vec<[f64; 11]>>,
    /// How many times nearer to the CAD each body is held: one, unless the data would carry it off.
    pub(crate) tightness: Vec<f64>,
}

/// R and z of a limb, unit noise.
pub(crate) struct Triangle {
    /// Which entries of θ the columns are.
    order: Vec<usize>,
    /// How many of them are active.
    active: usize,
    /// Column-major, n rows, n + 1 columns.
    r: Vec<f64>,
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

impl Triangle {
    /// The problem of `data` with these noises (N m), entries `active` first and then `rest`. The inertial entries are
    /// active and come first of all.
    pub(crate) fn new(
        columns: &Columns,
        prior: &Prior,
        data: &[HeapFactor],
        noise: &[f64],
        active: &[usize],
        rest: &[usize],
    ) -> Self {
        let order: Vec<usize> = active.iter().chain(rest).copied().collect();
        let n = order.len();
        let m: usize = data.iter().map(HeapFactor::columns).sum();
        // Column-major: reflections go column by column.
        let mut rows = vec![0.0; m * (n + 1)];
        let mut first = 0;
        for (joint, factor) in data.iter().enumerate() {
            let weight = 1.0 / noise[joint];
            let places = order.iter().map(|&entry| columns.place(joint, entry));
            for (c, place) in places.chain([Some(factor.columns())]).enumerate() {
                let Some(place) = place else { continue };
                let column = &mut rows[c * m + first..][..factor.columns().min(place + 1)];
                for (k, x) in column.iter_mut().enumerate() {
                    *x = factor.row(k)[place - k] * weight;
                }
            }
            first += factor.columns();
        }
        let mut triangle = Self {
            order,
            active: active.len(),
            r: vec![0.0; n * (n + 1)],
        };
        triangle.set_prior(columns, prior);
        triangle.fold(&mut rows, m);
        triangle
    }

    fn set_prior(&mut self, columns: &Columns, prior: &Prior) {
        let n = self.order.len();
        let mut width = 0;
        for (body, tightness) in prior.bodies.iter().zip(&prior.tightness) {
            for (row, numbers) in body.iter().enumerate() {
                for (column, number) in numbers[..10].iter().enumerate().skip(row) {
                    self.r[width + row + (width + column) * n] = number * tightness;
                }
                self.r[width + row + n * n] = numbers[10] * tightness;
            }
            width += 10;
        }
        for k in width..n {
            let entry = &columns.entries[self.order[k]];
            self.r[k + k * n] = 1.0 / entry.std;
            self.r[k + n * n] = entry.mean / entry.std;
        }
    }

    /// Reflects `m` rows, column-major, into the triangle; they are used up.
    fn fold(&mut self, rows: &mut [f64], m: usize) {
        let n = self.order.len();
        for k in 0..n {
            let (head, tail) = rows.split_at_mut((k + 1) * m);
            let v = &head[k * m..];
            let below = dot(v, v);
            if below == 0.0 {
                continue;
            }
            let diagonal = self.r[k + k * n];
            let length = (diagonal * diagonal + below).sqrt();
            let pivot = if diagonal > 0.0 { -length } else { length };
            let v0 = diagonal - pivot;
            let scale = 2.0 / (v0 * v0 + below);
            self.r[k + k * n] = pivot;
            for (c, column) in tail.chunks_exact_mut(m).enumerate() {
                let at = k + (k + 1 + c) * n;
                let share = scale * (v0 * self.r[at] + dot(v, column));
                self.r[at] -= share * v0;
                column.iter_mut().zip(v).for_each(|(x, v)| *x -= share * v);
            }
        }
    }

    /// θ of the active model as a whole vector of all entries, zero where not active, and with `trial` the values of the
    /// entries under test.
    pub(crate) fn solve(&self, entries: usize, trial: &[(usize, f64)]) -> Vec<f64> {
        let n = self.order.len();
        let mut right: Vec<f64> = self.r[n * n..n * n + self.active].to_vec();
        let mut theta = vec![0.0; entries];
        for &(entry, value) in trial {
            let Some(column) = self.order.iter().position(|&e| e == entry) else {
                continue;
            };
            let numbers = &self.r[column * n..column * n + self.active];
            right
                .iter_mut()
                .zip(numbers)
                .for_each(|(z, r)| *z -= r * value);
            theta[entry] = value;
        }
        for k in (0..self.active).rev() {
            let value = right[k] / self.r[k + k * n];
            for (row, z) in right.iter_mut().enumerate().take(k) {
                *z -= self.r[row + k * n] * value;
            }
            theta[self.order[k]] = value;
        }
        theta
    }

    /// Standard deviations of the active entries, in their order.
    #[cfg(test)]
    pub(crate) fn std(&self) -> Vec<f64> {
        let (n, a) = (self.order.len(), self.active);
        let mut variance = vec![0.0; a];
        let mut column = vec![0.0; a];
        for j in 0..a {
            for k in (0..=j).rev() {
                let right = if k == j { 1.0 } else { 0.0 };
                let sum: f64 = (k + 1..=j).map(|c| self.r[k + c * n] * column[c]).sum();
                column[k] = (right - sum) / self.r[k + k * n];
                variance[k] += column[k] * column[k];
            }
        }
        variance.iter().map(|v| v.sqrt()).collect()
    }

    /// The solution with a group of entries under test beside the active ones; `None` if nothing determines them.
    pub(crate) fn trial(&self, group: &[usize]) -> Option<Trial> {
        let (n, a) = (self.order.len(), self.active);
        let trailing = |column: usize| self.r[column * n + a..(column + 1) * n].to_vec();
        let columns: Option<Vec<usize>> = group
            .iter()
            .map(|e| self.order.iter().position(|o| o == e))
            .collect();
        let mut z = trailing(n);
        let g = group.len();
        // Gram-Schmidt with the columns' coefficients kept: a small upper triangle.
        let (mut basis, mut upper, mut right): (Vec<Vec<f64>>, Vec<Vec<f64>>, Vec<f64>) =
            Default::default();
        for column in columns? {
            let mut x = trailing(column);
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

/// Sum of squared residuals of a joint's factor under θ, (N m)².
pub(crate) fn misfit(columns: &Columns, joint: usize, factor: &HeapFactor, theta: &[f64]) -> f64 {
    let mut own = vec![0.0; factor.columns()];
    for (entry, value) in theta.iter().enumerate() {
        if let Some(place) = columns.place(joint, entry) {
            own[place] += value;
        }
    }
    factor.sum_of_squares(&own)
}

#[cfg(test)]
mod tests;
