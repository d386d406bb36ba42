//! Readings of the torque by its parts: without gravity, without Coriolis forces, with gravity from elsewhere, in a unit of each joint's own.

use nalgebra::{Matrix3, Vector3};
use proprio_core::tree::GRAVITY;

use super::reading::{JointReading, Reading};
use super::{FAR_BETTER, GOOD, KNOWN_UNIT, MismatchKind, PLAINER, share};
use crate::equation::dot::dot;
use crate::robust;

/// A joint carries weight if gravity gives at least this share of its torque.
const CARRIES: f64 = 0.2;
/// Gravity whose strength is off by more than this share is no attitude of the base.
const STRENGTH: f64 = 0.4;
/// Directions in which gravity moves torques by less than this share of those in which it moves them most keep the model's.
const UNSEEN: f64 = 1e-3;
/// A smaller angle, rad, is a CAD's error or an offset.
const LEAST_ANGLE: f64 = 0.026;
/// A factor of a torque that differs from one by this factor or more at half of the joints is a unit: motors' constants are known better.
const UNIT: f64 = 2.0;
/// A factor is known if it is so many times its standard deviation; residuals of neighbours in time are alike, and count as one in so many.
const KNOWN: f64 = 4.0;
const ALIKE: f64 = 10.0;

fn joints(readings: &[Reading]) -> impl Iterator<Item = &JointReading> {
    readings.iter().flat_map(|reading| &reading.joints)
}

fn minus(x: &[f64], y: &[f64]) -> Vec<f64> {
    x.iter().zip(y).map(|(x, y)| x - y).collect()
}

/// What is left if drives report their torque without gravity, and without Coriolis forces too.
pub(super) fn incomplete(readings: &[Reading]) -> Option<(f64, MismatchKind)> {
    let square = |x: &[f64]| dot(x, x);
    let carries =
        |joint: &JointReading| square(&joint.weight) > CARRIES * CARRIES * square(&joint.torque);
    let weightless = |joint: &JointReading| minus(&joint.predicted, &joint.weight);
    let inertial = |joint: &JointReading| minus(&weightless(joint), &joint.centrifugal);
    let lacks = |joint: &&JointReading| {
        let (now, left) = (joint.left(), joint.left_beside(&weightless(joint)));
        let left = left.min(joint.left_beside(&inertial(joint)));
        carries(joint) && left < GOOD && left < FAR_BETTER * now
    };
    let of = |joint: &JointReading, predicted: Vec<f64>| match lacks(&joint) {
        true => joint.left_beside(&predicted),
        false => joint.left(),
    };
    let names: Vec<String> = (joints(readings).filter(lacks))
        .map(|joint| joint.name.clone())
        .collect();
    let without_gravity = share(readings, &|joint| of(joint, weightless(joint)));
    let without_both = share(readings, &|joint| match names.is_empty() {
        true => joint.left(),
        // Coriolis forces are missing at all joints or at none.
        false => joint.left_beside(&match carries(joint) {
            true => inertial(joint),
            false => minus(&joint.predicted, &joint.centrifugal),
        }),
    });
    let coriolis = without_both < FAR_BETTER * without_gravity;
    let carriers = joints(readings).filter(|joint| carries(joint)).count();
    // One joint may have a counterbalance.
    let all = names.len() == carriers && carriers > 1;
    (!names.is_empty()).then(|| {
        let left = if coriolis {
            without_both
        } else {
            without_gravity
        };
        let joints = if all { Vec::new() } else { names };
        (left, MismatchKind::NoGravity { joints, coriolis })
    })
}

