//! Square-root information of a joint's rows, folded in many at a time.
//!
//! The same triangle as [`proprio_core::factor`], which takes rows one by one by rotations as a device hears them. A desktop has many
//! at once: Householder reflections of all of them (Golub & Van Loan 2013, §5.2.2) take a third of the operations less, in runs as
//! long as a row.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};

use crate::dot::dot;

/// Rows that one reflection takes: as many as stay in the processor's nearest memory beside the triangle.
pub const BATCH: usize = 48;

/// Columns whose reflections are multiplied out before they reach the columns behind them.
const PANEL: usize = 16;

/// Fewer new rows are reflected column by column.
const LEAST_ROWS: usize = 8;

/// How many numbers a factor of so many columns has.
pub const fn numbers_of(columns: usize) -> usize {
    (columns + 1) * (columns + 2) / 2
}

/// The triangle \[R z; 0 ρ\] of a least-squares problem: ‖W θ − b‖² = ‖R θ − z‖² + ρ² of the rows folded in.
#[derive(Debug, Clone, PartialEq)]
pub struct HeapFactor {
    columns: usize,
    rows: usize,
    /// How many rows of the triangle may have numbers.
    height: usize,
    /// Row by row, each from its diagonal on, which is not negative.
    numbers: Vec<f64>,
}

impl HeapFactor {
    /// A factor of no rows.
    pub fn new(columns: usize) -> Self {
        Self {
            columns,
            rows: 0,
            height: 0,
            numbers: vec![0.0; numbers_of(columns)],
        }
    }

    /// Number of parameters p.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows folded in.
    pub fn rows(&self) -> f64 {
        self.rows as f64
    }

    /// A factor of so many rows by its numbers, as [`numbers`](Self::numbers) gave them out; `None` if they are not as many as its
    /// columns ask for.
    pub fn from_numbers(columns: usize, rows: usize, numbers: Vec<f64>) -> Option<Self> {
        (numbers.len() == numbers_of(columns)).then_some(Self {
            columns,
            rows,
            height: rows.min(columns + 1),
            numbers,
        })
    }

    /// The triangle row by row, each from its diagonal on.
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// Row k from its diagonal on; row p is ρ alone.
    pub fn row(&self, k: usize) -> &[f64] {
        let start = k * (2 * self.columns + 3 - k) / 2;
        &self.numbers[start..=start + self.columns - k]
    }

    /// The triangle as a matrix.
    pub fn dense(&self) -> DMatrix<f64> {
        let mut dense = DMatrix::zeros(self.columns + 1, self.columns + 1);
        for k in 0..=self.columns {
            for (c, x) in self.row(k).iter().enumerate() {
                dense[(k, k + c)] = *x;
            }
        }
        dense
    }

    /// Entry k of R θ − z.
    pub fn misfit(&self, k: usize, theta: &[f64]) -> f64 {
        let (row, n) = (self.row(k), self.columns - k);
        dot(&row[..n], &theta[k..]) - row[n]
    }

    /// ‖W θ − b‖² of the rows folded in.
    pub fn sum_of_squares(&self, theta: &[f64]) -> f64 {
        let rows = 0..self.height;
        rows.map(|k| self.misfit(k, theta).powi(2)).sum()
    }

    /// The same of a θ that begins with `first` and is nothing after it but for `others`, columns with their values.
    pub fn sum_of_squares_of_few(&self, first: &[f64], others: &[(usize, f64)]) -> f64 {
        let (n, dense) = (self.columns, first.len());
        let misfit = |k: usize| {
            let row = self.row(k);
            let own = if k < dense {
                dot(row, &first[k..])
            } else {
                0.0
            };
            let others = others.iter().filter(|(c, _)| *c >= k);
            let others: f64 = others.map(|(c, value)| value * row[c - k]).sum();
            own + others - row[n - k]
        };
        (0..self.height).map(|k| misfit(k).powi(2)).sum()
    }

    /// Half the gradient of that, Rᵀ(R θ − z).
    pub fn slope(&self, theta: &[f64]) -> Vec<f64> {
        let mut slope = vec![0.0; self.columns];
        for k in 0..self.height.min(self.columns) {
            let misfit = self.misfit(k, theta);
            let row = &self.row(k)[..self.columns - k];
            add(&mut slope[k..], misfit, row);
        }
        slope
    }

