//! What a search has found, as data: the ladder, candidates, values, errors by pose and joint.

use nalgebra::Vector3;

use super::applied::along_frame;
use super::chain::{State, inverse, point};
use super::columns::{Unknown, rows};
use super::fit::{Fit, Problem};
use super::held_out::place_rms;
use super::result::{
    Alternative, Calibration, Candidate, JointShare, Outlier, PoseError, Step, Value,
};
use super::search::{self, Found};
use super::{facts, identifiable, start};
use crate::model::{JointQuantity as Q, Model};

/// A value within so many standard deviations of nothing is not identified.
const PRESENT: f64 = 2.0;
/// A value whose standard deviation is more than this share of its prior's is hardly better known than before.
pub(super) const HARDLY: f64 = 0.5;

/// What an unknown is called.
pub(super) fn name(problem: &Problem, model: &Model, unknown: Unknown) -> String {
    const AXES: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];
    let joint = |joint: usize| model.joint_name(joint);
    match unknown {
        Unknown::Mount(k) => format!("{}:mount", AXES[k]),
        Unknown::Target(t, k) => format!("{}:tool:{}", AXES[k], problem.poses.targets[t]),
        Unknown::Turn(j, 0) => format!("joint_offset:{}", joint(j)),
        Unknown::Shift(j, n) => format!("shift_{n}:link_geometry:{}", joint(j)),
        Unknown::Turn(j, n) => format!("turn_{n}:link_geometry:{}", joint(j)),
        Unknown::Joint(j, quantity) => {
            format!("{}:{}:{}", quantity.key(), owner(quantity), joint(j))
        }
    }
}

/// The fact that a quantity belongs to.
pub(super) fn owner(quantity: Q) -> &'static str {
    let found = facts::EFFECTS
        .iter()
        .find(|fact| fact.quantities.contains(&quantity));
    found.map_or(facts::LINK_GEOMETRY.name, |fact| fact.name)
}

/// What was found, as data.
pub(super) fn report(
    problem: &Problem,
    model: &Model,
    found: &Found,
    given: Option<f64>,
    warnings: Vec<String>,
) -> Calibration {
    let names = |joints: &[usize]| -> Vec<String> {
        joints
            .iter()
            .map(|&joint| model.joint_name(joint).to_owned())
            .collect()
    };
    let fit = &found.fit;
    let mut path: Vec<Step> = given
        .iter()
        .map(|error| Step {
            step: "as_given",
            effect: None,
            joints: Vec::new(),
            error: 1e3 * error,
        })
        .collect();
    path.extend(found.path.iter().map(|rung| Step {
        step: if rung.step == "mount" { "mount" } else { "add" },
        effect: (rung.step != "mount").then_some(rung.step),
        joints: names(&rung.joints),
        error: rung.error,
    }));
    let mut judged: Vec<&search::Judged> = found.judged.iter().collect();
    judged.sort_by(|a, b| {
        (b.taken, b.z)
            .partial_cmp(&(a.taken, a.z))
            .unwrap_or(std::cmp::Ordering::Equal)
    });
    let error_before = |judged: &search::Judged| {
        let at = found.path.iter().position(|rung| {
            judged.taken && rung.step == judged.fact.name && rung.joints == judged.joints
        });
        match at {
            Some(at) if at > 0 => found.path[at - 1].error,
            _ => found.path.last().map_or(f64::NAN, |rung| rung.error),
        }
    };
    let candidates = judged.into_iter().map(|judged| Candidate {
        effect: judged.fact.name,
        joints: names(&judged.joints),
        held_out_gain: error_before(judged) - judged.error,
        z: judged.z,
        taken: judged.taken,
        alternatives: (judged.alternatives.iter())
            .map(|(effect, joints)| Alternative {
                effect,
                joints: names(joints),
            })
            .collect(),
    });
    let first = problem.fit_fixtures(&fit.state_without_joints(model));
    Calibration {
        verdict: if found.path.len() > 1 {
            "missing"
        } else {
            "complete"
        },
        poses: found.used.len(),
        numbers: fit.rows.b.len(),
        unknowns: fit.columns.len(),
        identifiable: identifiable::rank(problem, model.robot(), &fit.state, &fit.columns),
        turn_error: fit.turn_mrad(),
        noise: 1e3 * fit.noise.place,
        path,
        candidates: candidates.collect(),
        parameters: values(problem, model, fit),
        by_pose: by_pose(problem, &first, fit),
        by_joint: by_joint(problem, model, fit),
        outliers: (found.outliers.iter())
            .map(|(pose, error)| Outlier {
                pose: problem.poses.called(*pose),
                error: *error,
            })
            .collect(),
        witnesses: Vec::new(),
        warnings,
        model: model.clone(),
    }
}

