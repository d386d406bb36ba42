//! The momentum equation's two sides for a tree's own inertias, without a regressor.
//!
//! With h_b = I_b v_b a body's momentum and w_b = −I_b γ its weight, both summed over the bodies that joint c carries and in its
//! body's coordinates,
//!
//! ```text
//! (H q̇)_c = S_c · Σ h,     (g − Cᵀ q̇)_c = S_c · Σ w − (v_c × S_c) · Σ h
//! ```
//!
//! (the second and third line of the table in [`crate::regressor`], summed from the tips inwards as in Featherstone ch. 5).

use nalgebra::{SVector, Vector3};

use crate::Real;
use crate::spatial::{Force, Motion};
use crate::tree::{Kinematics, Tree};

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// p = H q̇ (N m s) and its rate without torque, g − Cᵀ q̇ (N m): τ = ṗ + g − Cᵀ q̇. For a free base the first six entries are its
    /// own, rotation first.
    pub fn momentum_and_rate(&self, k: &Kinematics<T, B, V>) -> (SVector<T, V>, SVector<T, V>) {
        let (mut momentum, mut rate) = (SVector::zeros(), SVector::zeros());
        let mut carried: [(Force<T>, Force<T>); B] = core::array::from_fn(|b| {
            let inertia = &self.bodies()[b].inertia;
            let falling = Motion::new(Vector3::zeros(), -k.gravity[b]);
            (inertia.momentum(&k.velocity[b]), inertia.momentum(&falling))
        });
        for b in (0..B).rev() {
            let (h, w) = carried[b];
            for (n, c) in self.coordinates(b).enumerate() {
                let s = self.own_subspace(b, n);
                momentum[c] = s.dot(&h);
                rate[c] = s.dot(&w) - k.velocity[b].cross(&s).dot(&h);
            }
            if let Some(parent) = self.bodies()[b].parent {
                let placement = &k.placements.from_parent[b];
                let (above_h, above_w) = carried[parent];
                carried[parent] = (
                    above_h + placement.act_force(&h),
                    above_w + placement.act_force(&w),
                );
            }
        }
        (momentum, rate)
    }
}