    /// x with R x = z in all entries before `known`, which are given.
    pub fn solve_before(&self, known: usize, x: &mut [f64]) {
        for k in (0..known).rev() {
            let (row, n) = (self.row(k), self.columns - k);
            x[k] = (row[n] - dot(&row[1..n], &x[k + 1..])) / row[0];
        }
    }

    /// Folds in rows of p + 1 numbers, the right-hand side last, that lie one after the other; they are used up.
    pub fn fold(&mut self, rows: &mut [f64]) {
        let count = rows.len() / (self.columns + 1);
        self.reflect(rows, &|_| count);
    }

    /// The same of rows that begin with zeros: only the first `reach(k)` of them have a number in column k or before it.
    pub fn reflect(&mut self, rows: &mut [f64], reach: &dyn Fn(usize) -> usize) {
        let width = self.columns + 1;
        let count = rows.len() / width;
        if self.rows > 0 {
            self.height = width;
            let mut first = 0;
            while first < width {
                let panel = first..(first + PANEL).min(width);
                first = panel.end;
                self.reflect_panel(rows, panel, reach);
            }
            self.rows += count;
            return;
        }
        // An empty triangle takes its rows from the new ones.
        let mut sum = vec![0.0; width];
        let mut taken = 0;
        for k in 0..width {
            let pivot = row_mut(&mut self.numbers, width, k);
            let end = reach(k).min(count);
            if taken < end {
                pivot.copy_from_slice(&rows[taken * width + k..(taken + 1) * width]);
                taken += 1;
                self.height = k + 1;
            }
            let rows = &mut rows[taken * width..end.max(taken) * width];
            reflect_column(pivot, rows, (k, width), width, &mut sum);
        }
        self.rows += count;
    }

    /// Reflects the columns of a panel, one after the other within it, and the columns behind it by the product of all of these reflections
    /// (Schreiber & Van Loan 1989, *SIAM J. Sci. Stat. Comput.* 10:53): 1 − V T Vᵀ. In the rows of the triangle V has one number per column, so
    /// that what is to be multiplied is that of the new rows alone.
    fn reflect_panel(
        &mut self,
        rows: &mut [f64],
        panel: Range<usize>,
        reach: &dyn Fn(usize) -> usize,
    ) {
        let width = self.columns + 1;
        let (size, behind) = (panel.len(), width - panel.end);
        let count = reach(panel.end - 1).min(rows.len() / width);
        let rows = &mut rows[..count * width];
        if count < LEAST_ROWS || behind == 0 {
            let mut sum = vec![0.0; width];
            for k in panel {
                let pivot = row_mut(&mut self.numbers, width, k);
                let own = &mut rows[..reach(k).min(count) * width];
                reflect_column(pivot, own, (k, width), width, &mut sum);
            }
            return;
        }
        let mut sum = vec![0.0; size];
        let reflections: Vec<Reflection> = (panel.clone())
            .map(|k| {
                let pivot = row_mut(&mut self.numbers, width, k);
                let own = &mut rows[..reach(k).min(count) * width];
                reflect_column(
                    &mut pivot[..panel.end - k],
                    own,
                    (k, width),
                    panel.end,
                    &mut sum,
                )
            })
            .collect();
        // The new rows' share of V; the product's triangle T has in column n what takes reflection n behind those before it.
        let own = DMatrixView::from_slice(rows, width, count)
            .rows(panel.start, size)
            .into_owned();
        let transposed = own.transpose();
        let products = &own * &transposed;
        let mut triangle = DMatrix::zeros(size, size);
        for n in 0..size {
            let scale = reflections[n].scale;
            let before = triangle.view((0, 0), (n, n)) * products.view((0, n), (n, 1)) * -scale;
            triangle.view_mut((0, n), (n, 1)).copy_from(&before);
            triangle[(n, n)] = scale;
        }
        let mut sums =
            DMatrixView::from_slice(rows, width, count).rows(panel.end, behind) * transposed;
        for ((n, k), reflection) in panel.clone().enumerate().zip(&reflections) {
            let pivot = &row_mut(&mut self.numbers, width, k)[panel.end - k..];
            add(sums.column_mut(n).as_mut_slice(), reflection.head, pivot);
        }
        let sums = sums * triangle;
        for ((n, k), reflection) in panel.clone().enumerate().zip(&reflections) {
            let pivot = &mut row_mut(&mut self.numbers, width, k)[panel.end - k..];
            add(pivot, -reflection.head, sums.column(n).as_slice());
        }
        let mut behind_panel = DMatrixViewMut::from_slice(rows, width, count);
        let mut behind_panel = behind_panel.rows_mut(panel.end, behind);
        behind_panel.gemm(-1.0, &sums, &own, 1.0);
    }

