//! A limb's model run forward: from a measured state, under the torque that the motors reported or what they were asked to do, to where the model
//! would be.
//!
//! What a simulator or a policy sees of a model's error is not a torque but a motion that drifts. A *rollout* starts at a sample with the
//! measured position and velocity and takes nothing but the torque, or the commands, from the log until its end.
//!
//! Files beside:
//!
//! - `law`: the torque by what the drives were asked to do
//! - `drive`: the torque that the motors gave, by the one that they reported (scale, delay, lag, dead band, limit)
//! - `plant`: the bodies and effects that it moves, by small steps
//! - `friction`: what a step's dry friction does, stiction included
//!
//! Gears are rigid: a link that moves against its motor has a state of its own, which no sample measures ([`is_included`]).

mod drive;
mod friction;
mod law;
mod plant;
#[cfg(test)]
mod tests;

use proprio_core::effect::{EffectKind, Form, Input, Moved};

use crate::equation::encoder::Encoder;
use crate::equation::values::Values;
use crate::estimate::limb_data::LimbData;
pub use law::Gains;
use law::Law;
pub(crate) use law::{Commands, Missing};
use plant::{Given, Instant, Plant, State};

/// Longest step, s.
// Halving it moves no joint of a simulated leg with dry friction by more than 5e-5 rad after 0.1 s, where a Go2's sensor noise makes 5e-4.
const STEP: f64 = 1e-3;
/// Parts of a step in which a joint stops or turns: friction changes its sign at a moment within. Without them true models are off by 2.6e-4 rad
/// after 0.1 s, with them by 7e-5.
const FINE: usize = 16;

/// Whether a rollout has an effect: rigid gears have no backlash and no elasticity, and a force of the ground is not known. Where drives follow what was
/// `commanded`, they do so at once and in proportion.
pub(crate) fn is_included(effect: EffectKind, commanded: bool) -> bool {
    let of = effect.description();
    let of_reported_torque =
        of.form == Form::Clock || of.input == Input::MotorTorque && !of.is_limit();
    let is_known = !matches!(of.form, Form::Motion(Moved::Link(_)) | Form::Force);
    is_known && !(commanded && of_reported_torque)
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
    models: Vec<Own<'a>>,
}

/// A model, and what it makes of the recording.
struct Own<'a> {
    plant: Plant,
    motors: Motors<'a>,
    encoders: Vec<Encoder>,
    /// Of joints with bristles, how far they are bent at each sample by the measured motion, of their most.
    bent: Vec<Vec<f64>>,
}

/// What moves a limb.
enum Motors<'a> {
    /// Their torque at each sample, joint by joint, N m: a straight line between samples.
    Measured(Vec<f64>),
    /// What they were asked to do.
    Commanded(Law<'a>),
}

impl Motors<'_> {
    /// What they give in a state, `along` on the way from sample k to the next.
    fn given(&self, k: usize, along: f64, state: &State) -> Given {
        let n = state.q.len();
        match self {
            Self::Measured(torque) => {
                let of = |sample: usize| &torque[sample * n..(sample + 1) * n];
                let ends = of(k).iter().zip(of(k + 1));
                Given {
                    torque: ends.map(|(from, to)| from + along * (to - from)).collect(),
                    damping: vec![0.0; n],
                }
            }
            Self::Commanded(law) => law.torque(k, state),
        }
    }
}

impl<'a> Rollouts<'a> {
    /// Under one model, or under that of each fold; by the measured torque or by `commands`.
    pub(crate) fn of(
        data: &'a LimbData,
        values: &[Values],
        commands: Option<&'a Commands>,
    ) -> Self {
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
                motors: match commands {
                    None => Motors::Measured(drive::torque(data, values, &effects)),
                    Some(own) => Motors::Commanded(Law::of(data, values, &effects, own)),
                },
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
            let now = Instant {
                time: motion.time[k],
                temperature: &motion.temperature[k * n..(k + 1) * n],
            };
            let time = motion.time[k + 1] - motion.time[k];
            // A part of the time between the samples, from one share of it on.
            let moved = |state: &State, from: f64, part: f64| -> Option<State> {
                let mut state = state.clone();
                let given = |along: f64| move |at: &State| own.motors.given(k, along, at);
                let (begin, middle) = (given(from), given(from + 0.5 * part));
                own.plant
                    .step(&mut state, [&begin, &middle], &now, part * time)?;
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

    fn model(&self, span: &Span) -> &Own<'a> {
        &self.models[span.fold.min(self.models.len() - 1)]
    }
}

impl Own<'_> {
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
