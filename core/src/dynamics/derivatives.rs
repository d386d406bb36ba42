//! How the momentum equation's two sides change with position, velocity and the base's attitude, without differences.
//!
//! In body coordinates a Jacobian column S_j turns with a joint i between j and the body as ∂S_j/∂q_i = S_j × S_i, gravity
//! with every joint as ∂γ/∂q_i = γ × S_i, and a body's velocity as ∂v/∂q_i = Ṡ_i (Featherstone ch. 2; the same steps as
//! those of Singh, Russell & Wensing 2022 for torques). With h = I v the momentum, w = −I γ the weight and
//!
//! ```text
//! x_i = S_i ×* h + I Ṡ_i,     y_i = S_i ×* w − I (γ × S_i)
//! ```
//!
//! p = H q̇ and r = g − Cᵀ q̇ change, for a joint j that carries joint i or is it, and summed over the bodies that i moves, by
//!
//! ```text
//! ∂p_j/∂q_i = S_j · x_i,     ∂p_i/∂q_j = S_i · I Ṡ_j,     ∂r_j/∂q_i = ∂r_i/∂q_j = S_j · y_i − Ṡ_j · x_i
//! ```
//!
//! and with the velocity by ∂p/∂q̇ = H and ∂r/∂q̇ = −(∂p/∂q)ᵀ: p and −r are the derivatives of one function, the Lagrangian,
//! by q̇ and by q.

use crate::Real;
use crate::spatial::Motion;
use crate::tree::{Jacobians, Kinematics, Tree};
use nalgebra::{Matrix3, SMatrix, Vector3};

/// Derivatives of p = H q̇ (N m s) and r = g − Cᵀ q̇ (N m); column c is per rad or rad/s of coordinate c.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MomentumDerivatives<T: Real, const N: usize> {
    /// ∂p/∂q.
    pub momentum_by_position: SMatrix<T, N, N>,
    /// ∂p/∂q̇ = H.
    pub momentum_by_velocity: SMatrix<T, N, N>,
    /// ∂r/∂q; ∂r/∂q̇ is the negative transpose of ∂p/∂q.
    pub rate_by_position: SMatrix<T, N, N>,
    /// ∂r per rad that the base is turned about its own x, y and z axis.
    pub rate_by_base: SMatrix<T, N, 3>,
}

impl<T: Real, const N: usize> Tree<T, N, N> {
    /// Derivatives of the momentum equation's two sides for the tree's own inertias, on a fixed base.
    pub fn momentum_derivatives(&self, k: &Kinematics<T, N, N>) -> MomentumDerivatives<T, N> {
        let mut d = MomentumDerivatives {
            momentum_by_position: SMatrix::zeros(),
            momentum_by_velocity: SMatrix::zeros(),
            rate_by_position: SMatrix::zeros(),
            rate_by_base: SMatrix::zeros(),
        };
        let jacobians = self.jacobians(k);
        let mut to_base = [Matrix3::identity(); N];
        for b in 0..N {
            to_base[b] = match self.bodies()[b].parent {
                Some(parent) => to_base[parent] * k.placements.from_parent[b].rotation,
                None => k.placements.from_parent[b].rotation,
            };
            self.add_derivatives(k, &jacobians, b, &to_base[b], &mut d);
        }
        d
    }

    /// Adds body b's share.
    fn add_derivatives(
        &self,
        k: &Kinematics<T, N, N>,
        jacobians: &Jacobians<T, N, N>,
        b: usize,
        to_base: &Matrix3<T>,
        d: &mut MomentumDerivatives<T, N>,
    ) {
        let inertia = &self.bodies()[b].inertia;
        let lift = Motion::new(Vector3::zeros(), -k.gravity[b]);
        let (momentum, weight) = (inertia.momentum(&k.velocity[b]), inertia.momentum(&lift));
        let mut lower = Some(b);
        while let Some(i) = lower {
            let (s, rate) = (&jacobians.subspace[b][i], &jacobians.subspace_rate[b][i]);
            let along = inertia.momentum(s);
            let x = s.cross_force(&momentum) + inertia.momentum(rate);
            let y = s.cross_force(&weight) + inertia.momentum(&lift.cross(s));
            let felt = to_base * along.linear.cross(&lift.linear);
            for n in 0..3 {
                d.rate_by_base[(i, n)] += felt[n];
            }
            let mut upper = Some(i);
            while let Some(j) = upper {
                let (s, rate) = (&jacobians.subspace[b][j], &jacobians.subspace_rate[b][j]);
                let inertia = s.dot(&along);
                let curvature = s.dot(&y) - rate.dot(&x);
                d.momentum_by_position[(j, i)] += s.dot(&x);
                d.momentum_by_velocity[(j, i)] += inertia;
                d.rate_by_position[(j, i)] += curvature;
                if j != i {
                    d.momentum_by_position[(i, j)] += rate.dot(&along);
                    d.momentum_by_velocity[(i, j)] += inertia;
                    d.rate_by_position[(i, j)] += curvature;
                }
                upper = self.bodies()[j].parent;
            }
            lower = self.bodies()[i].parent;
        }
    }
}
