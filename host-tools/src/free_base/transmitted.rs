//! The torques that a walk's gears transmit: friction that grows with the load asks for them, and a joint's own torque, which it explains, may not tell
//! them.
//!
//! Forces at feet follow from what the base needs and from what the other joints give: least squares without the joint's own equation, for each joint in
//! turn. Of two feet on the ground the base alone would leave open what they do against each other.

use nalgebra::{DMatrix, DVector};

use super::channels::Channels;
use super::legged::Legged;
use super::walk::Walk;
use crate::equation::free_tree::{OF_BASE, Pose};

/// What is asked of a force in a direction that nothing tells, as a share of what all equations tell of one on average: to be small.
const DAMPING: f64 = 1e-3;

/// What the motion needs at a sample.
pub(super) struct Needed {
    /// Of each coordinate, N m or N.
    pub(super) force: Vec<f64>,
    /// What of it each joint's motor does not give, N m.
    pub(super) left: Vec<f64>,
}

/// Each joint's, N m, sample by sample; `carries` tells which feet carry a force.
pub(super) fn of(
    walk: &Walk,
    robot: &Legged,
    needed: &[Needed],
    carries: impl Fn(usize, usize) -> bool,
) -> Channels {
    let mut all = Channels::new(robot.joints());
    let mut pose = Pose::default();
    for (n, needed) in needed.iter().enumerate() {
        let carrying: Vec<bool> = (0..robot.feet.len()).map(|foot| carries(n, foot)).collect();
        robot.tree.place(&walk.q[n], &mut pose);
        let down = robot.imu.rotation * walk.down[n];
        // What a newton along each axis at each point of a foot gives each coordinate.
        let points = robot.points(&carrying, 0.0);
        let mut given = DMatrix::zeros(robot.coordinates(), 3 * points.len());
        for (k, point) in points.iter().enumerate() {
            let at = point.place(&pose) + down * point.radius;
            for (c, velocity) in robot.tree.point_velocities(&pose, point.body, at) {
                (0..3).for_each(|axis| given[(c, 3 * k + axis)] = velocity[axis]);
            }
        }
        let by_others = by_others(robot, given, needed);
        let own = needed.force[OF_BASE..].iter().zip(&by_others);
        all.push(
            &own.map(|(force, by_ground)| force - by_ground)
                .collect::<Vec<_>>(),
        );
    }
    all
}

/// What the forces of the ground give each joint by all equations but its own, N m.
fn by_others(robot: &Legged, mut given: DMatrix<f64>, needed: &Needed) -> Vec<f64> {
    let joints = robot.joints();
    let mut wanted = DVector::from_fn(robot.coordinates(), |c, _| match c.checked_sub(OF_BASE) {
        None => needed.force[c],
        Some(joint) => needed.left[joint],
    });
    for (c, scale) in robot.scale.iter().enumerate() {
        given.row_mut(c).scale_mut(*scale);
        wanted[c] *= scale;
    }
    let mut square = given.tr_mul(&given);
    let damping = DAMPING * square.trace() / square.nrows().max(1) as f64;
    (0..square.nrows()).for_each(|k| square[(k, k)] += damping);
    let Some(square) = square.cholesky().filter(|_| given.ncols() > 0) else {
        return vec![0.0; joints];
    };
    let forces = square.solve(&given.tr_mul(&wanted));
    let told = |joint: usize| {
        let row = given.row(OF_BASE + joint).transpose();
        // Without an equation of leverage h its residual is 1/(1 − h) times as large.
        let open = 1.0 - row.dot(&square.solve(&row));
        let (own, fitted) = (wanted[OF_BASE + joint], row.dot(&forces));
        let scale = robot.scale[OF_BASE + joint];
        (own - (own - fitted) / open.max(f64::EPSILON)) / scale
    };
    (0..joints).map(told).collect()
}
