//! What a design makes small: functions of the rows' triangle, with their slopes.
//!
//! The rows Z of a motion, one per joint and instant, stand for what it tells of r parameters in which the prior is a unit
//! one. Every cost here depends on Z through its triangle R of Z = Q R alone, and its slope by Z is Z M with a symmetric M:
//! WᵀW is never formed. What earlier logs know is their triangle, stacked on the rows.

use nalgebra::{DMatrix, DVector, SVD};

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
    /// T-optimality: the sum over pairs of −log ‖residual‖ of the first column after the best fit of the columns that go with it
    /// and of the first `nuisance` ones, all within unit priors.
    Separation {
        nuisance: usize,
        pairs: Vec<(usize, Vec<usize>)>,
    },
}

/// A cost and M.
pub(super) struct Value {
    pub(super) cost: f64,
    pub(super) slope: DMatrix<f64>,
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
                let (values, v) = spectrum(r)?;
                let gain = values.map(|s| s * s + 1.0);
                Value {
                    cost: -0.5 * gain.iter().map(|x| x.ln()).sum::<f64>(),
                    slope: spectral(&v, &gain.map(|x| -1.0 / x)),
                }
            }
            Self::Variance(named) => {
                let (values, v) = spectrum(r)?;
                let inverse = spectral(&v, &values.map(|s| 1.0 / (s * s + 1.0)));
                let across = &inverse * named.transpose();
                let trace = (named * &across).trace();
                Value {
                    cost: 0.5 * trace.ln(),
                    slope: -(&across * across.transpose()) / trace,
                }
            }
            Self::Separation { nuisance, pairs } => {
                let n = r.ncols();
                let (mut cost, mut slope) = (0.0, DMatrix::zeros(n, n));
                for (truth, fitted) in pairs {
                    let mut columns: Vec<usize> = (0..*nuisance).collect();
                    columns.extend(fitted);
                    columns.push(*truth);
                    let part = separation(&r.select_columns(&columns))?;
                    cost += part.cost;
                    for (i, &row) in columns.iter().enumerate() {
                        for (j, &column) in columns.iter().enumerate() {
                            slope[(row, column)] += part.slope[(i, j)];
                        }
                    }
                }
                Value { cost, slope }
            }
        };
        (value.cost.is_finite() && value.slope.iter().all(|x| x.is_finite())).then_some(value)
    }
}

/// Singular values of R and its right singular vectors, as columns.
pub(super) fn spectrum(r: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let svd = SVD::try_new(r.clone(), false, true, f64::EPSILON, 500)?;
    Some((svd.singular_values, svd.v_t?.transpose()))
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
    if power.is_infinite() {
        let slope = values.map(|s| {
            let sign = f64::from(u8::from(s == largest)) - f64::from(u8::from(s == smallest));
            sign / (s * s)
        });
        return Some(Value {
            cost: (largest / smallest).ln(),
            slope: spectral(&v, &slope),
        });
    }
    // Powers of ratios to the extremes, which lie in 0 to 1.
    let up = values.map(|s| (s / largest).powf(2.0 * power));
    let down = values.map(|s| (smallest / s).powf(2.0 * power));
    let (sum_up, sum_down) = (up.sum(), down.sum());
    let slope = DVector::from_fn(values.len(), |n, _| {
        (up[n] / sum_up - down[n] / sum_down) / (values[n] * values[n])
    });
    Some(Value {
        cost: (largest / smallest).ln() + (sum_up.ln() + sum_down.ln()) / (2.0 * power),
        slope: spectral(&v, &slope),
    })
}

/// With the others' unit priors, the least squares of the last column on the others, ρ² = wᵀ RᵀR w + ‖β‖² for
/// w = (−β, 1).
fn separation(r: &DMatrix<f64>) -> Option<Value> {
    let n = r.ncols() - 1;
    let others = r.columns(0, n).into_owned();
    let target = r.column(n).into_owned();
    let mut stacked = DMatrix::zeros(r.nrows() + n, n + 1);
    stacked.view_mut((0, 0), (r.nrows(), n)).copy_from(&others);
    stacked.view_mut((r.nrows(), 0), (n, n)).fill_diagonal(1.0);
    stacked.view_mut((0, n), (r.nrows(), 1)).copy_from(&target);
    let triangle = stacked.qr().unpack_r();
    let beta = triangle
        .view((0, 0), (n, n))
        .solve_upper_triangular(&triangle.view((0, n), (n, 1)).column(0))?;
    let square = triangle[(n, n)] * triangle[(n, n)];
    let mut w = DVector::zeros(n + 1);
    w.rows_mut(0, n).copy_from(&-beta);
    w[n] = 1.0;
    Some(Value {
        cost: -0.5 * square.ln(),
        slope: -(&w * w.transpose()) / square,
    })
}

/// The triangle of rows, `known` stacked on them.
pub(super) fn triangle(rows: &DMatrix<f64>, known: Option<&DMatrix<f64>>) -> DMatrix<f64> {
    match known {
        None => rows.clone().qr().unpack_r(),
        Some(known) => {
            let mut all = DMatrix::zeros(known.nrows() + rows.nrows(), rows.ncols());
            all.rows_mut(0, known.nrows()).copy_from(known);
            all.rows_mut(known.nrows(), rows.nrows()).copy_from(rows);
            all.qr().unpack_r()
        }
    }
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
