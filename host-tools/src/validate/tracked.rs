//! The loop closed on the simulator, with each model's feed-forward in turn.

use proprio_core::go2::JointId;
use std::sync::Arc;

use proprio_core::go2::JOINTS_PER_LEG as JOINTS;

use super::{Candidate, Feedback, Sums, ValidateError, feedback};
use crate::excite::Feedforward;
use crate::model::Model;
use proprio_simulator::{Followed, Simulation};

/// The feedback torque of `robot` on `motion` with each candidate: the torque that its motors report less the feed-forward.
///
/// Every candidate meets the same robot and the same noise. `robot` says what is true; its own reference is not used.
///
/// # Errors
/// [`ValidateError`].
pub fn tracked(
    robot: &Simulation,
    motion: &Followed,
    candidates: &[Candidate],
    mut progress: impl FnMut(usize, usize),
) -> Result<Vec<Feedback>, ValidateError> {
    let mut all = Vec::new();
    for (n, candidate) in candidates.iter().enumerate() {
        all.push(one(robot, motion, candidate)?);
        progress(n + 1, candidates.len());
    }
    Ok(all)
}

fn one(
    robot: &Simulation,
    motion: &Followed,
    candidate: &Candidate,
) -> Result<Feedback, ValidateError> {
    let forward = with_torque_of(motion, candidate.model.as_ref())?;
    let legs = motion.legs().to_vec();
    let simulation = Simulation {
        legs: legs.clone(),
        duration: motion.duration(),
        follow: Some(Arc::new(forward.clone())),
        ..robot.clone()
    };
    let names = legs.iter().flat_map(|&leg| JointId::of(leg));
    let mut sums: Vec<(String, Sums)> = names
        .map(|joint| (joint.to_string(), Sums::default()))
        .collect();
    for sample in simulation.samples() {
        let sample = sample?;
        for (n, &leg) in legs.iter().enumerate() {
            let given = forward.torque(leg, sample.t).unwrap_or_default();
            let asked = forward.position(leg, sample.t).unwrap_or_default();
            for j in 0..JOINTS {
                let at = JOINTS * n + j;
                let torque = sample.tau[at];
                sums[at]
                    .1
                    .add(sample.t, torque - given[j], torque, asked[j] - sample.q[at]);
            }
        }
    }
    Ok(feedback(candidate, &sums))
}

/// The motion with the feed-forward torque of a model, or none.
fn with_torque_of(motion: &Followed, model: Option<&Model>) -> Result<Followed, ValidateError> {
    let Some(model) = model else {
        return Ok(motion.with_torque(|_, _| [0.0; JOINTS]));
    };
    let mut foresights = Vec::new();
    for limb in model.robot().limbs() {
        let foresight = Feedforward::new(model, &limb)
            .ok_or_else(|| ValidateError::TooLarge(limb.name.clone()))?;
        foresights.push((limb.name, foresight));
    }
    Ok(motion.with_torque(|leg, [q, dq, ddq]| {
        let own = foresights.iter().find(|(name, _)| name == leg.name());
        own.map_or([0.0; JOINTS], |(_, foresight)| {
            let torque = foresight.torque(q, dq, ddq);
            std::array::from_fn(|j| torque[j])
        })
    }))
}
