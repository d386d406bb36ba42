//! What a design makes small: functions of the rows' triangle, with their slopes.
//!
//! The rows Z of a motion, one per joint and instant, stand for what it tells of r parameters in which the prior is a unit
//! one. Every cost here depends on Z through its triangle R of Z = Q R alone, and its slope by Z is Z M with a symmetric M:
//! WᵀW is never formed. What earlier logs know is their triangle, stacked on the rows.

use nalgebra::{DMatrix, DVector};

use super::spectrum::spectrum;

/// What is to be small.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cost {
    /// log σ₁ − log σ_r: the truncated condition number. With `power` p it is the smooth
    /// (log Σ σ^2p + log Σ σ^−2p) / 2p, an upper bound that tends to it from above with growing p; infinite p is the number itself.
    Condition { power: f64 },
    /// −½ log det(RᵀR + 1): D-optimality after the prior.
    Determinant,
    /// ½ log tr(C (RᵀR + 1)⁻¹ Cᵀ): A-optimality, the mean variance of the named combinations C, in units of the prior's.
    Variance(DMatrix<f64>),
    /// T-optimality: −log of the smallest of the pairs' ‖residual‖ of the first column after the best fit of the columns that go with
    /// it and of the first `nuisance` ones, all within unit priors. The smallest is a smooth one:
    /// (Σ ‖residual‖^−[`WORST`])^(−1 / [`WORST`]).
    Separation {
        nuisance: usize,
        pairs: Vec<(usize, Vec<usize>)>,
    },
}

/// How much more the smallest residual of a separation counts than the others: a pair whose residual is twice as large weighs a
/// sixteenth.
const WORST: f64 = 4.0;

/// A cost and M.
pub(super) struct Value {
    pub(super) cost: f64,
    /// Of a smooth condition number the number itself, of other costs the same.
    pub(super) exact: f64,
    pub(super) slope: DMatrix<f64>,
}

impl Value {
    fn of(cost: f64, slope: DMatrix<f64>) -> Self {
        Self {
            cost,
            exact: cost,
            slope,
        }
    }
}

/// Smallest singular value that counts, relative to the largest: below it a motion tells nothing of a direction. It keeps
/// the start of a search finite.
const LEAST: f64 = 1e-9;

impl Cost {
    /// The cost of rows whose triangle is `r`; `None` if it is not finite.
    pub(super) fn of(&self, r: &DMatrix<f64>) -> Option<Value> {
        let value = match self {
            Self::Condition { power } => condition(r, *power)?,
            Self::Determinant => {
                let known = with_prior(r);
                let cost = -known.diagonal().iter().map(|x| x.abs().ln()).sum::<f64>();
                Value::of(cost, -covariance(&known)?)
            }
            Self::Variance(named) => {
                let across = covariance(&with_prior(r))? * named.transpose();
                let trace = (named * &across).trace();
                Value::of(0.5 * trace.ln(), -(&across * across.transpose()) / trace)
            }
            Self::Separation { nuisance, pairs } => {
                let parts = pairs.iter().map(|(truth, fitted)| {
                    let mut columns: Vec<usize> = (0..*nuisance).collect();
                    columns.extend(fitted);
                    columns.push(*truth);
                    let part = separation(&r.select_columns(&columns))?;
                    Some((columns, part))
                });
                let parts: Vec<_> = parts.collect::<Option<_>>()?;
                worst(r.ncols(), &parts)
            }
        };
        (value.cost.is_finite() && value.slope.iter().all(|x| x.is_finite())).then_some(value)
    }
}

/// The triangle of RᵀR + 1.
fn with_prior(r: &DMatrix<f64>) -> DMatrix<f64> {
    triangle(r, Some(&DMatrix::identity(r.ncols(), r.ncols())))
}

/// (RᵀR)⁻¹ of a triangle R.
fn covariance(r: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let inverse = r.solve_upper_triangular(&DMatrix::identity(r.ncols(), r.ncols()))?;
    Some(&inverse * inverse.transpose())
}

/// V diag(values) Vᵀ.
fn spectral(v: &DMatrix<f64>, values: &DVector<f64>) -> DMatrix<f64> {
    let mut scaled = v.clone();
    for (mut column, value) in scaled.column_iter_mut().zip(values.iter()) {
        column *= *value;
    }
    scaled * v.transpose()
}

fn condition(r: &DMatrix<f64>, power: f64) -> Option<Value> {
    let (values, v) = spectrum(r)?;
    let largest = values.max();
    let values = values.map(|s| s.max(LEAST * largest));
    let smallest = values.min();
    let exact = (largest / smallest).ln();
    if power.is_infinite() {
        let slope = values.map(|s| {
            let sign = f64::from(u8::from(s == largest)) - f64::from(u8::from(s == smallest));
            sign / (s * s)
        });
        return Some(Value::of(exact, spectral(&v, &slope)));
    }
    // Powers of ratios to the extremes, which lie in 0 to 1.
    let up = values.map(|s| (s / largest).powf(2.0 * power));
    let down = values.map(|s| (smallest / s).powf(2.0 * power));
    let (sum_up, sum_down) = (up.sum(), down.sum());
    let slope = DVector::from_fn(values.len(), |n, _| {
        (up[n] / sum_up - down[n] / sum_down) / (values[n] * values[n])
    });
    Some(Value {
        cost: exact + (sum_up.ln() + sum_down.ln()) / (2.0 * power),
        exact,
        slope: spectral(&v, &slope),
    })
}

