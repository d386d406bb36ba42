//! A limb's model run forward: from a measured state, under the torque that the motors reported, to where the model would be.
//!
//! What a simulator or a policy sees of a model's error is not a torque but a motion that drifts. A *rollout* starts at a sample with the
//! measured position and velocity and takes nothing but the torque from the log until its end.
//!
//! Files beside:
//!
//! - `drive`: the torque that the motors gave, by the one that they reported (scale, delay, lag, dead band, limit)
//! - `plant`: the bodies and effects that it moves, by small steps
//! - `friction`: what a step's dry friction does, stiction included
//!
//! Gears are rigid: a link that moves against its motor has a state of its own, which no sample measures ([`is_included`]).

mod drive;
mod friction;
mod plant;
#[cfg(test)]
mod tests;

use proprio_core::effect::{EffectKind, Form, Moved};

use crate::equation::encoder::Encoder;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
use plant::{Instant, Plant, State};

/// Longest step, s.
// Halving it moves no joint of a simulated leg with dry friction by more than 5e-5 rad after 0.1 s, where a Go2's sensor noise makes 5e-4.
const STEP: f64 = 1e-3;
/// Parts of a step in which a joint stops or turns: friction changes its sign at a moment within. Without them true models are off by 2.6e-4 rad
/// after 0.1 s, with them by 7e-5.
const FINE: usize = 16;

/// Whether a rollout has an effect: rigid gears have no backlash and no elasticity, and a force of the ground is not known.
pub(crate) fn is_included(effect: EffectKind) -> bool {
    !matches!(
        effect.description().form,
        Form::Motion(Moved::Link(_)) | Form::Force
    )
}

/// The samples of a rollout.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    /// The first, from which it starts, and the last.
    pub(crate) samples: [usize; 2],
    /// The fold of time that it lies in.
    fold: usize,
}

/// The rollouts of this length (s) that a limb's recording has room for, one after the other: without a gap and without a window that is left
/// out; `in_one_fold`, none that two folds have parts of.
pub(crate) fn spans(data: &LimbData, seconds: f64, in_one_fold: bool) -> Vec<Span> {
    let (motion, mut spans) = (&data.motion, Vec::new());
    for stretch in &motion.stretches {
        let mut first = stretch.start;
        for last in stretch.clone() {
            // Sample times are whole microseconds.
            if motion.time[last] - motion.time[first] < seconds - 1e-7 {
                continue;
            }
            spans.extend(span(data, [first, last], in_one_fold));
            first = last;
        }
    }
    spans
}

fn span(data: &LimbData, [first, last]: [usize; 2], in_one_fold: bool) -> Option<Span> {
    let windows = &data.motion.windows;
    let begin = windows.partition_point(|w| w.samples[1] <= first);
    let end = windows.partition_point(|w| w.samples[0] < last);
    let mut own = begin..end.max(begin);
    let fold = data.fold(own.clone().next()?);
    let is_whole = own.all(|w| !data.left_out[w] && (!in_one_fold || data.fold(w) == fold))
        && !data
            .recording
            .is_left_out([first, last].map(|k| data.recording.time_us[k]));
    is_whole.then_some(Span {
        samples: [first, last],
        fold,
    })
}

/// A limb under a model, or under one for each fold.
pub(crate) struct Rollouts<'a> {
    data: &'a LimbData<'a>,
    models: Vec<Own>,
}

/// A model, and what it makes of the recording.
struct Own {
    plant: Plant,
    /// The motors' torque at each sample, joint by joint, N m.
    torque: Vec<f64>,
    encoders: Vec<Encoder>,
    /// Of joints with bristles, how far they are bent at each sample by the measured motion, of their most.
    bent: Vec<Vec<f64>>,
}

