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

use nalgebra::SVector;

use crate::Real;
use crate::spatial::Force;
use crate::tree::joint_frame::{JointFrame, by_joint};
use crate::tree::{Kinematics, Tree};

/// Momentum and weight.
type Carried<T> = (Force<T>, Force<T>);

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// p = H q̇ (N m s) and its rate without torque, g − Cᵀ q̇ (N m): τ = ṗ + g − Cᵀ q̇. For a free base the first six entries are its
    /// own, rotation first.
    pub fn momentum_and_rate(&self, k: &Kinematics<T, B, V>) -> (SVector<T, V>, SVector<T, V>) {
        let mut felt = (SVector::zeros(), SVector::zeros());
        let mut carried: [Carried<T>; B] = core::array::from_fn(|b| {
            let inertia = &self.bodies()[b].inertia;
            let (velocity, h) = (&k.velocity[b], inertia.first_moment());
            let momentum = Force::new(
                inertia.turned(&velocity.angular) + h.cross(&velocity.linear),
                velocity.linear * inertia.mass() + velocity.angular.cross(&h),
            );
            let weight = Force::new(k.gravity[b].cross(&h), k.gravity[b] * -inertia.mass());
            (momentum, weight)
        });
        for b in (0..B).rev() {
            by_joint!(
                self.hand_down(b, k, &mut carried, &mut felt),
                free: self.feel_free(b, k, &carried[b], &mut felt)
            );
        }
        felt
    }

    /// Body b's joint feels its share; the rest goes to the body that carries it.
    #[inline(always)]
    fn hand_down<J: JointFrame<T>>(
        &self,
        b: usize,
        k: &Kinematics<T, B, V>,
        carried: &mut [Carried<T>; B],
        (momentum, rate): &mut (SVector<T, V>, SVector<T, V>),
    ) {
        let placement = &k.placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        let (h, w) = carried[b];
        let velocity = &k.velocity[b];
        let c = self.coordinates(b).start;
        // −(v × S) · h = S · (v ×* h).
        if J::SLIDES {
            momentum[c] = joint.along(&h.linear);
            rate[c] = joint.along(&(w.linear + velocity.angular.cross(&h.linear)));
        } else {
            let turning = velocity.angular.cross(&h.angular) + velocity.linear.cross(&h.linear);
            momentum[c] = joint.along(&h.angular);
            rate[c] = joint.along(&(w.angular + turning));
        }
        if let Some(parent) = self.bodies()[b].parent {
            let above = &mut carried[parent];
            for (above, own) in [(&mut above.0, h), (&mut above.1, w)] {
                let linear = joint.to_parent(&own.linear);
                above.angular +=
                    joint.to_parent(&own.angular) + placement.translation.cross(&linear);
                above.linear += linear;
            }
        }
    }

    /// What a free base feels.
    fn feel_free(
        &self,
        b: usize,
        k: &Kinematics<T, B, V>,
        (h, w): &Carried<T>,
        (momentum, rate): &mut (SVector<T, V>, SVector<T, V>),
    ) {
        for (n, c) in self.coordinates(b).enumerate() {
            let s = self.own_subspace(b, n);
            momentum[c] = s.dot(h);
            rate[c] = s.dot(w) - k.velocity[b].cross(&s).dot(h);
        }
    }
}
