//! The projector that takes any force at feet out of the equations, as [`proprio_core::contact::Projector`] does for a number of feet that the compiler
//! knows: P = 1 − Q Qᵀ, Q an orthonormal basis of what such forces reach. Only feet that may carry a force have directions here.

use nalgebra::Vector3;
use proprio_core::contact::SINGULAR;

use super::legged::Point;
use crate::equation::free_tree::{FreeTree, Pose};

/// The share of a row's square beyond which one pass leaves it orthogonal to rounding: half, as Daniel and others have it.
const KEPT: f64 = 0.5;

/// See the module.
#[derive(Debug, Clone, Default)]
pub(super) struct Projector {
    width: usize,
    /// Q's columns, one after the other.
    directions: Vec<f64>,
    row: Vec<f64>,
}

impl Projector {
    /// The projector of D times the equations, D = diag(`scale`), zero of an equation that is left out. Forces act at the lowest of each point's
    /// sphere along `down`, a unit vector in the base's axes.
    pub(super) fn update<'a>(
        &mut self,
        tree: &FreeTree,
        pose: &Pose,
        points: impl Iterator<Item = &'a Point>,
        down: &Vector3<f64>,
        scale: &[f64],
    ) {
        self.width = scale.len();
        self.directions.clear();
        for point in points {
            let at = point.place(pose) + down * point.radius;
            for axis in 0..3 {
                self.row.clear();
                self.row.resize(self.width, 0.0);
                for (c, velocity) in tree.point_velocities(pose, point.body, at) {
                    self.row[c] = velocity[axis] * scale[c];
                }
                self.orthogonalise();
            }
        }
    }

    /// Adds what of the row is orthogonal to the directions before it; by Gram and Schmidt, and again where that has taken so much of it away that
    /// rounding shows (Daniel, Gragg, Kaufman & Stewart 1976, *Mathematics of Computation* 30).
    fn orthogonalise(&mut self) {
        let before = dot(&self.row, &self.row);
        for _ in 0..2 {
            let whole = dot(&self.row, &self.row);
            for direction in self.directions.chunks_exact(self.width.max(1)) {
                let share = dot(direction, &self.row);
                for (x, d) in self.row.iter_mut().zip(direction) {
                    *x -= share * d;
                }
            }
            if dot(&self.row, &self.row) > KEPT * whole {
                break;
            }
        }
        let left = dot(&self.row, &self.row);
        if left > before * SINGULAR * SINGULAR {
            let length = left.sqrt();
            self.directions.extend(self.row.iter().map(|x| x / length));
        }
    }

    /// How many equations the forces cost.
    pub(super) fn rank(&self) -> usize {
        self.directions.len() / self.width.max(1)
    }

    /// Q's columns.
    pub(super) fn directions(&self) -> impl Iterator<Item = &[f64]> + Clone {
        self.directions.chunks_exact(self.width.max(1))
    }

    /// Makes x, which is times D already, P x.
    pub(super) fn apply(&self, x: &mut [f64]) {
        // Q is orthonormal: one direction after the other is the same as all at once.
        for direction in self.directions() {
            let share = dot(direction, x);
            for (to, d) in x.iter_mut().zip(direction) {
                *to -= share * d;
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
