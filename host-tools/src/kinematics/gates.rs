//! What is wrong with poses before a model is blamed: each cause is tested by what it does to the error of the best mount.

use super::chain::{Chain, State};
use super::error::CalibrateError;
use super::poses::{Pose, Poses};
use super::start;
use crate::model::Model;
use crate::robust::median;

/// A mount's error beyond this share of how far the targets move asks for a cause: uncalibrated robots miss by less than 1 % of their reach
/// (Mooring, Roth & Driels 1991), a wrong column by more than a tenth.
const SUSPICIOUS: f64 = 0.05;
/// A cause is named if it makes the error this many times smaller.
const EXPLAINS: f64 = 4.0;
/// Two causes whose errors differ by less than this factor explain the poses alike: the errors are frames' and noise's, which one of them does not change.
const SAME_ERROR: f64 = 1.5;
/// An error beyond this share that no cause explains: the poses are of something else.
const UNRELATED: f64 = 0.25;
/// Joints of which all orders are tried, 720 of them; of more each exchange of two.
const ALL_ORDERS: usize = 6;
/// Joints of which all combinations of signs are tried.
const ALL_SIGNS: usize = 8;
/// Two targets nearer than this in all poses, m, are the same numbers.
const SAME: f64 = 1e-9;
/// A place is no measurement of this robot if it is farther from the middle of all places than so many times the links' lengths and the
/// median distance together. Two places of a target are within twice its greatest distance from the base, which is the links' lengths and what
/// holds the target; three leaves half as much again for that. Places in mm are far apart all alike, and stay for the test of units.
const FAR: f64 = 3.0;
/// Joint positions nearer than this, rad or m, are the same: encoders' noise and a brake's play are below.
const SAME_POSITION: f64 = 1e-4;
/// Units that lengths come in, and how many m they are.
const UNITS: [(&str, f64); 3] = [("mm", 1e-3), ("cm", 1e-2), ("inches", 0.0254)];

/// Refuses what cannot be; else where mount and targets are, and the error of that, m.
pub(super) fn check(
    chain: &Chain,
    state: &State,
    poses: &Poses,
    model: &Model,
) -> Result<(State, f64), CalibrateError> {
    same_targets(poses)?;
    far_places(chain, state, poses)?;
    still_targets(chain, state, poses)?;
    let all: Vec<(usize, &Pose)> = poses.poses.iter().enumerate().collect();
    let (started, error) = start::fit(chain, state, &all);
    let spread = spread(poses);
    if error <= SUSPICIOUS * spread {
        return Ok((started, error));
    }
    let error_of = |changed: &[Pose]| {
        let all: Vec<(usize, &Pose)> = changed.iter().enumerate().collect();
        start::fit(chain, state, &all).1
    };
    for (unit, factor) in UNITS {
        let after = error_of(&scaled(poses, factor));
        // In the file's unit the error itself is as much smaller.
        if after < factor * error / EXPLAINS {
            return Err(CalibrateError::LengthUnit {
                unit,
                factor,
                before: error,
                after,
            });
        }
    }
    let mm = |m: f64| 1e3 * m;
    let degrees = map_joints(poses, |q, joint| {
        if chain.slides(joint) {
            q
        } else {
            q.to_radians()
        }
    });
    let after = error_of(&degrees);
    if after < error / EXPLAINS {
        return Err(CalibrateError::Degrees {
            before: mm(error),
            after: mm(after),
        });
    }
    let joints = best_order(poses, model, &error_of).filter(|(_, after)| *after < error / EXPLAINS);
    let mirrored = error_of(&mirrored(poses));
    // An arm that its own plane mirrors fits both ways, with some joints the other way: then both are named.
    let as_good = |(_, after): &(String, f64)| mirrored <= SAME_ERROR * after;
    if mirrored < error / EXPLAINS && joints.as_ref().is_none_or(as_good) {
        let or = |(what, _)| format!("; alike: {what}");
        return Err(CalibrateError::Mirrored {
            alike: joints.map_or_else(String::new, or),
            before: mm(error),
            after: mm(mirrored),
        });
    }
    if let Some((what, after)) = joints {
        return Err(CalibrateError::JointOrder {
            what,
            before: mm(error),
            after: mm(after),
        });
    }
    let carrying = (state.targets.iter()).flat_map(|target| chain.path(target.body));
    let mut constant =
        carrying.filter(|joint| poses.joints.contains(joint) && !moves(poses, *joint));
    if let Some(joint) = constant.next() {
        return Err(CalibrateError::ConstantJoint {
            joint: model.joint_name(joint).to_owned(),
            q: poses.poses[0].q[joint],
            error: mm(error),
            spread: mm(spread),
        });
    }
    if error > UNRELATED * spread {
        return Err(CalibrateError::Unrelated {
            error: mm(error),
            spread: mm(spread),
        });
    }
    Ok((started, error))
}