/// What is left if the base is mounted otherwise: gravity in its axes, of any direction.
pub(super) fn orientation(readings: &[Reading]) -> Option<(f64, MismatchKind)> {
    let stated = readings.first()?.gravity;
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for joint in joints(readings) {
        let weight = 1.0 / dot(&joint.torque, &joint.torque).max(f64::MIN_POSITIVE);
        let columns: [Vec<f64>; 3] =
            (joint.by_gravity.each_ref()).map(|column| joint.without_friction(column));
        let beyond = joint.without_friction(&minus(&joint.torque, &joint.predicted));
        for a in 0..3 {
            right[a] += weight * dot(&columns[a], &beyond);
            for b in 0..3 {
                normal[(a, b)] += weight * dot(&columns[a], &columns[b]);
            }
        }
    }
    let svd = normal.svd(true, true);
    let change = svd.solve(&right, UNSEEN * svd.singular_values[0]).ok()?;
    let found = stated + change;
    if ((found.norm() / GRAVITY) - 1.0).abs() > STRENGTH {
        return None;
    }
    let gravity = GRAVITY * found.normalize();
    let angle = gravity.angle(&stated);
    let change = gravity - stated;
    let beside = |joint: &JointReading| joint.left_beside(&turned(joint, &change));
    // What gravity does not load tells nothing of it.
    let loaded = |joint: &&JointReading| {
        let square: f64 = joint.by_gravity.iter().map(|x| dot(x, x)).sum();
        GRAVITY * square.sqrt() > CARRIES * dot(&joint.torque, &joint.torque).sqrt()
    };
    let sum = |of: &dyn Fn(&JointReading) -> f64| -> f64 {
        (joints(readings).filter(loaded))
            .map(|joint| of(joint).min(1.0))
            .sum()
    };
    // Nor do offsets of torques, of which a limb that hardly turns about has as many as gravity has axes.
    let left = sum(&beside);
    let is_better = left < FAR_BETTER * sum(&JointReading::left)
        && left < PLAINER * sum(&JointReading::left_with_offset);
    (angle > LEAST_ANGLE && is_better).then(|| {
        let kind = MismatchKind::Orientation {
            angle,
            rpy: attitude(&gravity),
        };
        (share(readings, &beside), kind)
    })
}

/// The torque that bodies give where gravity is another one by `change`.
fn turned(joint: &JointReading, change: &Vector3<f64>) -> Vec<f64> {
    let more = |w: usize| {
        (0..3)
            .map(|axis| change[axis] * joint.by_gravity[axis][w])
            .sum::<f64>()
    };
    let all = joint.predicted.iter().enumerate();
    all.map(|(w, own)| own + more(w)).collect()
}

/// Roll and pitch of a base in whose axes gravity is `gravity`, as `rpy` of a model file, rad; nothing tells its yaw.
fn attitude(gravity: &Vector3<f64>) -> [f64; 3] {
    let down = gravity.normalize();
    let pitch = down.x.clamp(-1.0, 1.0).asin();
    // `0.0 -` so that level is 0 and not −0.
    [f64::atan2(0.0 - down.y, -down.z), pitch, 0.0]
}

/// What is left with a unit of each joint's own.
pub(super) fn units(readings: &[Reading]) -> Option<(f64, MismatchKind)> {
    let all: Vec<(f64, f64)> = joints(readings).map(factor).collect();
    let other = |(factor, std): &(f64, f64)| {
        let is_known = *factor > KNOWN * std;
        is_known && !(1.0 / UNIT..=UNIT).contains(factor)
    };
    if all.len() < 2 || 2 * all.iter().filter(|f| other(f)).count() < all.len() {
        return None;
    }
    // What is not known is as that of the others.
    let usual = robust::median(all.iter().filter(|f| other(f)).map(|(factor, _)| *factor))?;
    let is_known = |(factor, std): &(f64, f64)| *factor > KNOWN * std;
    let factors: Vec<f64> = (all.iter())
        .map(|of| if is_known(of) { of.0 } else { usual })
        .collect();
    let left = joints(readings).zip(&factors);
    let left: Vec<f64> = left
        .map(|(joint, factor)| joint.left_of(&joint.torque, *factor).min(1.0))
        .collect();
    let told = joints(readings).zip(&all);
    let told: Vec<(String, Option<f64>)> = told
        .map(|(joint, of)| (joint.name.clone(), is_known(of).then_some(of.0)))
        .collect();
    let mean = left.iter().sum::<f64>() / left.len() as f64;
    let (low, high) = factors.iter().fold((f64::INFINITY, 0.0), |(low, high), f| {
        (f.min(low), f.max(high))
    });
    // What all joints agree on is one unit.
    (high / low > KNOWN_UNIT).then_some((mean, MismatchKind::Units(told)))
}

/// By how much the model's torque is multiplied at a joint, friction beside it, and its standard deviation.
fn factor(joint: &JointReading) -> (f64, f64) {
    let model = joint.without_friction(&joint.predicted);
    let torque = joint.without_friction(&joint.torque);
    let square = dot(&model, &model).max(f64::MIN_POSITIVE);
    let factor = dot(&model, &torque) / square;
    let left: f64 = (model.iter().zip(&torque))
        .map(|(m, t)| (t - factor * m).powi(2))
        .sum();
    let count = (torque.len() as f64 / ALIKE).max(1.0);
    (factor, (left / count / square).sqrt())
}
