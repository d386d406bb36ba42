//! The reading of a log in which one body is heavier or lighter than the model's, in all that it is.

use super::reading::{JointReading, Reading};
use super::{FAR_BETTER, Left, MismatchKind, share};
use crate::equation::dot::dot;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use crate::model::Model;
use crate::recording::Recording;

/// A body so many times as heavy as the model's, or as light, is none of a CAD's errors.
const OTHER: f64 = 1.5;

/// What is left with one body another number of times as heavy.
pub(super) fn body(recording: &Recording, model: &Model, as_is: &[Reading]) -> Option<Left> {
    let mut best: Option<Left> = None;
    for (limb, samples) in &recording.limbs {
        let data = LimbData::of(model, limb, samples)?;
        let values = Values::given(model, limb);
        let given = data.predicted(&values, &|_| true);
        for b in 0..limb.bodies.len() {
            let mut twice = values.clone();
            twice.bodies[b].iter_mut().for_each(|x| *x *= 2.0);
            let own = data.predicted(&twice, &|_| true);
            let own: Vec<f64> = own.iter().zip(&given).map(|(x, g)| x - g).collect();
            let part = |joint: &JointReading| of_joint(&data, &own, joint);
            let Some(more) = factor(as_is, &part) else {
                continue;
            };
            if (1.0 / OTHER..=OTHER).contains(&(1.0 + more)) || more <= -1.0 {
                continue;
            }
            let left = share(as_is, &|joint| match part(joint) {
                Some(part) => {
                    let all = joint.predicted.iter().zip(&part);
                    let all: Vec<f64> = all.map(|(p, own)| p + more * own).collect();
                    joint.left_beside(&all)
                }
                None => joint.left(),
            });
            let body = limb.bodies.start + b;
            if best.as_ref().is_none_or(|(least, _)| left < *least) {
                let kind = MismatchKind::Body {
                    link: model.robot().bodies()[body].link_name.clone(),
                    mass: model.inertia(body).mass(),
                    times: 1.0 + more,
                };
                best = Some((left, kind));
            }
        }
    }
    let now = share(as_is, &JointReading::left);
    best.filter(|(left, _)| *left < FAR_BETTER * now)
}

/// A prediction in the windows in which a joint is judged; none of another limb's joint.
fn of_joint(data: &LimbData, predicted: &[f64], joint: &JointReading) -> Option<Vec<f64>> {
    let n = data.joints();
    let j = data
        .joint_names()
        .iter()
        .position(|name| *name == joint.name)?;
    let windows = (0..data.motion.windows.len()).filter(|w| data.counts(*w, j));
    Some(windows.map(|w| predicted[w * n + j]).collect())
}

/// How many times more of a part of the model's torque there is than in the model, friction beside it.
fn factor(as_is: &[Reading], part: &dyn Fn(&JointReading) -> Option<Vec<f64>>) -> Option<f64> {
    let (mut square, mut product) = (0.0, 0.0);
    for joint in as_is.iter().flat_map(|reading| &reading.joints) {
        let Some(part) = part(joint) else { continue };
        let weight = 1.0 / dot(&joint.torque, &joint.torque).max(f64::MIN_POSITIVE);
        let beyond: Vec<f64> = (joint.torque.iter().zip(&joint.predicted))
            .map(|(x, p)| x - p)
            .collect();
        let part = joint.without_friction(&part);
        square += weight * dot(&part, &part);
        product += weight * dot(&part, &joint.without_friction(&beyond));
    }
    (square > 0.0).then_some(product / square)
}
