//! How many combinations of parameters any poses of a robot can determine, and which parameters given poses leave open.
//!
//! Poses all over the joints' ranges stand for all poses; the rank of their columns is that of the base of identifiable combinations (singular
//! values of the triangle: Khalil & Gautier 1991; Hollerbach, Khalil & Gautier 2016, §6.3).

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use proprio_solve::bounded::triangle;

use super::chain::State;
use super::columns::{Column, rows};
use super::fit::{Fit, Problem};
use super::poses::{Measured, Pose};
use super::start::UNKNOWN_NOISE;
use crate::model::Robot;
use nalgebra::{Matrix3, Vector3};

/// Poses that stand for all; each gives three numbers or six.
const POSES: usize = 60;
/// Singular values below this share of the greatest are rounding.
const RANK: f64 = 1e-9;
/// Turn of a joint without stops that is used, rad to either side.
const FREE_TURN: f64 = std::f64::consts::PI;
/// A parameter is open if its standard deviation is more than this share of its prior's.
pub(super) const OPEN: f64 = 0.9;

/// A position within a joint's stops by a share from 0 to 1.
pub(super) fn position(robot: &Robot, joint: usize, share: f64) -> f64 {
    let [low, high] = robot.bodies()[joint].limits;
    let free = |x: f64, otherwise: f64| if x.is_finite() { x } else { otherwise };
    let [low, high] = [free(low, -FREE_TURN), free(high, FREE_TURN)];
    low + share * (high - low)
}

/// Poses drawn evenly from the joints' ranges, targets as another pose measures them.
pub(super) fn random_poses(
    robot: &Robot,
    joints: &[usize],
    like: &Pose,
    count: usize,
    rng: &mut ChaCha8Rng,
) -> Vec<Pose> {
    let pose = |_| {
        let mut pose = like.clone();
        for &joint in joints {
            pose.q[joint] = position(robot, joint, rng.random::<f64>());
            pose.side[joint] = if rng.random::<bool>() { 1.0 } else { -1.0 };
        }
        pose
    };
    (0..count).map(pose).collect()
}

/// A pose that measures all targets, in place or with orientation too.
pub(super) fn blank_pose(joints: usize, oriented: &[bool]) -> Pose {
    let measured = |&oriented: &bool| {
        Some(Measured {
            place: Vector3::zeros(),
            orientation: oriented.then(Matrix3::identity),
            std: None,
        })
    };
    Pose {
        file: 0,
        place: None,
        q: vec![0.0; joints],
        side: vec![0.0; joints],
        payload: 0.0,
        measured: oriented.iter().map(measured).collect(),
    }
}

/// The rank of columns over all poses of the robot.
pub(super) fn rank(problem: &Problem, robot: &Robot, state: &State, columns: &[Column]) -> usize {
    let oriented = problem.poses.oriented();
    let blank = blank_pose(problem.chain.joints(), &oriented);
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let poses = random_poses(robot, &problem.poses.joints, &blank, POSES, &mut rng);
    let all: Vec<(usize, &Pose)> = poses.iter().enumerate().collect();
    let w = rows(problem.chain, state, &all, columns, UNKNOWN_NOISE).w;
    let values = triangle(w).singular_values();
    let greatest = values.max();
    values
        .iter()
        .filter(|value| **value > RANK * greatest)
        .count()
}

/// The columns of a fit that the data leave open.
pub(super) fn open(fit: &Fit) -> Vec<Column> {
    let std = fit.solved.std_by_scatter(&fit.rows, &fit.held_out);
    let columns = fit.columns.iter().zip(std.iter());
    let open = columns.filter(|(_, std)| **std > OPEN);
    open.map(|(column, _)| *column).collect()
}