    /// Folds in rows, each with the first column in which it has a number.
    pub fn fold_sorted(&mut self, mut rows: Vec<(usize, Vec<f64>)>) {
        rows.sort_by_key(|(first, _)| *first);
        let mut numbers = Vec::with_capacity(rows.len() * (self.columns + 1));
        rows.iter().for_each(|(_, row)| numbers.extend(row));
        let begun = |k: usize| rows.partition_point(|(first, _)| *first <= k);
        self.reflect(&mut numbers, &begun);
    }

    /// Folds in the rows of another factor of the same columns.
    pub fn merge(&mut self, other: &Self) {
        if self.rows == 0 {
            self.clone_from(other);
            return;
        }
        let width = self.columns + 1;
        let mut rows = vec![0.0; other.height * width];
        for (k, row) in rows.chunks_exact_mut(width).enumerate() {
            row[k..].copy_from_slice(other.row(k));
        }
        let before = self.rows;
        self.reflect(&mut rows, &|k| k + 1);
        self.rows = before + other.rows;
    }
}

/// Row k of a triangle of so many columns, from its diagonal on.
fn row_mut(numbers: &mut [f64], width: usize, k: usize) -> &mut [f64] {
    let start = k * (2 * width + 1 - k) / 2;
    &mut numbers[start..start + width - k]
}

/// 1 − scale v vᵀ: v has `head` in the row of the triangle, and in the new rows what these have in the column.
struct Reflection {
    head: f64,
    scale: f64,
}

/// Reflects the numbers of `rows`, which are `width` long, in column k into the pivot row, which begins there: in all columns before `end`. `sum` is
/// room for a row.
fn reflect_column(
    pivot: &mut [f64],
    rows: &mut [f64],
    (k, width): (usize, usize),
    end: usize,
    sum: &mut [f64],
) -> Reflection {
    let column = rows.iter().skip(k).step_by(width);
    let below: f64 = column.map(|x| x * x).sum();
    let diagonal = pivot[0];
    if below < f64::MIN_POSITIVE {
        // The row's sign alone is turned, if at all.
        let turned = diagonal < 0.0;
        if turned {
            pivot.iter_mut().for_each(|x| *x = -*x);
        }
        return Reflection {
            head: f64::from(u8::from(turned)),
            scale: 2.0 * f64::from(u8::from(turned)),
        };
    }
    let length = (diagonal * diagonal + below).sqrt();
    // diagonal − length without cancellation.
    let head = if diagonal > 0.0 {
        -below / (diagonal + length)
    } else {
        diagonal - length
    };
    let scale = 2.0 / (head * head + below);
    pivot[0] = length;
    let pivot = &mut pivot[1..];
    let sum = &mut sum[..pivot.len()];
    sum.iter_mut().zip(&*pivot).for_each(|(s, x)| *s = head * x);
    let mut four = rows.chunks_exact(4 * width);
    for four in &mut four {
        let (a, rest) = four.split_at(width);
        let (b, rest) = rest.split_at(width);
        let (c, d) = rest.split_at(width);
        let [va, vb, vc, vd] = [a[k], b[k], c[k], d[k]];
        let [a, b, c, d] = [a, b, c, d].map(|row| &row[k + 1..][..sum.len()]);
        for (n, sum) in sum.iter_mut().enumerate() {
            *sum += (va * a[n] + vb * b[n]) + (vc * c[n] + vd * d[n]);
        }
    }
    for row in four.remainder().chunks_exact(width) {
        add(sum, row[k], &row[k + 1..end]);
    }
    add(pivot, -scale * head, sum);
    for row in rows.chunks_exact_mut(width) {
        let share = -scale * row[k];
        add(&mut row[k + 1..end], share, sum);
    }
    Reflection { head, scale }
}