impl Fit {
    /// Where the fit stands, with nothing of the joints corrected.
    fn state_without_joints(&self, model: &Model) -> State {
        State {
            mount: self.state.mount,
            ..State::nominal(model, self.state.targets.clone())
        }
    }
}

fn values(problem: &Problem, model: &Model, fit: &Fit) -> Vec<Value> {
    let chain = problem.chain;
    let all = fit.values(chain);
    let status = |value: f64, std: f64, prior: f64| {
        if std > identifiable::OPEN * prior {
            "unexcited"
        } else if std > HARDLY * prior || value.abs() < PRESENT * std {
            "prior"
        } else {
            "identified"
        }
    };
    let mut values = Vec::new();
    for joint in 0..chain.joints() {
        for quantity in Q::ALL {
            let own = all
                .iter()
                .find(|(c, ..)| c.unknown == Unknown::Joint(joint, quantity));
            let own = own.map(|(column, value, std)| (*value, *std, column.prior));
            let known = own.or_else(|| along_frame(chain, &all, joint, quantity, &fit.state));
            let Some((value, std, prior_std)) = known else {
                continue;
            };
            values.push(Value {
                name: format!(
                    "{}:{}:{}",
                    quantity.key(),
                    owner(quantity),
                    model.joint_name(joint)
                ),
                unit: quantity.unit(chain.slides(joint)),
                value,
                std,
                prior_std,
                status: status(value, std, prior_std),
            });
        }
    }
    values
}

/// Errors by pose in the base's frame.
pub(super) fn by_pose(problem: &Problem, before: &Fit, after: &Fit) -> Vec<PoseError> {
    let mut errors = Vec::new();
    let vector = |fit: &Fit, row: usize| {
        let error = Vector3::from_fn(|k, _| 1e3 * fit.held_out[row + k] * fit.rows.unit[row + k]);
        fit.state.mount.rotation.tr_mul(&error)
    };
    for ((pose, range), (_, other)) in after.rows.poses.iter().zip(&before.rows.poses) {
        let mut row = range.start;
        while row < range.end {
            let target = after.rows.target[row];
            let measured = problem.poses.poses[*pose].measured[target].as_ref();
            let oriented = measured.is_some_and(|m| m.orientation.is_some());
            let [was, is] = [
                vector(before, other.start + row - range.start),
                vector(after, row),
            ];
            let place = measured.map_or_else(Vector3::zeros, |m| m.place);
            errors.push(PoseError {
                pose: problem.poses.called(*pose),
                target: problem.poses.targets[target].clone(),
                before: was.norm(),
                after: is.norm(),
                place: point(&inverse(&after.state.mount), &place).into(),
                before_vector: was.into(),
                after_vector: is.into(),
            });
            row += if oriented { 6 } else { 3 };
        }
    }
    errors
}

/// By how much each joint's corrections move the targets, beside the mount and the targets where they are.
fn by_joint(problem: &Problem, model: &Model, fit: &Fit) -> Vec<JointShare> {
    let used = problem.used();
    let places = |state: &State| rows(problem.chain, state, &used, &[], start::UNKNOWN_NOISE);
    let whole = places(&fit.state);
    (0..problem.chain.joints())
        .filter(|&joint| fit.state.joints[joint].iter().any(|x| *x != 0.0))
        .map(|joint| {
            let mut without = fit.state.clone();
            without.joints[joint].fill(0.0);
            let difference = places(&without).b - &whole.b;
            JointShare {
                joint: model.joint_name(joint).to_owned(),
                moves: 1e3 * place_rms(&whole, &difference),
            }
        })
        .collect()
}