impl<'a> Rollouts<'a> {
    /// Under one model, or under that of each fold.
    pub(crate) fn of(data: &'a LimbData, values: &[Values]) -> Self {
        let own = |values: &Values| {
            let effects = data.contributions(values);
            let plant = Plant::of(data, values, &effects);
            let bent = |(j, displacement): (usize, &Option<f64>)| match displacement {
                Some(zs) => {
                    let ways = data.motion.ways(&data.motion.joint[j]);
                    let bent = |way: &crate::equation::presliding::Way| {
                        way.bristles(*zs).map(|[_, bent]| bent).collect::<Vec<_>>()
                    };
                    ways.iter().flat_map(bent).collect()
                }
                None => Vec::new(),
            };
            Own {
                bent: plant.displacements.iter().enumerate().map(bent).collect(),
                torque: drive::torque(data, values, &effects),
                encoders: values.encoders().collect(),
                plant,
            }
        };
        Self {
            models: values.iter().map(own).collect(),
            data,
        }
    }

    /// Where the joints' encoders say that they are at a sample, rad.
    pub(crate) fn measured(&self, span: &Span, sample: usize) -> Vec<f64> {
        self.model(span).state(self.data, sample).q
    }

    /// The joints' position at the end, rad, and each sample's to `each`; none where the motion has left what a robot can do.
    pub(crate) fn run(&self, span: &Span, each: impl FnMut(usize, &[f64])) -> Option<Vec<f64>> {
        self.run_by(STEP, span, each)
    }

    /// The same by steps of at most so many seconds.
    fn run_by(
        &self,
        step: f64,
        span: &Span,
        mut each: impl FnMut(usize, &[f64]),
    ) -> Option<Vec<f64>> {
        let (own, motion, n) = (self.model(span), &self.data.motion, self.data.joints());
        let [first, last] = span.samples;
        let mut state = own.state(self.data, first);
        for k in first..last {
            let of = |sample: usize| &own.torque[sample * n..(sample + 1) * n];
            let torque = |along: f64| -> Vec<f64> {
                let ends = of(k).iter().zip(of(k + 1));
                ends.map(|(from, to)| from + along * (to - from)).collect()
            };
            let now = Instant {
                time: motion.time[k],
                temperature: &motion.temperature[k * n..(k + 1) * n],
            };
            let time = motion.time[k + 1] - motion.time[k];
            // A part of the time between the samples, from one share of it on.
            let moved = |state: &State, from: f64, part: f64| -> Option<State> {
                let mut state = state.clone();
                let torques = [&torque(from)[..], &torque(from + 0.5 * part)];
                own.plant.step(&mut state, torques, &now, part * time)?;
                Some(state)
            };
            // A motion has no gap of more than 50 ms: fifty steps at most.
            let parts = (time / step).ceil().max(1.0);
            for part in 0..parts as usize {
                let (from, part) = (part as f64 / parts, 1.0 / parts);
                let next = moved(&state, from, part)?;
                state = match state.turns(&next) {
                    false => next,
                    true => (0..FINE).try_fold(state, |state, n| {
                        let fine = part / FINE as f64;
                        moved(&state, from + n as f64 * fine, fine)
                    })?,
                };
            }
            each(k + 1, &state.q);
        }
        Some(state.q)
    }

    fn model(&self, span: &Span) -> &Own {
        &self.models[span.fold.min(self.models.len() - 1)]
    }
}

impl Own {
    /// What was measured at a sample.
    fn state(&self, data: &LimbData, sample: usize) -> State {
        let joints = data.motion.joint.iter().zip(&self.encoders);
        let motion = joints.map(|(joint, encoder)| {
            let [q, dq, ..] = joint.state[sample];
            <(f64, f64)>::from(encoder.motion([q, dq]))
        });
        let (q, dq): (Vec<f64>, Vec<f64>) = motion.unzip();
        let bent = self.bent.iter();
        State {
            load: vec![0.0; q.len()],
            bent: bent
                .map(|own| own.get(sample).copied().unwrap_or(0.0))
                .collect(),
            q,
            dq,
        }
    }
}