/// to + factor · from.
fn add(to: &mut [f64], factor: f64, from: &[f64]) {
    to.iter_mut()
        .zip(from)
        .for_each(|(to, from)| *to += factor * from);
}

#[cfg(test)]
mod tests {
    use proprio_core::factor::{Factor, packed_len};
    use proptest::prelude::*;

    use super::*;

    /// Two panels and a part of one.
    const COLUMNS: usize = 2 * PANEL + 5;

    fn some_theta() -> [f64; COLUMNS] {
        std::array::from_fn(|k| (1.7 * k as f64).sin())
    }

    proptest! {
        /// The triangle is the one that rotations row by row make, however rows are batched and merged.
        #[test]
        fn the_triangle_is_that_of_rotations(
            numbers in prop::collection::vec(-2.0..2.0f64, (COLUMNS + 1) * 70),
            batch in 1..50usize,
            zeros in 0..2usize,
        ) {
            let width = COLUMNS + 1;
            let mut numbers = numbers;
            // A column that no row has.
            numbers.iter_mut().skip(2).step_by(width).for_each(|x| *x *= zeros as f64);
            let mut one = Factor::in_storage(COLUMNS, vec![0.0; packed_len(COLUMNS)]).unwrap();
            for row in numbers.clone().chunks_mut(width) {
                one.update(row).unwrap();
            }
            let (mut folded, mut merged) = (HeapFactor::new(COLUMNS), HeapFactor::new(COLUMNS));
            for rows in numbers.chunks(batch * width) {
                folded.fold(&mut rows.to_vec());
                let mut own = HeapFactor::new(COLUMNS);
                own.fold(&mut rows.to_vec());
                merged.merge(&own);
            }
            let theta = some_theta();
            for ours in [&folded, &merged] {
                prop_assert_eq!(ours.rows(), one.rows());
                let (ours_left, left) = (ours.sum_of_squares(&theta), one.sum_of_squares(&theta));
                prop_assert!((ours_left - left).abs() < 1e-11 * left);
                for k in 0..COLUMNS {
                    prop_assert!(ours.row(k)[0] >= 0.0);
                }
                let slope = ours.slope(&theta);
                for k in 0..COLUMNS {
                    let moved = |by: f64| {
                        let mut theta = theta;
                        theta[k] += by;
                        one.sum_of_squares(&theta)
                    };
                    let exact = 0.25 * (moved(1.0) - moved(-1.0));
                    prop_assert!((slope[k] - exact).abs() < 1e-10 * (1.0 + left));
                }
            }
        }

        /// Rows that begin with zeros need not be told of in full.
        #[test]
        fn leading_zeros_are_skipped(numbers in prop::collection::vec(-2.0..2.0f64, (COLUMNS + 1) * 24), step in 1..3usize) {
            let width = COLUMNS + 1;
            let mut rows = numbers.clone();
            for (k, row) in rows.chunks_exact_mut(width).enumerate() {
                row[..k / step].fill(0.0);
            }
            for known in [0, 3] {
                let mut all = HeapFactor::new(COLUMNS);
                all.fold(&mut numbers[..known * width].to_vec());
                let mut steps = all.clone();
                all.fold(&mut rows.clone());
                steps.reflect(&mut rows.clone(), &|k| step * (k + 1));
                let (a, b) = (all.sum_of_squares(&[1.0; COLUMNS]), steps.sum_of_squares(&[1.0; COLUMNS]));
                prop_assert!((a - b).abs() < 1e-11 * a);
            }
        }

        #[test]
        fn the_solution_leaves_least(numbers in prop::collection::vec(-2.0..2.0f64, (COLUMNS + 1) * (COLUMNS + 15))) {
            let mut factor = HeapFactor::new(COLUMNS);
            factor.fold(&mut numbers.clone());
            let mut theta = vec![0.0; COLUMNS];
            factor.solve_before(COLUMNS, &mut theta);
            let slope = factor.slope(&theta);
            prop_assert!(slope.iter().all(|s| s.abs() < 1e-8), "{slope:?}");
        }
    }
}
