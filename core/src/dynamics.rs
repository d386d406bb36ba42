//! Rigid-body dynamics: τ = H q̈ + C q̇ + g.
//!
//! Torques come from the recursive Newton-Euler algorithm (Featherstone ch. 5). H and C are sums over bodies of Jacobians
//! in body coordinates, with the factorisation of C (Echeandia & Wensing 2021)
//!
//! ```text
//! H = Σ Jᵀ I J,     C = Σ Jᵀ (I J̇ + [I v ×̄*] J),     [h ×̄*] m := m ×* h  (a skew matrix)
//! ```
//!
//! I is constant in body coordinates and the second term is skew, hence Ḣ = C + Cᵀ and Ḣ − 2C is skew, on a fixed and on
//! a free base: what the momentum form needs. They cost more than the composite-rigid-body algorithm and are meant for
//! simulation and tests; the identification never forms them.

use crate::Real;
use crate::spatial::{Force, Motion, Transform};
use crate::tree::{Kinematics, Tree};
use nalgebra::{Cholesky, Const, SMatrix, SVector, Vector3};

mod derivatives;
pub use derivatives::MomentumDerivatives;

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// Inverse dynamics τ = H a + C v + g (N m) by recursive Newton-Euler.
    ///
    /// For a free base the first six entries are the wrench on the base in its own coordinates, couple first.
    pub fn inverse_dynamics(
        &self,
        kinematics: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
    ) -> SVector<T, V> {
        self.newton_euler(kinematics, v, a, true)
    }

    /// Gravity's torque g(q), N m.
    pub fn gravity_torque(&self, kinematics: &Kinematics<T, B, V>) -> SVector<T, V> {
        let at_rest = Kinematics {
            velocity: [Motion::zero(); B],
            ..*kinematics
        };
        self.newton_euler(&at_rest, &SVector::zeros(), &SVector::zeros(), true)
    }

    /// C q̇, N m.
    pub fn coriolis_torque(
        &self,
        kinematics: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
    ) -> SVector<T, V> {
        self.newton_euler(kinematics, v, &SVector::zeros(), false)
    }

    fn newton_euler(
        &self,
        k: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
        with_gravity: bool,
    ) -> SVector<T, V> {
        let mut acceleration = [Motion::zero(); B];
        let mut force = [Force::zero(); B];
        for b in 0..B {
            let body = &self.bodies()[b];
            if let Some(parent) = body.parent {
                acceleration[b] = k.from_parent[b].act_inverse(&acceleration[parent]);
            }
            for c in self.coordinates(b) {
                let s = &k.subspace[b][c];
                acceleration[b] =
                    acceleration[b] + s.scale(a[c]) + k.velocity[b].cross(s).scale(v[c]);
            }
            // A body at rest under gravity feels what a body accelerated upwards feels.
            let lift = if with_gravity {
                -k.gravity[b]
            } else {
                Vector3::zeros()
            };
            let felt = Motion::new(acceleration[b].angular, acceleration[b].linear + lift);
            let momentum = body.inertia.momentum(&k.velocity[b]);
            force[b] = body.inertia.momentum(&felt) + k.velocity[b].cross_force(&momentum);
        }
        let mut torque = SVector::zeros();
        for b in (0..B).rev() {
            for c in self.coordinates(b) {
                torque[c] = k.subspace[b][c].dot(&force[b]);
            }
            if let Some(parent) = self.bodies()[b].parent {
                force[parent] = force[parent] + k.from_parent[b].act_force(&force[b]);
            }
        }
        torque
    }

    /// The joint-space inertia matrix H(q).
    pub fn inertia_matrix(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, V> {
        let mut h = SMatrix::zeros();
        self.for_each_pair(|b, column| {
            let momentum = self.bodies()[b].inertia.momentum(&k.subspace[b][column]);
            for row in 0..V {
                h[(row, column)] += k.subspace[b][row].dot(&momentum);
            }
        });
        h
    }

    /// C(q, q̇), the factorisation for which Ḣ = C + Cᵀ.
    pub fn coriolis_matrix(&self, k: &Kinematics<T, B, V>) -> SMatrix<T, V, V> {
        let mut c = SMatrix::zeros();
        self.for_each_pair(|b, column| {
            let (inertia, s) = (&self.bodies()[b].inertia, &k.subspace[b][column]);
            let rate = k.subspace_rate[b][column] - k.velocity[b].cross(s);
            let force = inertia.momentum(&rate) + s.cross_force(&inertia.momentum(&k.velocity[b]));
            for row in 0..V {
                c[(row, column)] += k.subspace[b][row].dot(&force);
            }
        });
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
        for b in 0..B {
            placement[b] = match self.bodies()[b].parent {
                Some(parent) => placement[parent].compose(&k.from_parent[b]),
                None if self.coordinates(b).len() == 6 => k.from_parent[b],
                None => base.compose(&k.from_parent[b]),
            };
        }
        placement.map(|p| p.translation)
    }

    /// Forward dynamics: the acceleration that solves (H + diag(`armature`)) a = τ − C v − g.
    ///
    /// `armature` is the rotor inertia seen from the joint, kg m²; zero on a free base's coordinates. `None` if the
    /// matrix is not positive definite, as with massless bodies.
    pub fn forward_dynamics(
        &self,
        k: &Kinematics<T, B, V>,
        v: &SVector<T, V>,
        torque: &SVector<T, V>,
        armature: &SVector<T, V>,
    ) -> Option<SVector<T, V>> {
        let inertia = self.inertia_matrix(k) + SMatrix::from_diagonal(armature);
        let bias = self.inverse_dynamics(k, v, &SVector::zeros());
        Cholesky::<T, Const<V>>::new(inertia).map(|factor| factor.solve(&(torque - bias)))
    }
}

#[cfg(test)]
mod tests;