/// (log Σ exp p · cost) / p of costs, each with the columns that it is of, for p = [`WORST`].
fn worst(n: usize, parts: &[(Vec<usize>, Value)]) -> Value {
    let most = (parts.iter()).fold(f64::NEG_INFINITY, |most, (_, part)| most.max(part.cost));
    let sizes = parts
        .iter()
        .map(|(_, part)| (WORST * (part.cost - most)).exp());
    let sizes: Vec<f64> = sizes.collect();
    let sum: f64 = sizes.iter().sum();
    let mut slope = DMatrix::zeros(n, n);
    for ((columns, part), size) in parts.iter().zip(&sizes) {
        for (i, &row) in columns.iter().enumerate() {
            for (j, &column) in columns.iter().enumerate() {
                slope[(row, column)] += size / sum * part.slope[(i, j)];
            }
        }
    }
    Value::of(most + sum.ln() / WORST, slope)
}

/// −log of what the last column leaves. With the others' unit priors, their least squares on it is β and what is left
/// ρ² = wᵀ RᵀR w + ‖β‖² for w = (−β, 1).
///
/// What β costs by the priors counts as what is left of the data does: an effect that bodies off the CAD could stand for is told by
/// how far off they would have to be, and the more a motion tells of bodies the farther that is. The data's part alone is largest
/// for a motion that tells little of them, after which nothing is missing.
fn separation(r: &DMatrix<f64>) -> Option<Value> {
    let n = r.ncols() - 1;
    let others = r.columns(0, n).into_owned();
    let mut stacked = DMatrix::zeros(r.nrows() + n, n + 1);
    stacked.view_mut((0, 0), (r.nrows(), n)).copy_from(&others);
    stacked.view_mut((r.nrows(), 0), (n, n)).fill_diagonal(1.0);
    stacked
        .view_mut((0, n), (r.nrows(), 1))
        .copy_from(&r.column(n));
    let triangle = stacked.qr().unpack_r();
    let known = triangle.view((0, 0), (n, n));
    let beta = known.solve_upper_triangular(&triangle.view((0, n), (n, 1)).column(0))?;
    let square = triangle[(n, n)] * triangle[(n, n)];
    let mut w = DVector::zeros(n + 1);
    w.rows_mut(0, n).copy_from(&-beta);
    w[n] = 1.0;
    let slope = -(&w * w.transpose()) / square;
    Some(Value::of(-0.5 * square.ln(), slope))
}

/// The triangle of rows, `known` stacked on them.
pub(super) fn triangle(rows: &DMatrix<f64>, known: Option<&DMatrix<f64>>) -> DMatrix<f64> {
    let before = known.map_or(0, DMatrix::nrows);
    // Of fewer rows than columns there is a triangle too, its last rows zero.
    let count = (before + rows.nrows()).max(rows.ncols());
    let mut all = DMatrix::zeros(count, rows.ncols());
    if let Some(known) = known {
        all.rows_mut(0, before).copy_from(known);
    }
    all.rows_mut(before, rows.nrows()).copy_from(rows);
    all.qr().unpack_r()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn costs(r: usize) -> Vec<Cost> {
        let named = DMatrix::from_fn(2, r, |i, j| f64::from(u8::from(i + 1 == j)));
        vec![
            Cost::Condition { power: 1.0 },
            Cost::Condition { power: 4.0 },
            Cost::Condition {
                power: f64::INFINITY,
            },
            Cost::Determinant,
            Cost::Variance(named),
            Cost::Separation {
                nuisance: r - 2,
                pairs: vec![(r - 1, vec![r - 2]), (r - 2, vec![r - 1])],
            },
        ]
    }

    proptest! {
        /// Z M against central differences, for every cost.
        #[test]
        fn slopes_by_the_rows(entries in prop::collection::vec(-1.0..1.0f64, 40), step in prop::collection::vec(-1.0..1.0f64, 40)) {
            let z = DMatrix::from_row_slice(10, 4, &entries);
            let d = DMatrix::from_row_slice(10, 4, &step);
            let known = DMatrix::from_fn(4, 4, |i, j| if i == j { 0.3 } else { 0.0 });
            let (values, _) = spectrum(&triangle(&z, Some(&known))).unwrap();
            let mut sorted: Vec<f64> = values.iter().copied().collect();
            sorted.sort_by(f64::total_cmp);
            // Where two singular values meet the condition number has a kink.
            prop_assume!(sorted.windows(2).all(|w| w[1] - w[0] > 1e-2));
            for cost in costs(4) {
                let at = |h: f64| cost.of(&triangle(&(&z + &d * h), Some(&known))).unwrap();
                let h = 1e-6;
                let expected = (at(h).cost - at(-h).cost) / (2.0 * h);
                let slope = (&z * at(0.0).slope).dot(&d);
                prop_assert!((slope - expected).abs() < 1e-5 * (1.0 + expected.abs()), "{cost:?}: {slope} {expected}");
            }
        }
    }

    #[test]
    fn the_smooth_condition_number_tends_to_the_number() {
        let z = DMatrix::from_fn(9, 3, |i, j| {
            ((3 * i + 5 * j) as f64).sin() + f64::from(u8::from(i == j))
        });
        let r = triangle(&z, None);
        let at = |power| Cost::Condition { power }.of(&r).unwrap().cost;
        let exact = at(f64::INFINITY);
        assert!(at(1.0) > at(4.0) && at(4.0) > exact);
        assert!(at(200.0) - exact < 0.01);
        let (values, _) = spectrum(&r).unwrap();
        assert!((exact - (values.max() / values.min()).ln()).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_told_has_no_cost() {
        let r = DMatrix::from_element(3, 3, f64::NAN);
        assert!(Cost::Determinant.of(&r).is_none());
    }
}
