//! What a URDF leaves out of bodies that move: CAD exports have links without mass between joints, and points of mass at tips.
//!
//! Estimation needs bodies that could exist, a prior about each and its logarithm. So a frame that carries others, without mass
//! or shape, becomes a speck beside them, and a point of mass becomes a ball of water of that mass. Either changes torques by
//! less than what the CAD is uncertain by. Moments of inertia of which the greatest exceeds the sum of the others belong to no body
//! (the triangle inequality; Wensing, Kim & Slotine 2018, §III): the nearest possible ones are taken, as simulators do when they
//! load such a file. Which bodies all this concerns is told. A shape without mass, and a negative moment about an axis, are other
//! matters: they stay errors.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector3};
use proprio_core::inertia::InertialParameters;

use crate::model::{Robot, about_com, other_unit, significant};

/// Mass of a speck, of the mass of the lightest body of the robot that has any.
const SPECK: f64 = 1e-3;

/// Density of a ball, kg/m³: that of water, between aluminium parts and their hollows.
const DENSITY: f64 = 1000.0;

/// Moments of inertia about the centre of mass below this, of those of a ball, are none.
const NONE: f64 = 1e-6;

/// Least second moment of mass along an axis, of the greatest: a body a tenth as thin as long.
const MARGIN: f64 = 0.01;

/// The robot with what its bodies lack; `shapes` tells which have one.
pub(super) fn robot(robot: Robot, shapes: &[bool]) -> Robot {
    let masses = robot.bodies().iter().map(|body| body.inertia.mass());
    let lightest = masses
        .filter(|mass| *mass > 0.0)
        .fold(f64::INFINITY, f64::min);
    let mut completed = Vec::new();
    let mut notes = Vec::new();
    for (b, body) in robot.bodies().iter().enumerate() {
        if let Some([mass, radius]) = other_unit(&body.inertia) {
            notes.push(format!(
                "link {} has the moments of inertia of {mass} kg at {} m: state them in kg m², not in g mm² or kg mm²",
                body.link_name,
                significant(radius, 2)
            ));
        }
        let (mass, com, inertia) = about_com(&body.inertia);
        let is_frame = !shapes[b] && body.inertia.0.iter().all(|x| *x == 0.0);
        if is_frame && lightest.is_finite() {
            let mass = SPECK * lightest;
            completed.push((b, ball(mass, Vector3::zeros())));
            let name = &body.link_name;
            notes.push(format!(
                "link {name} has no mass: it is taken for a speck of {mass:.1e} kg"
            ));
        } else if mass > 0.0 && inertia.abs().max() < NONE * ball_moment(mass) {
            completed.push((b, ball(mass, com)));
            let name = &body.link_name;
            notes.push(format!(
                "link {name} has no moments of inertia: it is taken for a ball of {mass} kg"
            ));
        } else if mass > 0.0
            && !body.inertia.is_physical()
            && let Some(inertia) = nearest(&inertia)
        {
            completed.push((b, InertialParameters::from_com(mass, com, inertia)));
            let name = &body.link_name;
            notes.push(format!(
                "link {name} has moments of inertia that no body has: the nearest that one could have are taken"
            ));
        }
    }
    robot.completed(completed, notes)
}

/// The nearest inertia about the centre of mass that a body could have; none if a moment about an axis is not positive, which is
/// no rounding of anything.
///
/// With Σ = ½ tr(I) 1 − I, the second moments of mass, a body exists exactly if Σ is positive definite; the nearest in the
/// Frobenius norm of Σ has the same axes and no eigenvalue below a bound.
fn nearest(inertia: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    if !inertia.iter().all(|x| x.is_finite()) || inertia.diagonal().min() <= 0.0 {
        return None;
    }
    let half_trace = |matrix: &Matrix3<f64>| Matrix3::identity() * (0.5 * matrix.trace());
    let eigen = (half_trace(inertia) - inertia).symmetric_eigen();
    let bound = MARGIN * eigen.eigenvalues.max();
    let moments = eigen.eigenvalues.map(|moment| moment.max(bound));
    let axes = eigen.eigenvectors;
    let second = axes * Matrix3::from_diagonal(&moments) * axes.transpose();
    // tr(Σ) = ½ tr(I).
    Some(Matrix3::identity() * second.trace() - second)
}

/// A solid ball about `com`.
fn ball(mass: f64, com: Vector3<f64>) -> InertialParameters<f64> {
    InertialParameters::from_com(mass, com, Matrix3::identity() * ball_moment(mass))
}

/// 2/5 m r², kg m².
fn ball_moment(mass: f64) -> f64 {
    let radius = (3.0 * mass / (4.0 * PI * DENSITY)).cbrt();
    0.4 * mass * radius * radius
}
