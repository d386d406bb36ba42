//! The columns of a load: what its mass, its first moment and its inertia add to those of the body that carries it.

use nalgebra::Vector3;
use proprio_core::inertia::INERTIAL;

use super::body::LimbBody;
use super::column::{Column, Columns};
use super::dot::dot;
use super::rows::Rows;
use super::values::Values;

/// Whether a column is one of a load.
pub(super) fn is_load(column: &Column) -> bool {
    matches!(column, Column::Load { .. })
}

impl Rows {
    /// Writes the columns of loads where a model has them, each a sum of its body's own, which are there.
    pub(crate) fn put_loads(&mut self, body: &LimbBody, values: &Values, columns: &Columns) {
        for (j, own) in columns.of_joint.iter().enumerate() {
            let sum = |(c, column): (usize, &Column)| match *column {
                Column::Load { body: b, n } => {
                    let first = own.iter().position(|c| *c == Column::Inertial(b, 0))?;
                    let at = values.load_at(b, &body.coms[b]);
                    Some((c, first, load(&at, n)))
                }
                _ => None,
            };
            let sums: Vec<_> = own.iter().enumerate().filter_map(sum).collect();
            if sums.is_empty() {
                continue;
            }
            for w in 0..self.windows() {
                let row = self.row_mut(w, j);
                for (c, first, load) in &sums {
                    row[*c] = dot(load, &row[*first..first + INERTIAL]);
                }
            }
        }
    }
}

/// The inertial parameters of a point mass of 1 kg at `com` (n = 0), or how they change with its first moment (1 kg m) along
/// x, y or z (n = 1 to 3), or the same inertia about all axes (n = 4).
pub(crate) fn load(com: &Vector3<f64>, n: usize) -> [f64; INERTIAL] {
    if n == 4 {
        return [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 1.0];
    }
    let (mass, away) = match n {
        0 => (1.0, *com),
        n => (0.0, Vector3::ith(n - 1, 1.0)),
    };
    // The inertia |c|² 1 − c cᵀ, or its derivative along `away`.
    let share = if n == 0 { 0.5 } else { 1.0 };
    let spread = com * away.transpose() + away * com.transpose();
    let inertia = (nalgebra::Matrix3::identity() * spread.trace() - spread) * share;
    let i = |r: usize, c: usize| inertia[(r, c)];
    [
        mass,
        away.x,
        away.y,
        away.z,
        i(0, 0),
        i(0, 1),
        i(0, 2),
        i(1, 1),
        i(1, 2),
        i(2, 2),
    ]
}
