//! A base that the legs push about: what a base does that nothing holds, or a share of it, and what the joints feel of that.
//!
//! The base's own six equations of motion, without weight, which what it is suspended from carries, give its twist v and its acceleration a at the
//! legs' velocities and accelerations:
//!
//! ```text
//! M_bb v + M_bj q̇ = 0,   M_bb a + M_bj q̈ + c_b(v, q̇) = 0
//! ```
//!
//! The joints feel the difference of their inverse dynamics over a base that moves so and over one that is still. It is made at each tick of the
//! controller from the accelerations of the step before, and held until the next.

use nalgebra::{SMatrix, SVector, Vector3};
use proprio_core::go2::{self, JOINTS, JOINTS_PER_LEG, Leg};
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;

/// The base's coordinates, before those of the joints.
const BASE: usize = 6;
const COORDINATES: usize = BASE + JOINTS;

/// A leg's positions, velocities and accelerations: rad, rad/s, rad/s².
pub(super) type LegMotion = [Vector3<f64>; 3];

pub(super) struct Suspension {
    /// How much of a free base's motion it has.
    share: f64,
    tree: Tree<f64, { JOINTS + 1 }, COORDINATES>,
}

impl Suspension {
    /// `bodies` are those of a leg.
    pub(super) fn new(
        share: f64,
        bodies: impl Fn(Leg) -> [proprio_core::inertia::InertialParameters<f64>; JOINTS_PER_LEG],
    ) -> Self {
        let cad = go2::free::<f64>();
        let mut all = cad.bodies().map(|body| body.inertia);
        let of_legs = Leg::ALL.into_iter().flat_map(bodies);
        (all.iter_mut().skip(1).zip(of_legs)).for_each(|(to, from)| *to = from);
        Self {
            share,
            tree: cad.with_inertia(&all),
        }
    }

    /// What the joints' motors have to give more than over a still base, N m, leg by leg. Legs without a motion rest at zero.
    pub(super) fn felt(&self, legs: &[(Leg, LegMotion)]) -> Vec<Vector3<f64>> {
        let mut all = [SVector::<f64, COORDINATES>::zeros(); 3];
        let first = |leg: &Leg| BASE + JOINTS_PER_LEG * leg.index();
        for (leg, motion) in legs {
            for (to, own) in all.iter_mut().zip(motion) {
                to.fixed_rows_mut::<JOINTS_PER_LEG>(first(leg))
                    .copy_from(own);
            }
        }
        let [q, still, ddq] = all;
        let torque = |v: &SVector<f64, COORDINATES>, a: &SVector<f64, COORDINATES>| {
            let k = self.tree.kinematics(&Transform::identity(), &q, v);
            (self.tree.inverse_dynamics(&k, v, a), k)
        };
        let (over_still, k) = torque(&still, &ddq);
        let inertia = self.tree.inertia_matrix(&k);
        let of_base: SMatrix<f64, BASE, BASE> = inertia.fixed_view::<BASE, BASE>(0, 0).into();
        let Some(root) = of_base.cholesky() else {
            return vec![Vector3::zeros(); legs.len()];
        };
        let put = |to: &SVector<f64, COORDINATES>, base: SVector<f64, BASE>| {
            let mut all = *to;
            all.fixed_rows_mut::<BASE>(0).copy_from(&base);
            all
        };
        let base = |of: &SVector<f64, COORDINATES>| -> SVector<f64, BASE> {
            of.fixed_rows::<BASE>(0).into()
        };
        let twist = -root.solve(&base(&(inertia * still)));
        // Weight is that of the robot at rest.
        let (weight, _) = torque(&SVector::zeros(), &SVector::zeros());
        let (bias, _) = torque(&put(&still, twist), &ddq);
        let acceleration = -root.solve(&base(&(bias - weight)));
        let share = |x: SVector<f64, BASE>| x * self.share;
        let (over_moving, _) = torque(&put(&still, share(twist)), &put(&ddq, share(acceleration)));
        let felt = over_moving - over_still;
        let of_leg =
            |(leg, _): &(Leg, LegMotion)| felt.fixed_rows::<JOINTS_PER_LEG>(first(leg)).into();
        legs.iter().map(of_leg).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A base that is free has no momentum's rate: what the legs' joints feel is what forward dynamics of the whole robot, unheld and without weight, has.
    #[test]
    fn a_free_base_moves_as_forward_dynamics_has_it() {
        let suspension =
            Suspension::new(1.0, |leg| go2::leg(leg).bodies().map(|body| body.inertia));
        let at = |n: usize, by: f64| Vector3::from_fn(|j, _| (by * (3 * n + j + 1) as f64).sin());
        let legs: Vec<(Leg, LegMotion)> = Leg::ALL
            .into_iter()
            .enumerate()
            .map(|(n, leg)| (leg, [at(n, 1.3), 4.0 * at(n, 2.1), 40.0 * at(n, 0.7)]))
            .collect();
        let felt = suspension.felt(&legs);
        let flat = |part: usize| {
            SVector::<f64, COORDINATES>::from_fn(|c, _| {
                c.checked_sub(BASE)
                    .map_or(0.0, |j| legs[j / 3].1[part][j % 3])
            })
        };
        let tree = &suspension.tree;
        let still = tree.kinematics(&Transform::identity(), &flat(0), &flat(1));
        let weight = tree.gravity_torque(&still);
        let over_still = tree.inverse_dynamics(&still, &flat(1), &flat(2)) - weight;
        let inertia = tree.inertia_matrix(&still);
        let base: SMatrix<f64, BASE, BASE> = inertia.fixed_view::<BASE, BASE>(0, 0).into();
        let momentum: SVector<f64, BASE> = (inertia * flat(1)).fixed_rows::<BASE>(0).into();
        let mut v = flat(1);
        v.fixed_rows_mut::<BASE>(0)
            .copy_from(&-base.cholesky().unwrap().solve(&momentum));
        let mut torque = over_still + weight;
        torque
            .fixed_rows_mut::<BASE>(0)
            .copy_from(&weight.fixed_rows::<BASE>(0));
        for (n, felt) in felt.iter().enumerate() {
            let mut own = torque.fixed_rows_mut::<3>(BASE + 3 * n);
            own += felt;
        }
        let moving = tree.kinematics(&Transform::identity(), &flat(0), &v);
        let nothing = SVector::zeros();
        let found = tree
            .forward_dynamics(&moving, &v, &torque, &nothing)
            .unwrap();
        for (n, (_, [_, _, ddq])) in legs.iter().enumerate() {
            let off = found.fixed_rows::<3>(BASE + 3 * n) - ddq;
            assert!(off.norm() < 1e-8, "{off}");
        }
    }
}
