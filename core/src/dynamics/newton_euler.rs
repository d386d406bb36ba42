//! Inverse dynamics: the recursive Newton-Euler algorithm (Luh, Walker & Paul 1980; Featherstone ch. 5).
//!
//! In each body's own coordinates, outwards: angular velocity ω and acceleration α, and the *classical* acceleration a of the
//! frame's origin less gravity. Classical rather than spatial: the linear velocity is then needed nowhere but at a free base.
//! With m, h and I the body's parameters about that origin,
//!
//! ```text
//! f = m a + α × h + ω × (ω × h),     n = h × a + I α + ω × (I ω)
//! ```
//!
//! and inwards the sums of f and n. The joint feels the share along its axis.

use crate::Real;
use crate::spatial::Force;

use crate::tree::joint_frame::{JointFrame, by_joint};
use crate::tree::{Placements, Tree};
use nalgebra::{SVector, Vector3};

/// How a body's frame moves, in its own coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Acceleration<T: Real> {
    /// ω, rad/s.
    pub(crate) velocity: Vector3<T>,
    /// α, rad/s².
    pub(crate) angular: Vector3<T>,
    /// Of the origin, less gravity, m/s².
    pub(crate) linear: Vector3<T>,
}

impl<T: Real> Acceleration<T> {
    pub(crate) fn zero() -> Self {
        Self {
            velocity: Vector3::zeros(),
            angular: Vector3::zeros(),
            linear: Vector3::zeros(),
        }
    }

    /// Classical acceleration, less gravity, of a point fixed to the frame.
    #[inline(always)]
    fn at(&self, point: &Vector3<T>) -> Vector3<T> {
        let turning = self.velocity.cross(&self.velocity.cross(point));
        self.linear + self.angular.cross(point) + turning
    }
}

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// Inverse dynamics τ = H a + C v + g (N m) into `torque`.
    ///
    /// For a free base the first six entries are the wrench on the base in its own coordinates, couple first.
    pub fn write_inverse_dynamics(
        &self,
        placements: &Placements<T, B>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
        torque: &mut SVector<T, V>,
    ) {
        self.newton_euler(placements, v, a, &placements.gravity, torque);
    }

    /// The torque that moves the tree so under `gravity` (m/s², in the axes of the base).
    pub(super) fn newton_euler(
        &self,
        placements: &Placements<T, B>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
        gravity: &Vector3<T>,
        torque: &mut SVector<T, V>,
    ) {
        let mut moved = [Acceleration::zero(); B];
        let mut force = [Force::zero(); B];
        for b in 0..B {
            moved[b] = by_joint!(
                self.accelerate(b, placements, v, a, gravity, &moved),
                free: accelerate_free(v, a, gravity)
            );
            force[b] = self.force(b, &moved[b]);
        }
        for b in (0..B).rev() {
            by_joint!(
                self.carry(b, placements, &mut force, torque),
                free: write_free(&force[b], torque)
            );
        }
    }

    /// How body b moves, its parent's motion known.
    #[inline(always)]
    pub(crate) fn accelerate<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        v: &SVector<T, V>,
        a: &SVector<T, V>,
        gravity: &Vector3<T>,
        moved: &[Acceleration<T>; B],
    ) -> Acceleration<T> {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        let c = self.coordinates(b).start;
        let entry = |of: &SVector<T, V>| of.get(c).copied().unwrap_or(T::zero());
        let (rate, acceleration) = (entry(v), entry(a));
        let parent = self.bodies()[b].parent;
        let above = match parent.and_then(|parent| moved.get(parent)) {
            Some(above) => Acceleration {
                velocity: joint.to_child(&above.velocity),
                angular: joint.to_child(&above.angular),
                linear: joint.to_child(&above.at(&placement.translation)),
            },
            None => Acceleration {
                linear: -joint.to_child(gravity),
                ..Acceleration::zero()
            },
        };
        if J::SLIDES {
            let coriolis = joint.cross_axis(&above.velocity) * (rate + rate);
            Acceleration {
                linear: joint.plus_along(&(above.linear + coriolis), acceleration),
                ..above
            }
        } else {
            let velocity = joint.plus_along(&above.velocity, rate);
            let coriolis = joint.cross_axis(&above.velocity) * rate;
            Acceleration {
                velocity,
                angular: joint.plus_along(&(above.angular + coriolis), acceleration),
                linear: above.linear,
            }
        }
    }

    /// The force and couple that move body b so.
    #[inline(always)]
    fn force(&self, b: usize, moved: &Acceleration<T>) -> Force<T> {
        let inertia = &self.bodies()[b].inertia;
        let h = inertia.first_moment();
        let (omega, alpha) = (&moved.velocity, &moved.angular);
        Force::new(
            h.cross(&moved.linear) + inertia.turned(alpha) + omega.cross(&inertia.turned(omega)),
            moved.linear * inertia.mass() + alpha.cross(&h) + omega.cross(&omega.cross(&h)),
        )
    }

    /// Body b's joint takes its share; the rest goes to the body that carries it.
    #[inline(always)]
    fn carry<J: JointFrame<T>>(
        &self,
        b: usize,
        placements: &Placements<T, B>,
        force: &mut [Force<T>; B],
        torque: &mut SVector<T, V>,
    ) {
        let placement = &placements.from_parent[b];
        let joint = J::new(placement, &self.bodies()[b].joint);
        let own = force[b];
        let felt = if J::SLIDES { own.linear } else { own.angular };
        torque[self.coordinates(b).start] = joint.along(&felt);
        if let Some(parent) = self.bodies()[b].parent {
            let linear = joint.to_parent(&own.linear);
            let above = &mut force[parent];
            above.angular += joint.to_parent(&own.angular) + placement.translation.cross(&linear);
            above.linear += linear;
        }
    }
}

/// How a free base moves: the first six coordinates are its twist and the derivative of those numbers.
#[inline(always)]
pub(crate) fn accelerate_free<T: Real, const V: usize>(
    v: &SVector<T, V>,
    a: &SVector<T, V>,
    gravity: &Vector3<T>,
) -> Acceleration<T> {
    let entry = |of: &SVector<T, V>, n: usize| of.get(n).copied().unwrap_or(T::zero());
    let part = |of, first: usize| Vector3::from_fn(|row, _| entry(of, first + row));
    let velocity = part(v, 0);
    Acceleration {
        velocity,
        angular: part(a, 0),
        linear: part(a, 3) + velocity.cross(&part(v, 3)) - gravity,
    }
}

/// The wrench on a free base.
#[inline(always)]
fn write_free<T: Real, const V: usize>(force: &Force<T>, torque: &mut SVector<T, V>) {
    for n in 0..3 {
        torque[n] = force.angular[n];
        torque[3 + n] = force.linear[n];
    }
}