/// Refuses poses of fewer than `needed` different joint positions.
pub(super) fn different(poses: &Poses, needed: usize) -> Result<(), CalibrateError> {
    let mut found: Vec<&Pose> = Vec::with_capacity(needed);
    for pose in &poses.poses {
        let is_new = found
            .iter()
            .all(|other| (pose.q.iter().zip(&other.q)).any(|(a, b)| (a - b).abs() > SAME_POSITION));
        if is_new {
            found.push(pose);
        }
        if found.len() == needed {
            return Ok(());
        }
    }
    Err(CalibrateError::SamePoses {
        poses: poses.count(),
        different: found.len(),
        needed,
    })
}

/// Whether a joint's recorded position changes from pose to pose.
fn moves(poses: &Poses, joint: usize) -> bool {
    let mut all = poses.poses.iter().map(|pose| pose.q[joint]);
    let first = all.next().unwrap_or(0.0);
    all.any(|q| (q - first).abs() > SAME_POSITION)
}

/// Refuses places out of the robot's reach: one alone would rule every fit.
fn far_places(chain: &Chain, state: &State, poses: &Poses) -> Result<(), CalibrateError> {
    for (t, name) in poses.targets.iter().enumerate() {
        let places = || {
            let all = poses.poses.iter().enumerate();
            all.filter_map(|(n, pose)| Some((n, pose.measured[t].as_ref()?.place)))
        };
        let middle = |axis: usize| median(places().map(|(_, place)| place[axis])).unwrap_or(0.0);
        let middle = nalgebra::Vector3::from([0, 1, 2].map(middle));
        // The largest coordinate bounds the distance and cannot overflow.
        let distance = |place: nalgebra::Vector3<f64>| (place - middle).amax();
        let half = median(places().map(|(_, place)| distance(place))).unwrap_or(0.0);
        let body = state.targets[t].body;
        let slides = chain
            .path(body)
            .into_iter()
            .filter(|&joint| chain.slides(joint));
        let farthest = |joint: usize| {
            (poses.poses.iter()).fold(0.0, |most: f64, pose| most.max(pose.q[joint].abs()))
        };
        let reach = chain.reach(body) + slides.map(farthest).sum::<f64>();
        // Where half of the places are out of reach, all are in another unit, which is looked for by fits.
        if half > FAR * reach {
            continue;
        }
        let is_far =
            |(_, place): &(usize, nalgebra::Vector3<f64>)| distance(*place) > FAR * (reach + half);
        let mut far = places().filter(is_far);
        let Some((pose, place)) = far.next() else {
            continue;
        };
        return Err(CalibrateError::FarPlace {
            pose: poses.called(pose),
            target: name.clone(),
            distance: distance(place),
            half,
            reach,
            more: match far.count() {
                0 => String::new(),
                n => format!("; {n} further places are as far"),
            },
        });
    }
    Ok(())
}

/// Refuses a target whose place does not change though joints that carry it move.
fn still_targets(chain: &Chain, state: &State, poses: &Poses) -> Result<(), CalibrateError> {
    for (t, name) in poses.targets.iter().enumerate() {
        let mut places =
            (poses.poses.iter()).filter_map(|pose| Some(pose.measured[t].as_ref()?.place));
        let Some(first) = places.next() else {
            continue;
        };
        let rest: Vec<_> = places.collect();
        let path = chain.path(state.targets[t].body);
        let carried = path.iter().any(|&joint| moves(poses, joint));
        if carried && !rest.is_empty() && rest.iter().all(|place| (place - first).norm() < SAME) {
            return Err(CalibrateError::StillTarget {
                target: name.clone(),
                poses: rest.len() + 1,
            });
        }
    }
    Ok(())
}

fn same_targets(poses: &Poses) -> Result<(), CalibrateError> {
    for second in 1..poses.targets.len() {
        for first in 0..second {
            let both = poses.poses.iter().filter_map(|pose| {
                let [a, b] = [first, second].map(|t| pose.measured[t].as_ref());
                Some((a?.place - b?.place).norm())
            });
            let both: Vec<f64> = both.collect();
            if !both.is_empty() && both.iter().all(|distance| *distance < SAME) {
                return Err(CalibrateError::SameTargets {
                    first: poses.targets[first].clone(),
                    second: poses.targets[second].clone(),
                    poses: both.len(),
                });
            }
        }
    }
    Ok(())
}

