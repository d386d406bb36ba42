//! Rigid-body dynamics: τ = H q̈ + C q̇ + g.
//!
//! - [`write_inverse_dynamics`](Tree::write_inverse_dynamics): the recursive Newton-Euler algorithm;
//! - [`write_inertia_matrix`](Tree::write_inertia_matrix): the composite-rigid-body algorithm;
//! - [`write_forward_dynamics`](Tree::write_forward_dynamics): the articulated-body algorithm.
//!
//! They take where the bodies are ([`Placements`](crate::tree::Placements)), write in place and cost what Featherstone's ch. 5–7
//! say. The functions beside them that return their result take the whole [`Kinematics`].
//!
//! C is a sum over bodies of Jacobians in body coordinates, with the factorisation of Echeandia & Wensing (2021)
//!
//! ```text
//! C = Σ Jᵀ (I J̇ + [I v ×̄*] J),     [h ×̄*] m := m ×* h  (a skew matrix)
//! ```
//!
//! I is constant in body coordinates and the second term is skew, hence Ḣ = C + Cᵀ and Ḣ − 2C is skew, on a fixed and on
//! a free base: what the momentum form needs. It is meant for simulation and tests; the identification never forms it.

use crate::Real;
use crate::spatial::Transform;
use crate::tree::{Kinematics, Tree};
use nalgebra::{SMatrix, SVector, Vector3};

mod articulated;
mod composite;
mod derivatives;
mod momentum;
mod newton_euler;
pub use derivatives::MomentumDerivatives;
pub(crate) use newton_euler::{Acceleration, accelerate_free};

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// Inverse dynamics τ = H a + C v + g (N m): [`write_inverse_dynamics`](Self::write_inverse_dynamics).
    pub fn inverse_dynamics(
        &self,
        kinematics: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
    ) -> SVector<T, V> {
        let mut torque = SVector::zeros();
        self.write_inverse_dynamics(&kinematics.placements, v, a, &mut torque);
        torque
    }

    /// Gravity's torque g(q), N m.
    pub fn gravity_torque(&self, kinematics: &Kinematics<T, B, V>) -> SVector<T, V> {
        let (mut torque, zero) = (SVector::zeros(), SVector::zeros());
        self.write_inverse_dynamics(&kinematics.placements, &zero, &zero, &mut torque);
        torque
    }

    /// C q̇, N m.
    pub fn coriolis_torque(
        &self,
        kinematics: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
    ) -> SVector<T, V> {
        let mut torque = SVector::zeros();
        let (placements, none) = (&kinematics.placements, Vector3::zeros());
        self.newton_euler(placements, v, &SVector::zeros(), &none, &mut torque);
        torque
    }

    /// The joint-space inertia matrix H(q): [`write_inertia_matrix`](Self::write_inertia_matrix).
    pub fn inertia_matrix(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, V> {
        let mut inertia = SMatrix::zeros();
        self.write_inertia_matrix(&k.placements, &mut inertia);
        inertia
    }

    /// C(q, q̇), the factorisation for which Ḣ = C + Cᵀ.
    pub fn coriolis_matrix(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, V> {
        let mut c = SMatrix::zeros();
        let j = self.jacobians(k);
        for (b, body) in self.bodies().iter().enumerate() {
            let (inertia, v) = (&body.inertia, &k.velocity[b]);
            for column in 0..V {
                // Zero where the coordinate does not move the body.
                let s = &j.subspace[b][column];
                let rate = j.subspace_rate[b][column] - v.cross(s);
                let force = inertia.momentum(&rate) + s.cross_force(&inertia.momentum(v));
                for row in 0..V {
                    c[(row, column)] += j.subspace[b][row].dot(&force);
                }
            }
        }
        c
    }

    /// Kinetic and potential energy, J; the potential is zero at the world's origin.
    ///
    /// `base` is the argument given to [`kinematics`](Tree::kinematics).
    pub fn energy(&self, k: &Kinematics<T, B, V>, base: &Transform<T>) -> (T, T) {
        let mut kinetic = T::zero();
        let mut potential = T::zero();
        for (b, origin) in self.origins(k, base).iter().enumerate() {
            let inertia = &self.bodies()[b].inertia;
            let (v, gravity) = (&k.velocity[b], &k.gravity[b]);
            kinetic += v.dot(&inertia.momentum(v)) * crate::scalar::real(0.5);
            potential -=
                inertia.mass() * self.gravity().dot(origin) + inertia.first_moment().dot(gravity);
        }
        (kinetic, potential)
    }

    /// Each body's origin in the world, m.
    pub(crate) fn origins(&self, k: &Kinematics<T, B, V>, base: &Transform<T>) -> [Vector3<T>; B] {
        let mut placement = [Transform::identity(); B];
        for (b, from_parent) in k.placements.from_parent.iter().enumerate() {
            placement[b] = match self.bodies()[b].parent {
                Some(parent) => placement[parent].compose(from_parent),
                None if self.coordinates(b).len() == 6 => *from_parent,
                None => base.compose(from_parent),
            };
        }
        placement.map(|p| p.translation)
    }

    /// Forward dynamics: the acceleration that solves (H + diag(`armature`)) a = τ − C v − g, by
    /// [`write_forward_dynamics`](Self::write_forward_dynamics); `None` where that is false.
    pub fn forward_dynamics(
        &self,
        k: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
        torque: &SVector<T, V>,
        armature: &SVector<T, V>,
    ) -> Option<SVector<T, V>> {
        let mut acceleration = SVector::zeros();
        self.write_forward_dynamics(&k.placements, v, torque, armature, &mut acceleration)
            .then_some(acceleration)
    }
}

#[cfg(test)]
mod tests;
