//! Which columns are combinations of which.

use nalgebra::{DMatrix, RowDVector};

/// Independent columns and what the others add to them.
#[derive(Debug, Clone)]
pub(crate) struct Reduction {
    /// The columns that were looked at.
    pub(crate) analysed: Vec<usize>,
    /// Independent ones, ascending.
    pub(crate) independent: Vec<usize>,
    /// P with β = P θ, a row for each independent column over all parameters.
    pub(crate) combinations: Vec<Vec<f64>>,
}

/// Picks columns of `rows` from the left that are no combination of those before (Gautier 1991), where `analysed` says which
/// of all `parameters` the columns are. A column is independent if more than `tolerance` of its length is its own.
pub(crate) fn from_the_left(
    rows: &DMatrix<f64>,
    analysed: &[usize],
    parameters: usize,
    tolerance: f64,
) -> Reduction {
    let mut basis: Vec<nalgebra::DVector<f64>> = Vec::new();
    let mut coordinates: Vec<Vec<f64>> = Vec::new();
    let mut independent = Vec::new();
    for c in 0..rows.ncols() {
        let mut x = rows.column(c).into_owned();
        let size = x.norm();
        let mut along = vec![0.0; basis.len()];
        // Twice: once leaves what rounding put back (Björck 1994).
        for _ in 0..2 {
            for (along, b) in along.iter_mut().zip(&basis) {
                let share = b.dot(&x);
                *along += share;
                x.axpy(-share, b, 1.0);
            }
        }
        let length = x.norm();
        if length > tolerance * size && size > 0.0 {
            basis.push(x / length);
            along.push(length);
            independent.push(c);
        }
        coordinates.push(along);
    }
    let rank = independent.len();
    let at = |c: usize, r: usize| coordinates[c].get(r).copied().unwrap_or(0.0);
    let upper = DMatrix::from_fn(rank, rank, |r, i| at(independent[i], r));
    let all = DMatrix::from_fn(rank, rows.ncols(), |r, c| at(c, r));
    let shares = upper
        .solve_upper_triangular(&all)
        .unwrap_or_else(|| DMatrix::zeros(rank, rows.ncols()));
    let combinations = (0..rank).map(|r| {
        let mut row = vec![0.0; parameters];
        for (c, &k) in analysed.iter().enumerate() {
            let share = shares[(r, c)];
            row[k] = if share.abs() < 1e-7 { 0.0 } else { share };
        }
        row
    });
    Reduction {
        analysed: analysed.to_vec(),
        combinations: combinations.collect(),
        independent: independent.iter().map(|&c| analysed[c]).collect(),
    }
}

/// Directions that `rows` see by less than `least`, one for each column that QR with column pivoting leaves over: one in that
/// column, and in the columns before it what keeps the rows as they are.
pub(crate) fn pivoted(rows: &DMatrix<f64>, least: f64) -> Vec<Vec<f64>> {
    let n = rows.ncols();
    let rows = rows.clone().resize_vertically(rows.nrows().max(n), 0.0);
    let qr = rows.col_piv_qr();
    let mut order = RowDVector::from_fn(n, |_, c| c as f64);
    qr.p().permute_columns(&mut order);
    let r = qr.r();
    let rank = (0..n).position(|k| r[(k, k)].abs() < least).unwrap_or(n);
    let (upper, rest) = (
        r.view((0, 0), (rank, rank)),
        r.view((0, rank), (rank, n - rank)),
    );
    let Some(shares) = upper.solve_upper_triangular(&rest) else {
        return Vec::new();
    };
    (0..n - rank)
        .map(|d| {
            let mut direction = vec![0.0; n];
            direction[order[rank + d] as usize] = 1.0;
            for k in 0..rank {
                direction[order[k] as usize] = -shares[(k, d)];
            }
            direction
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// What `P` says is what the rows say, and nothing of the null directions shows.
        #[test]
        fn combinations_say_what_the_rows_say(
            numbers in prop::collection::vec(-1.0..1.0f64, 12 * 4),
            mix in prop::collection::vec(-1.0..1.0f64, 4 * 3),
        ) {
            let own = DMatrix::from_vec(12, 4, numbers);
            prop_assume!(own.clone().svd(false, false).singular_values.min() > 1e-2);
            let mixed = &own * DMatrix::from_vec(4, 3, mix);
            let mut rows = DMatrix::zeros(12, 7);
            rows.columns_mut(0, 4).copy_from(&own);
            rows.columns_mut(4, 3).copy_from(&mixed);
            let all: Vec<usize> = (0..7).collect();
            let reduction = from_the_left(&rows, &all, 7, 1e-8);
            prop_assert_eq!(&reduction.independent, &vec![0, 1, 2, 3]);
            let p = DMatrix::from_fn(4, 7, |r, c| reduction.combinations[r][c]);
            prop_assert!((&own * p - &rows).amax() < 1e-6);

            let null = pivoted(&rows, 1e-6);
            prop_assert_eq!(null.len(), 3);
            for direction in null {
                prop_assert!((&rows * nalgebra::DVector::from_vec(direction.clone())).amax() < 1e-9);
            }
        }
    }
}
