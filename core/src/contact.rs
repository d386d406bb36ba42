//! Feet on the ground: the contact point's Jacobian, and the projector that takes any force at it out of the equations.
//!
//! A foot is a sphere. It touches the ground at its lowest point along gravity, whatever it stands on or slips along, so the
//! Jacobian J of that point of the foot's body turns with the base's tilt. A force λ there is Jᵀλ in the equations of motion;
//! with Q an orthonormal basis of the range of Jᵀ the projector
//!
//! ```text
//! P = 1 − J⁺J = 1 − Q Qᵀ,     P Jᵀλ = 0 for every λ
//! ```
//!
//! removes it without knowing it (Aghili 2005; Righetti & others 2011). For a free base P depends on the joints and on gravity's
//! direction in the base alone: no height, no velocity, no friction cone. Each foot costs three of the equations.
//!
//! Q is made by Gram-Schmidt orthogonalisation, each row of J in its turn and twice ("twice is enough": Giraud, Langou &
//! Rozložník 2005). A row that the earlier ones nearly span adds no direction, so that a singular posture leaves P finite; what
//! then passes of a force is [`SINGULAR`] of it at most. The instructions are the same whatever touches the ground.

use crate::spatial::Motion;
use crate::tree::{Joint, Placements, Tree};
use crate::{Real, scalar::real};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

mod gravity;

pub use gravity::GravityDirection;

/// A row of the Jacobian of which this share or less is new beside the rows before it is taken to be spanned by them.
pub const SINGULAR: f64 = 1e-3;

/// A foot: a sphere fixed to a body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Foot<T: Real> {
    /// Index of the body in its tree.
    pub body: usize,
    /// The sphere's centre in the body's frame, m.
    pub centre: Vector3<T>,
    /// The sphere's radius, m.
    pub radius: T,
}

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// The Jacobian of the point at which `foot` touches the ground: the velocity (m/s, in the axes of the base) of that point
    /// of the foot's body, per unit of each velocity coordinate.
    ///
    /// `down` is the unit vector along gravity in the axes of the base. A foot on a body that the tree does not have moves
    /// with nothing: its Jacobian is zero.
    pub fn contact_jacobian(
        &self,
        placements: &Placements<T, B>,
        foot: &Foot<T>,
        down: &Vector3<T>,
    ) -> SMatrix<T, 3, V> {
        let mut jacobian = SMatrix::zeros();
        if foot.body >= B {
            return jacobian;
        }
        // Turns the coordinates of a body on the way from the foot to the base into those of the base.
        let mut to_base = self.rotation_to_base(placements, foot.body);
        let mut point = foot.centre + to_base.tr_mul(down) * foot.radius;
        let mut body = Some(foot.body);
        while let Some(b) = body {
            for (n, c) in self.coordinates(b).enumerate() {
                let Motion { angular, linear } = self.own_subspace(b, n);
                jacobian.set_column(c, &(to_base * (linear + angular.cross(&point))));
            }
            let placed = &placements.from_parent[b];
            point = placed.translation + placed.rotation * point;
            to_base *= placed.rotation.transpose();
            body = self.bodies()[b].parent;
        }
        jacobian
    }

    /// The rotation of a body's coordinates into those of the base.
    fn rotation_to_base(&self, placements: &Placements<T, B>, body: usize) -> Matrix3<T> {
        let mut rotation = Matrix3::identity();
        let mut next = Some(body);
        while let Some(b) = next.filter(|b| self.bodies()[*b].joint != Joint::Free) {
            rotation = placements.from_parent[b].rotation * rotation;
            next = self.bodies()[b].parent;
        }
        rotation
    }
}

/// The projector P = 1 − Q Qᵀ of `V` equations, from which the forces of `R` / 3 feet at most are taken.
///
/// Equations are in unlike units (N m and N) and of unlike noise, so P is orthogonal in scaled ones: with D = diag(`scale`) it
/// projects D times the equations, and its Q spans the range of D Jᵀ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projector<T, const V: usize, const R: usize> {
    /// Q's columns; zero where a foot is in the air or a row adds no direction.
    directions: [[T; V]; R],
    rank: usize,
}

impl<T: Real, const V: usize, const R: usize> Projector<T, V, R> {
    /// P = 1: flight.
    pub fn new() -> Self {
        Self {
            directions: [[T::zero(); V]; R],
            rank: 0,
        }
    }

    /// The projector for the feet that are `loaded`, at these placements. `R` is 3 `F`; `down` as of
    /// [`contact_jacobian`](Tree::contact_jacobian); `scale` is D, each entry > 0, or 0 for an equation that is left out: P then takes the
    /// forces out of the others alone.
    pub fn update<const B: usize, const F: usize>(
        &mut self,
        tree: &Tree<T, B, V>,
        placements: &Placements<T, B>,
        feet: &[Foot<T>; F],
        loaded: [bool; F],
        down: &Vector3<T>,
        scale: &[T; V],
    ) {
        const { assert!(R == 3 * F) }
        self.rank = 0;
        for (f, foot) in feet.iter().enumerate() {
            let jacobian = tree.contact_jacobian(placements, foot, down);
            let counts = if loaded[f] { T::one() } else { T::zero() };
            for axis in 0..3 {
                let row = core::array::from_fn(|c| jacobian[(axis, c)] * scale[c] * counts);
                self.orthogonalise(3 * f + axis, row);
            }
        }
    }

    /// Makes direction `n` what of `row` is orthogonal to the directions before it.
    fn orthogonalise(&mut self, n: usize, mut row: [T; V]) {
        let before = dot(&row, &row);
        for _ in 0..2 {
            for direction in &self.directions[..n] {
                let share = dot(direction, &row);
                for (x, d) in row.iter_mut().zip(direction) {
                    *x -= share * *d;
                }
            }
        }
        let left = dot(&row, &row);
        let is_new = left > before * real(SINGULAR * SINGULAR);
        self.rank += usize::from(is_new);
        let length = if is_new {
            left.inverse_sqrt()
        } else {
            T::zero()
        };
        self.directions[n] = row.map(|x| x * length);
    }

    /// How many equations the forces cost: the rank of the loaded feet's Jacobian.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// P x, for x already times D.
    pub fn apply(&self, x: &SVector<T, V>) -> SVector<T, V> {
        let mut projected = *x;
        for direction in &self.directions {
            let share = dot(direction, x.as_slice());
            for (to, d) in projected.iter_mut().zip(direction) {
                *to -= share * *d;
            }
        }
        projected
    }

    /// Q's columns.
    pub(crate) fn directions(&self) -> &[[T; V]; R] {
        &self.directions
    }
}

impl<T: Real, const V: usize, const R: usize> Default for Projector<T, V, R> {
    fn default() -> Self {
        Self::new()
    }
}

fn dot<T: Real>(a: &[T], b: &[T]) -> T {
    a.iter().zip(b).fold(T::zero(), |sum, (x, y)| sum + *x * *y)
}

#[cfg(test)]
mod tests;
