//! A recording of which only a part is judged: where conditions on the motion hold.

use std::sync::Arc;

use proprio_core::effect::{JointState, STANDING_NOISE};

use super::{LimbRecording, Recording, RecordingError};
use crate::formula::{Condition, FormulaError, Names};
use crate::log::LEAST_DURATION;
use crate::model::{Limb, Model, significant};

/// Why a condition does not say which part of a recording is meant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConditionProblem {
    /// The text is no condition.
    #[error(transparent)]
    Text(#[from] FormulaError),
    /// A joint that the logs do not have.
    #[error("there is no joint `{name}` in these logs; there are {known}")]
    UnknownJoint {
        /// As written.
        name: String,
        /// Those that were recorded.
        known: String,
    },
    /// It is one of a joint's motion, and of no joint.
    #[error("of which joint? Write `{example}`")]
    WhichJoint {
        /// The condition at a joint of the logs.
        example: String,
    },
    /// It holds nowhere, or for too short a time.
    #[error("holds for {} s of {joint}, whose q goes from {} to {} rad and dq from {} to {} rad/s", significant(*.seconds, 2),
        significant(.q[0], 3), significant(.q[1], 3), significant(.dq[0], 3), significant(.dq[1], 3))]
    TooLittle {
        /// The joint.
        joint: String,
        /// How long, s.
        seconds: f64,
        /// Its least and greatest position, rad, and velocity, rad/s.
        q: [f64; 2],
        /// See `q`.
        dq: [f64; 2],
    },
}

impl Recording {
    /// The same of which only the time is judged in which all of `conditions` hold: of a joint's limb where one names a joint
    /// (`FR_calf: q > 1.2`), of all limbs where it is one of time (`t < 31.4`). Signals are `q`, `dq`, `temp` and `t`, with functions as in formulas.
    ///
    /// # Errors
    /// [`RecordingError::Condition`].
    pub fn only(mut self, conditions: &[String], model: &Model) -> Result<Self, RecordingError> {
        for text in conditions {
            self.restrict(text, model)
                .map_err(|problem| RecordingError::Condition {
                    text: text.clone(),
                    problem: Box::new(problem),
                })?;
        }
        self.only.extend_from_slice(conditions);
        Ok(self)
    }

    fn restrict(&mut self, text: &str, model: &Model) -> Result<(), ConditionProblem> {
        let joint_names = |limb: &Limb| -> Vec<&str> {
            let bodies = &model.robot().bodies()[limb.bodies.clone()];
            bodies.iter().map(|body| body.name.as_str()).collect()
        };
        let all = || self.limbs.iter().flat_map(|(limb, _)| joint_names(limb));
        let (joint, condition) = match text.split_once(':') {
            Some((joint, condition)) => (Some(joint.trim()), condition.trim()),
            None => (None, text.trim()),
        };
        if let Some(name) = joint
            && !all().any(|known| known == name)
        {
            return Err(ConditionProblem::UnknownJoint {
                name: name.to_owned(),
                known: all().collect::<Vec<_>>().join(", "),
            });
        }
        let example = all()
            .next()
            .map(|first| format!("{first}: {condition}"))
            .unwrap_or_default();
        for (limb, samples) in &mut self.limbs {
            let joints = joint_names(limb);
            let own = match joint {
                None => 0,
                Some(name) => match joints.iter().position(|known| *known == name) {
                    Some(own) => own,
                    None => continue,
                },
            };
            let names = Names {
                joints: &joints,
                own,
            };
            let condition = Condition::read(condition, names)?;
            if joint.is_none() && !condition.is_of_time() {
                return Err(ConditionProblem::WhichJoint { example });
            }
            let seconds = samples.restrict(&condition, own);
            if seconds < LEAST_DURATION {
                return Err(samples.too_little(joints[own], own, seconds));
            }
            self.warnings.push(format!(
                "{}: judged where `{text}` holds, {} s of {} s",
                limb.name,
                significant(seconds, 3),
                significant(samples.len() as f64 * samples.period(), 3)
            ));
        }
        Ok(())
    }
}

impl LimbRecording {
    /// Leaves out samples in which a condition of joint `own` does not hold. How long it and all before it hold, s.
    fn restrict(&mut self, condition: &Condition, own: usize) -> f64 {
        let n = self.joints;
        let time = self.seconds();
        let mut left_out: Vec<[u64; 2]> = Vec::new();
        let mut left = 0;
        let mut was_out = false;
        for (k, t) in time.iter().enumerate() {
            let state = |j: usize| JointState {
                temperature: self.temperature[k * n + j],
                time: *t,
                speed_noise: STANDING_NOISE,
                ..JointState::reported(self.q[k * n + j], self.dq[k * n + j], 0.0)
            };
            let joints: Vec<_> = (0..n).map(state).collect();
            let us = self.time_us[k];
            let is_out = self.is_left_out([us; 2]) || !condition.holds(&joints, own);
            match left_out.last_mut().filter(|_| is_out && was_out) {
                Some(last) => last[1] = us,
                None if is_out => left_out.push([us; 2]),
                None => left += 1,
            }
            was_out = is_out;
        }
        self.left_out_us = Arc::new(left_out);
        f64::from(left) * self.period()
    }

    /// Whether something between two times, µs, is left out.
    pub(crate) fn is_left_out(&self, [from, to]: [u64; 2]) -> bool {
        let next = self.left_out_us.partition_point(|range| range[1] < from);
        (self.left_out_us.get(next)).is_some_and(|range| range[0] <= to)
    }

    fn too_little(&self, joint: &str, own: usize, seconds: f64) -> ConditionProblem {
        let range = |all: &[f64]| {
            let own = all.iter().skip(own).step_by(self.joints);
            own.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], x| {
                [least.min(*x), most.max(*x)]
            })
        };
        ConditionProblem::TooLittle {
            joint: joint.to_owned(),
            seconds,
            q: range(&self.q),
            dq: range(&self.dq),
        }
    }
}
