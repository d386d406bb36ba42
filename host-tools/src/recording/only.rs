//! A recording of which only a part is judged: where conditions on the motion hold.

use std::path::PathBuf;
use std::sync::Arc;

use proprio_core::effect::{JointState, STANDING_NOISE};

use super::{LimbRecording, Recording, RecordingError, Slab};
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

    /// Reads of logs the part that `conditions` ask for: [`read`](Self::read), then [`only`](Self::only). Where they name a time, a long log is thinned in
    /// that time alone.
    ///
    /// # Errors
    /// Those of the two.
    pub fn read_only(
        logs: &[PathBuf],
        conditions: &[String],
        model: &Model,
        progress: impl FnMut(u64, u64),
    ) -> Result<Self, RecordingError> {
        Self::read_part(logs, conditions, (model, false), progress)
    }

    /// The same with what the drives were asked to do.
    ///
    /// # Errors
    /// Those of [`read_only`](Self::read_only).
    pub fn read_commanded(
        logs: &[PathBuf],
        conditions: &[String],
        model: &Model,
        progress: impl FnMut(u64, u64),
    ) -> Result<Self, RecordingError> {
        Self::read_part(logs, conditions, (model, true), progress)
    }

    fn read_part(
        logs: &[PathBuf],
        conditions: &[String],
        (model, commanded): (&Model, bool),
        progress: impl FnMut(u64, u64),
    ) -> Result<Self, RecordingError> {
        // What is no condition of time is judged, or refused, once the logs are read.
        let names = Names {
            joints: &[""],
            own: 0,
        };
        let of_time = |text: &String| {
            Condition::read(text.trim(), names)
                .ok()
                .filter(Condition::is_of_time)
        };
        let near = conditions.iter().filter_map(of_time).collect();
        Self::read_near(logs, model, (near, commanded), progress)?.only(conditions, model)
    }

    fn restrict(&mut self, text: &str, model: &Model) -> Result<(), ConditionProblem> {
        let duration = self.duration;
        for Restricted {
            limb,
            joint,
            own,
            seconds,
        } in restrict(&mut self.limbs, text, model)?
        {
            let (limb, samples) = &self.limbs[limb];
            if seconds < LEAST_DURATION {
                return Err(samples.too_little(&joint, own, seconds));
            }
            self.warnings.push(format!(
                "{}: judged where `{text}` holds, {} s of {} s",
                limb.name,
                significant(seconds, 3),
                significant(duration, 3)
            ));
        }
        Ok(())
    }
}

impl Slab {
    /// The same of which only the time is judged in which all of `conditions` hold, which a recording of its log has obeyed already.
    pub(crate) fn only(mut self, conditions: &[String], model: &Model) -> Self {
        for text in conditions {
            // A condition that can be read once can be read again; a limb that this part of the log lacks is judged nowhere.
            let _ = restrict(&mut self.limbs, text, model);
        }
        self
    }
}

/// How long a condition of a joint holds.
struct Restricted {
    /// The limb's place.
    limb: usize,
    joint: String,
    /// The joint's place in its limb.
    own: usize,
    /// s.
    seconds: f64,
}

/// Leaves out of limbs what a condition does not hold in.
fn restrict(
    limbs: &mut [(Limb, LimbRecording)],
    text: &str,
    model: &Model,
) -> Result<Vec<Restricted>, ConditionProblem> {
    let joint_names = |limb: &Limb| -> Vec<&str> {
        let bodies = &model.robot().bodies()[limb.bodies.clone()];
        bodies.iter().map(|body| body.name.as_str()).collect()
    };
    let all = || limbs.iter().flat_map(|(limb, _)| joint_names(limb));
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
    let mut restricted = Vec::new();
    for (place, (limb, samples)) in limbs.iter_mut().enumerate() {
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
        restricted.push(Restricted {
            limb: place,
            joint: joints[own].to_owned(),
            own,
            seconds: samples.restrict(&condition, own),
        });
    }
    Ok(restricted)
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
