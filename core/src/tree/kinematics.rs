//! Where the bodies of a tree are and how they move, at one instant.

use super::joint_frame::{AboutAxis, JointFrame, JointKind, by_joint};
use super::{Joint, Tree};
use crate::Real;
use crate::scalar::sin_cos;
use crate::spatial::{Motion, Transform};
use nalgebra::{SVector, Vector3};

/// Where the bodies are. All that inverse and forward dynamics and the inertia matrix need beside velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placements<T: Real, const B: usize> {
    /// Placement of each body in its parent: of a free base in the world, of a root of another kind in the fixed base.
    pub from_parent: [Transform<T>; B],
    /// Gravity (m/s²) in the axes of the fixed base, or of the free one.
    pub gravity: Vector3<T>,
}

/// Where the bodies are and how they move; everything is written in the coordinates of the body it is indexed by.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics<T: Real, const B: usize, const V: usize> {
    /// Where the bodies are.
    pub placements: Placements<T, B>,
    /// The velocity coordinates, as given.
    pub rates: SVector<T, V>,
    /// Twist of each body.
    pub velocity: [Motion<T>; B],
    /// Gravity, m/s².
    pub gravity: [Vector3<T>; B],
}

/// The bodies' Jacobians and how fast their columns turn: for what needs them whole. `B` × `V` twists: two times 48 `B` `V`
/// bytes in `f64`.
#[derive(Clone, Copy, Debug)]
pub struct Jacobians<T: Real, const B: usize, const V: usize> {
    /// `subspace[b][c]`: twist of body b when coordinate c moves at unit rate, a column of the body's Jacobian, in the
    /// body's coordinates; zero where c does not move b.
    pub subspace: [[Motion<T>; V]; B],
    /// `subspace_rate[b][c]`: v × S of the body that coordinate c belongs to: how fast that column turns.
    pub subspace_rate: [[Motion<T>; V]; B],
}

impl<T: Real, const B: usize> Placements<T, B> {
    /// No placements yet; to be updated by one tree only.
    pub fn new() -> Self {
        Self {
            from_parent: [Transform::identity(); B],
            gravity: Vector3::zeros(),
        }
    }
}

impl<T: Real, const B: usize> Default for Placements<T, B> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const B: usize, const V: usize> Kinematics<T, B, V> {
    /// No placements and no motion yet; to be updated by one tree only.
    pub fn new() -> Self {
        Self {
            placements: Placements::new(),
            rates: SVector::zeros(),
            velocity: [Motion::zero(); B],
            gravity: [Vector3::zeros(); B],
        }
    }
}

impl<T: Real, const B: usize, const V: usize> Default for Kinematics<T, B, V> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Real, const B: usize, const V: usize> Tree<T, B, V> {
    /// Placements and velocities of all bodies.
    ///
    /// `base` is the base frame's placement in the world: where the fixed base is mounted, or where the free one is. `q`
    /// holds joint positions (rad, m; the six entries of a free joint are not read: `base` says where it is), `v` the
    /// velocities.
    pub fn kinematics(
        &self,
        base: &Transform<T>,
        q: &SVector<T, V>,
        v: &SVector<T, V>,
    ) -> Kinematics<T, B, V> {
        let mut k = Kinematics::new();
        self.update_kinematics(&mut k, base, q, v);
        k
    }

    /// [`kinematics`](Self::kinematics) in place: `k` is new or of this tree.
    pub fn update_kinematics(
        &self,
        k: &mut Kinematics<T, B, V>,
        base: &Transform<T>,
        q: &SVector<T, V>,
        v: &SVector<T, V>,
    ) {
        self.update_placements(&mut k.placements, base, q);
        k.rates = *v;
        for b in 0..B {
            by_joint!(self.move_body(b, k), free: self.move_free(b, k));
        }
    }

    /// Placements of all bodies; arguments as of [`kinematics`](Self::kinematics).
    pub fn placements(&self, base: &Transform<T>, q: &SVector<T, V>) -> Placements<T, B> {
        let mut placements = Placements::new();
        self.update_placements(&mut placements, base, q);
        placements
    }

