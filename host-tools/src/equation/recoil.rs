//! What joints feel of a base that their motion moves, by momentum.
//!
//! The limbs have the momentum h over a base that is still, and the whole robot the inertia I. A base that nothing holds then has the twist
//! v = −I⁻¹ h, at which the joints' share of the momentum equation ([`super::rows`]) is another one by
//!
//! ```text
//! p(q, q̇, v) − p(q, q̇, 0)  which enters by its difference,   r(q, q̇, v) − r(q, q̇, 0)  which is integrated
//! ```
//!
//! with p = H q̇ and r = −Cᵀ q̇ of the joints. Motion and the CAD's bodies alone make it; no torque, and no acceleration. A fit moves the
//! bodies, and the share stays one of the same recoil, so that a file gives back what was fitted. Weight is left out: what holds the base up balances
//! it, and within the periods of a suspended robot's motion the base does not turn far.

use nalgebra::Matrix3;
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::{Force, Motion as Twist};

use super::free_tree::{FreeTree, Moving, OF_BASE};
use super::motion::Motion;
use crate::model::{Limb, Model};
use crate::parallel::by_number;
use crate::trajectory::Trajectory;

/// What each joint of a limb feels at each sample, sample by sample: N m s that enter by their difference, N m that are integrated.
pub(crate) type Recoil = Vec<[f64; 2]>;

/// That of each limb. A joint that was not recorded rests at zero.
pub(crate) fn recoils(model: &Model, limbs: &[(&Limb, &Motion)]) -> Vec<Recoil> {
    let robot = model.robot();
    let tree = FreeTree::new(*robot.base_inertia(), &model.placed_bodies());
    by_number(0..limbs.len(), |own| recoil(&tree, limbs, own))
}

fn recoil(tree: &FreeTree, limbs: &[(&Limb, &Motion)], own: usize) -> Recoil {
    let (limb, motion) = limbs[own];
    let mut near = vec![0; limbs.len()];
    let [mut q, mut dq] = [(); 2].map(|()| vec![0.0; tree.joints()]);
    let mut robot = Robot::new(tree);
    let mut all = Recoil::with_capacity(motion.joints * motion.time.len());
    for &t in motion.time.iter() {
        for ((limb, motion), near) in limbs.iter().zip(&mut near) {
            while *near + 1 < motion.time.len()
                && (motion.time[*near + 1] - t).abs() <= (motion.time[*near] - t).abs()
            {
                *near += 1;
            }
            let since = t - motion.time[*near];
            for (joint, body) in motion.joint.iter().zip(limb.bodies.clone()) {
                let joint: &Trajectory = joint;
                [q[body], dq[body]] = joint.after(*near, since);
            }
        }
        robot.feel(&q, &dq);
        all.extend(limb.bodies.clone().map(|body| robot.felt(body)));
    }
    all
}

/// A robot at one instant, over a base that is still and over one that is free.
struct Robot<'a> {
    tree: &'a FreeTree,
    moving: Moving,
    /// Momentum and rate of all coordinates.
    still: [Vec<f64>; 2],
    free: [Vec<f64>; 2],
}

impl<'a> Robot<'a> {
    fn new(tree: &'a FreeTree) -> Self {
        let room = || [(); 2].map(|()| vec![0.0; tree.coordinates()]);
        Self {
            tree,
            moving: Moving::default(),
            still: room(),
            free: room(),
        }
    }

    fn feel(&mut self, q: &[f64], dq: &[f64]) {
        let (tree, moving) = (self.tree, &mut self.moving);
        let [momentum, rate] = &mut self.still;
        tree.update(q, Twist::zero(), dq, moving);
        tree.momentum_and_rate(moving, momentum, rate);
        let part = |first: usize| nalgebra::Vector3::from_fn(|n, _| momentum[first + n]);
        let base = twist(&tree.whole(&moving.pose), &Force::new(-part(0), -part(3)));
        let [momentum, rate] = &mut self.free;
        tree.update(q, base, dq, moving);
        tree.momentum_and_rate(moving, momentum, rate);
    }

    /// What a body's joint feels more over the free base.
    fn felt(&self, body: usize) -> [f64; 2] {
        [0, 1].map(|n| self.free[n][OF_BASE + body] - self.still[n][OF_BASE + body])
    }
}

/// The twist at which a body has this momentum, both about the origin; none of a body without inertia.
fn twist(body: &InertialParameters<f64>, momentum: &Force<f64>) -> Twist<f64> {
    let com = body.first_moment() / body.mass();
    let about_com = body.rotational_inertia()
        - (Matrix3::identity() * com.norm_squared() - com * com.transpose()) * body.mass();
    let Some(inverse) = about_com.try_inverse().filter(|_| body.mass() > 0.0) else {
        return Twist::zero();
    };
    let angular = inverse * (momentum.angular - com.cross(&momentum.linear));
    let linear = momentum.linear / body.mass() - angular.cross(&com);
    Twist::new(angular, linear)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Robot as Described;
    use nalgebra::Vector3;

    /// Over the base that moves so the whole robot has no momentum, and the joints have that of the reduced inertia H − Fᵀ I⁻¹ F: its energy is what the
    /// limbs' motion has of it (Featherstone 2008, §9.3).
    #[test]
    fn a_free_base_leaves_no_momentum() {
        let robot = Described::go2();
        let tree = FreeTree::new(*robot.base_inertia(), robot.bodies());
        let value = |n: usize, by: f64| (by * (n as f64 + 1.0)).sin();
        let q: Vec<f64> = (0..12).map(|n| value(n, 1.3)).collect();
        let dq: Vec<f64> = (0..12).map(|n| 5.0 * value(n, 2.9)).collect();
        let mut body = Robot::new(&tree);
        body.feel(&q, &dq);
        let [free, still] = [&body.free[0], &body.still[0]];
        let before = still[..OF_BASE].iter().map(|h| h.abs()).fold(0.0, f64::max);
        assert!(before > 0.1, "{before}");
        for h in &free[..OF_BASE] {
            assert!(h.abs() < 1e-12, "{h}");
        }
        // Twice the energy is q̇ · p where the base has no momentum, and the same sum over bodies.
        let by_joints: f64 = dq.iter().zip(&free[OF_BASE..]).map(|(v, p)| v * p).sum();
        let fixed: f64 = dq.iter().zip(&still[OF_BASE..]).map(|(v, p)| v * p).sum();
        assert!(
            by_joints > 0.0 && by_joints < 0.99 * fixed,
            "{by_joints} {fixed}"
        );
    }

    #[test]
    fn a_twist_is_that_of_its_momentum() {
        let about_com = Matrix3::new(0.3, 0.01, 0.0, 0.01, 0.4, 0.02, 0.0, 0.02, 0.5);
        let body = InertialParameters::from_com(7.0, Vector3::new(0.1, -0.2, 0.05), about_com);
        let moved = Twist::new(Vector3::new(0.3, -1.0, 0.7), Vector3::new(1.0, 0.2, -0.4));
        let found = twist(&body, &body.momentum(&moved));
        let off = (found.angular - moved.angular).norm() + (found.linear - moved.linear).norm();
        assert!(off < 1e-12, "{off}");
    }
}
