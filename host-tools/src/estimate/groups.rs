//! The data of a limb as triangles over all its parameters: per block of time, one for each group of rows that share a noise.

use nalgebra::{DMatrix, DVector};

use super::blocks::{BlockFactors, HeapFactor};
use super::bounded::triangle;
use crate::equation::column::Columns;

/// Rows folded into a triangle over θ and the right-hand side, ρ included.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    pub(crate) triangle: DMatrix<f64>,
    /// How many.
    pub(crate) count: f64,
}

impl Group {
    /// A joint's factor, its columns at their places in θ.
    fn of_factor(columns: &Columns, joint: usize, factor: &HeapFactor) -> Self {
        let n = columns.entries.len();
        let mut rows = DMatrix::zeros(factor.columns() + 1, n + 1);
        for k in 0..=factor.columns() {
            let row = factor.row(k);
            let entry = |column: usize| column.checked_sub(k).map_or(0.0, |c| row[c]);
            for e in 0..n {
                if let Some(place) = columns.place(joint, e) {
                    rows[(k, e)] = entry(place);
                }
            }
            rows[(k, n)] = entry(factor.columns());
        }
        Self {
            triangle: triangle(rows),
            count: factor.rows(),
        }
    }

    /// Rows over θ and the right-hand side.
    pub(crate) fn of_rows(rows: &[Vec<f64>], columns: usize) -> Self {
        let matrix = DMatrix::from_fn(rows.len(), columns + 1, |r, c| rows[r][c]);
        Self {
            triangle: triangle(matrix),
            count: rows.len() as f64,
        }
    }

    /// Sum of squared residuals under θ.
    pub(crate) fn sum_of_squares(&self, theta: &DVector<f64>) -> f64 {
        let n = theta.len();
        (self.triangle.columns(0, n) * theta - self.triangle.column(n)).norm_squared()
    }
}

/// \[block\] \[group\].
#[derive(Debug, Clone)]
pub(crate) struct Groups {
    pub(crate) blocks: Vec<Vec<Group>>,
}

impl Groups {
    /// The momentum equation's: a group per joint.
    pub(crate) fn of_factors(columns: &Columns, factors: &BlockFactors) -> Self {
        let block = |block: &Vec<HeapFactor>| {
            let joints = block.iter().enumerate();
            joints
                .map(|(joint, factor)| Group::of_factor(columns, joint, factor))
                .collect()
        };
        Self {
            blocks: factors.blocks.iter().map(block).collect(),
        }
    }

    /// The groups of all chosen blocks together.
    pub(crate) fn sum(&self, chosen: impl Fn(usize) -> bool) -> Vec<Group> {
        let groups = self.blocks.first().map_or(0, Vec::len);
        let of = |group: usize| {
            let parts: Vec<&Group> = (0..self.blocks.len())
                .filter(|&b| chosen(b))
                .map(|b| &self.blocks[b][group])
                .collect();
            let width = self.blocks[0][group].triangle.ncols();
            let mut rows = DMatrix::zeros(width * parts.len(), width);
            for (k, part) in parts.iter().enumerate() {
                rows.rows_mut(width * k, width).copy_from(&part.triangle);
            }
            Group {
                triangle: triangle(rows),
                count: parts.iter().map(|p| p.count).sum(),
            }
        };
        (0..groups).map(of).collect()
    }
}

/// All groups, each divided by its noise, as one triangle.
pub(crate) fn stacked(groups: &[Group], noise: &[f64]) -> DMatrix<f64> {
    let width = groups.first().map_or(1, |g| g.triangle.ncols());
    let mut rows = DMatrix::zeros(width * groups.len(), width);
    for (k, (group, noise)) in groups.iter().zip(noise).enumerate() {
        rows.rows_mut(width * k, width)
            .copy_from(&(&group.triangle / *noise));
    }
    triangle(rows)
}