/// Root mean square of the measured places about their mean, m.
fn spread(poses: &Poses) -> f64 {
    let places: Vec<_> = poses
        .poses
        .iter()
        .flat_map(|pose| pose.measured.iter().flatten().map(|m| m.place))
        .collect();
    let count = places.len().max(1) as f64;
    let mean = places.iter().sum::<nalgebra::Vector3<f64>>() / count;
    let squares: f64 = places
        .iter()
        .map(|place| (place - mean).norm_squared())
        .sum();
    (squares / count).sqrt()
}

/// The poses with lengths times a factor.
fn scaled(poses: &Poses, factor: f64) -> Vec<Pose> {
    let mut changed = poses.poses.clone();
    for measured in changed
        .iter_mut()
        .flat_map(|pose| pose.measured.iter_mut().flatten())
    {
        measured.place *= factor;
    }
    changed
}

/// The places seen in a mirror: what two exchanged coordinates are, or one of the opposite sign, but for a turn. Orientations have no mirror image that is a
/// rotation, and are left out.
fn mirrored(poses: &Poses) -> Vec<Pose> {
    let mut changed = poses.poses.clone();
    for measured in (changed.iter_mut()).flat_map(|pose| pose.measured.iter_mut().flatten()) {
        measured.place.x = -measured.place.x;
        measured.orientation = None;
    }
    changed
}

/// The poses with recorded positions changed.
fn map_joints(poses: &Poses, change: impl Fn(f64, usize) -> f64) -> Vec<Pose> {
    let mut changed = poses.poses.clone();
    for pose in &mut changed {
        for &joint in &poses.joints {
            pose.q[joint] = change(pose.q[joint], joint);
        }
    }
    changed
}

/// The order or the signs of joints that fit best, in words, and their error.
fn best_order(
    poses: &Poses,
    model: &Model,
    error_of: &impl Fn(&[Pose]) -> f64,
) -> Option<(String, f64)> {
    let joints = &poses.joints;
    let ordered = |order: &[usize]| {
        let mut changed = poses.poses.clone();
        for (pose, was) in changed.iter_mut().zip(&poses.poses) {
            for (&to, &from) in joints.iter().zip(order) {
                pose.q[to] = was.q[from];
            }
        }
        error_of(&changed)
    };
    let best = orders(joints)
        .into_iter()
        .map(|order| (ordered(&order), order))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let name = |joint: usize| model.joint_name(joint);
    let by_order = best.map(|(error, order)| {
        let moved = joints.iter().zip(&order).filter(|(to, from)| to != from);
        let words = moved.map(|(&to, &from)| format!("{} holds {}", name(from), name(to)));
        (words.collect::<Vec<_>>().join(", "), error)
    });
    let signed = |signs: usize| {
        map_joints(poses, |q, joint| {
            let place = joints.iter().position(|j| *j == joint).unwrap_or(0);
            if signs >> place & 1 == 1 { -q } else { q }
        })
    };
    let signs: Vec<usize> = if joints.len() <= ALL_SIGNS {
        (1..1 << joints.len()).collect()
    } else {
        (0..joints.len().min(63)).map(|place| 1 << place).collect()
    };
    let by_sign = signs
        .into_iter()
        .map(|signs| (error_of(&signed(signs)), signs))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(error, signs)| {
            let turned = (0..joints.len()).filter(|place| signs >> place & 1 == 1);
            let names: Vec<&str> = turned.map(|place| name(joints[place])).collect();
            (
                format!("{} with the opposite sign", names.join(", ")),
                error,
            )
        });
    by_order
        .into_iter()
        .chain(by_sign)
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Orders of joints other than their own: all of few, of many each exchange of two and the reverse.
fn orders(joints: &[usize]) -> Vec<Vec<usize>> {
    let mut orders = Vec::new();
    if joints.len() <= ALL_ORDERS {
        permute(&mut joints.to_vec(), 0, &mut orders);
    } else {
        for a in 0..joints.len() {
            for b in 0..a {
                let mut order = joints.to_vec();
                order.swap(a, b);
                orders.push(order);
            }
        }
        orders.push(joints.iter().rev().copied().collect());
    }
    orders.retain(|order| order != joints);
    orders
}

fn permute(order: &mut Vec<usize>, from: usize, found: &mut Vec<Vec<usize>>) {
    if from == order.len() {
        found.push(order.clone());
        return;
    }
    for k in from..order.len() {
        order.swap(from, k);
        permute(order, from + 1, found);
        order.swap(from, k);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_orders_of_few_joints_are_tried_and_never_their_own() {
        assert_eq!(orders(&[4, 7, 9]).len(), 5);
        assert_eq!(orders(&[0, 1, 2, 3, 4, 5]).len(), 719);
        assert_eq!(orders(&[0, 1, 2, 3, 4, 5, 6]).len(), 22);
    }
}