    /// [`placements`](Self::placements) in place: `placements` are new or of this tree.
    #[inline]
    pub fn update_placements(
        &self,
        placements: &mut Placements<T, B>,
        base: &Transform<T>,
        q: &SVector<T, V>,
    ) {
        placements.gravity = base.rotation.tr_mul(&self.gravity);
        // Side by side: sines of several angles at a time where the machine has lanes.
        let at = |b: usize| {
            let position = q.get(self.first_coordinate[b]);
            position.copied().unwrap_or(T::zero())
        };
        let angles: [T; B] = core::array::from_fn(at);
        let (mut sin, mut cos) = ([T::zero(); B], [T::zero(); B]);
        for b in 0..B {
            (sin[b], cos[b]) = sin_cos(angles[b]);
        }
        for b in 0..B {
            let body = &self.bodies[b];
            let turn = (sin[b], cos[b]);
            let placed = &mut placements.from_parent[b];
            match self.kinds[b] {
                JointKind::Free => *placed = *base,
                JointKind::Sliding => {
                    let slide = match body.joint {
                        Joint::Prismatic(axis) => axis * angles[b],
                        Joint::Free | Joint::Revolute(_) => Vector3::zeros(),
                    };
                    *placed = Transform {
                        rotation: body.placement.rotation,
                        translation: body.placement.translation + body.placement.rotation * slide,
                    };
                    continue;
                }
                JointKind::AboutX => AboutAxis::<T, 0>::write(&mut placed.rotation, turn),
                JointKind::AboutY => AboutAxis::<T, 1>::write(&mut placed.rotation, turn),
                JointKind::AboutZ => AboutAxis::<T, 2>::write(&mut placed.rotation, turn),
                JointKind::Turning => placed.rotation = self.turning[b].rotation(turn),
            }
            if self.kinds[b] != JointKind::Free {
                placed.translation = body.placement.translation;
            }
        }
    }

    #[inline(always)]
    fn move_free(&self, b: usize, k: &mut Kinematics<T, B, V>) {
        let rate = |n: usize| k.rates.get(n).copied().unwrap_or(T::zero());
        let part = |first: usize| Vector3::from_fn(|row, _| rate(first + row));
        k.velocity[b] = Motion::new(part(0), part(3));
        k.gravity[b] = k.placements.gravity;
    }

    #[inline(always)]
    fn move_body<J: JointFrame<T>>(&self, b: usize, k: &mut Kinematics<T, B, V>) {
        let placement = &k.placements.from_parent[b];
        let joint = J::new(placement, &self.bodies[b].joint);
        let rate = k.rates.get(self.first_coordinate[b]);
        let rate = rate.copied().unwrap_or(T::zero());
        let parent = self.bodies[b].parent;
        let above = parent.and_then(|parent| k.velocity.get(parent).zip(k.gravity.get(parent)));
        let (velocity, gravity) = match above {
            Some((above, gravity)) => {
                let linear = above.linear + above.angular.cross(&placement.translation);
                let carried = Motion::new(joint.to_child(&above.angular), joint.to_child(&linear));
                (carried, *gravity)
            }
            None => (Motion::zero(), k.placements.gravity),
        };
        k.gravity[b] = joint.to_child(&gravity);
        k.velocity[b] = if J::SLIDES {
            Motion::new(velocity.angular, joint.plus_along(&velocity.linear, rate))
        } else {
            Motion::new(joint.plus_along(&velocity.angular, rate), velocity.linear)
        };
    }

    /// The n-th column of what a body's joint lets it do, in the body's coordinates.
    #[inline(always)]
    pub(crate) fn own_subspace(&self, b: usize, n: usize) -> Motion<T> {
        match self.bodies[b].joint {
            Joint::Free => Motion::unit(n),
            Joint::Revolute(axis) => Motion::new(axis, Vector3::zeros()),
            Joint::Prismatic(axis) => Motion::new(Vector3::zeros(), axis),
        }
    }

    /// The bodies' Jacobians.
    pub fn jacobians(&self, k: &Kinematics<T, B, V>) -> Jacobians<T, B, V> {
        let mut jacobians = Jacobians {
            subspace: [[Motion::zero(); V]; B],
            subspace_rate: [[Motion::zero(); V]; B],
        };
        let (subspace, rate) = (&mut jacobians.subspace, &mut jacobians.subspace_rate);
        for b in 0..B {
            let body = &self.bodies[b];
            let placement = &k.placements.from_parent[b];
            let mut ancestor = body.parent;
            while let (Some(a), Some(parent)) = (ancestor, body.parent) {
                for c in self.coordinates(a) {
                    subspace[b][c] = placement.act_inverse(&subspace[parent][c]);
                    rate[b][c] = placement.act_inverse(&rate[parent][c]);
                }
                ancestor = self.bodies[a].parent;
            }
            for (n, c) in self.coordinates(b).enumerate() {
                subspace[b][c] = self.own_subspace(b, n);
                rate[b][c] = k.velocity[b].cross(&subspace[b][c]);
            }
        }
        jacobians
    }
}
