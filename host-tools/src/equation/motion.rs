//! What a limb did: the joints' smooth trajectories and the windows of time in which they are judged. No torque, by type.
//!
//! [`Motion::states`] adds what a model says of it ([`super::joint_states`]).

use std::ops::Range;
use std::sync::Arc;

use proprio_core::effect::JointState;

use super::folds::Blocks;
use super::local_line::{REACH, around, local_line};
use super::presliding::Way;
use super::recoil::Recoil;
use super::transmitted_torque_cache::Loads;
use super::values::Values;
use crate::recording::LimbRecording;
use crate::trajectory::{Stretch, Trajectory};

/// Shortest window, s.
pub(crate) const WINDOW: f64 = 0.02;
/// Fewest sample periods of a window: its torque is a mean of at least as many samples.
const LEAST_PERIODS: f64 = 4.0;
/// Share of a window in which a joint may be so slow that friction may hold it, and the window still say something of its
/// friction: one sample of a Go2, which a reversal takes that friction does not hold up.
pub(crate) const MOST_REST: f64 = 0.125;

/// A limb's motion, sample by sample.
pub(crate) struct Motion {
    /// How many joints.
    pub(crate) joints: usize,
    /// s since the recording's start.
    pub(crate) time: Arc<Vec<f64>>,
    /// Samples of one motion, over which states of friction, springs and plays last: messages may be lost between them.
    pub(crate) stretches: Vec<Range<usize>>,
    /// Of each joint, at its motor.
    pub(crate) joint: Arc<Vec<Trajectory>>,
    /// Of each joint's link, where a second encoder was recorded all the time.
    pub(super) links: Vec<Option<Trajectory>>,
    /// Motor temperature, °C, sample by sample, joint by joint; not a number where not recorded.
    pub(crate) temperature: Arc<Vec<f64>>,
    /// What the joints feel of a base that all limbs move, where it is asked for.
    pub(crate) recoil: Option<Arc<Recoil>>,
    /// The windows, in the order of time.
    pub(crate) windows: Vec<Window>,
    /// Whether samples are so far apart that what enters by its difference is corrected at a window's ends.
    pub(super) coarse: bool,
    pub(super) loads: Loads,
}

/// A window of time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Window {
    /// Its middle, s since the recording's start.
    pub(crate) t: f64,
    /// Its length, s.
    pub(crate) length: f64,
    /// The block of time that it belongs to.
    pub(crate) block: usize,
    /// First and last sample.
    pub(crate) samples: [usize; 2],
    /// Whether each joint is judged: it moves, for the torque of one at rest is whatever friction holds, and is not at an end of its motion, where
    /// that is not followed. By velocities as they were reported, so that the same windows are judged whatever scale a model gives them.
    pub(crate) judged: Vec<bool>,
}

/// The samples that are asked for: all where not told, else no one before or after the range.
pub(crate) type Asked = Option<(Range<usize>, Vec<bool>)>;

impl Motion {
    /// What the motion alone shows an effect of a joint at sample k: no torque, no state of friction, spring or play.
    pub(crate) fn state(&self, k: usize, joint: usize) -> JointState<f64> {
        let own = &self.joint[joint];
        let [q, dq, ..] = own.state[k];
        JointState {
            speed: own.speed[k],
            speed_noise: own.speed_noise,
            temperature: self.temperature[k * self.joints + joint],
            time: self.time[k],
            ..JointState::reported(q, dq, 0.0)
        }
    }

    /// The sign of a joint's velocity at sample k, as dry friction has it ([`JointState::sign`]), −1 to 1.
    pub(crate) fn sign(&self, k: usize, joint: usize) -> f64 {
        self.state(k, joint).sign()
    }

    /// A limb's motion by its recording; `velocity_gain` is each joint's reported velocity over the true one.
    pub(crate) fn of(recording: &LimbRecording, blocks: &Blocks, velocity_gain: &[f64]) -> Self {
        let n = recording.joints;
        let time = Arc::new(recording.seconds());
        let stretches = recording.motions();
        let period = recording.period();
        let joint = recording.trajectories(velocity_gain);
        let link = |j: usize| link(recording, j, &joint[j], (&time, &stretches), period);
        let links = (0..n).map(link).collect();
        let mut motion = Self {
            joints: n,
            time,
            stretches,
            joint,
            links,
            temperature: Arc::new(recording.temperature.clone()),
            recoil: None,
            windows: Vec::new(),
            coarse: false,
            loads: Loads::default(),
        };
        motion.coarse = motion.joint.iter().any(|joint| joint.is_coarse(period));
        // Samples left out make the mean period longer than the others are: a window has no sample more for that.
        let length = WINDOW.max((LEAST_PERIODS - 0.25) * period);
        let reported = recording.trajectories(&vec![1.0; n]);
        motion.windows = motion.cut(recording.stretches(), blocks, length, &reported);
        motion
    }

    /// The same windows of the same motion, measured once more ([`LimbRecording::measured_again`]).
    pub(crate) fn measured_again(&self, recording: &LimbRecording, velocity_gain: &[f64]) -> Self {
        Self {
            joints: self.joints,
            time: self.time.clone(),
            stretches: self.stretches.clone(),
            joint: recording.measured_again(&self.joint, velocity_gain),
            links: self.links.clone(),
            temperature: self.temperature.clone(),
            recoil: self.recoil.clone(),
            windows: self.windows.clone(),
            coarse: self.coarse,
            loads: Loads::default(),
        }
    }

    /// The same with a window around each sample, from the one before to the one after, whose time is the sample's own: for series at the
    /// log's rate. The first and last sample of a stretch have none.
    pub(crate) fn at_samples(
        recording: &LimbRecording,
        blocks: &Blocks,
        velocity_gain: &[f64],
    ) -> Self {
        let mut motion = Self::of(recording, blocks, velocity_gain);
        let reported = recording.trajectories(&vec![1.0; recording.joints]);
        let inner = |stretch: Range<usize>| stretch.start + 1..stretch.end.max(2) - 1;
        let around = |k: usize| Window {
            t: motion.time[k],
            length: motion.time[k + 1] - motion.time[k - 1],
            // A series holds nothing out.
            block: 0,
            samples: [k - 1, k + 1],
            judged: (reported.iter())
                .map(|joint| motion.is_judged(joint, k - 1, k + 1))
                .collect(),
        };
        motion.windows = (recording.stretches().flat_map(inner).map(around)).collect();
        motion
    }

    /// Cuts stretches without a gap into windows of at least this length (s) that lie within a block, with joints that move as `reported`.
    fn cut(
        &self,
        stretches: impl Iterator<Item = Range<usize>>,
        blocks: &Blocks,
        length: f64,
        reported: &[Trajectory],
    ) -> Vec<Window> {
        let mut windows = Vec::new();
        for stretch in stretches {
            let mut first = stretch.start;
            for k in stretch {
                // Sample times are whole microseconds.
                if self.time[k] - self.time[first] < length - 1e-7 {
                    continue;
                }
                let [start, end] = [first, k].map(|k| (self.time[k] * 1e6).round() as u64);
                if let Some(block) = blocks.of_window(start, end) {
                    windows.push(Window {
                        t: 0.5 * (self.time[first] + self.time[k]),
                        length: self.time[k] - self.time[first],
                        block,
                        samples: [first, k],
                        judged: (reported.iter())
                            .map(|joint| self.is_judged(joint, first, k))
                            .collect(),
                    });
                }
                first = k;
            }
        }
        windows
    }

    /// First and last sample of a window, and where samples are few one more on either side: a log knows the moment of a turn to a sample, so
    /// that one there may be in the window. In windows of which a sample is less than friction may hold a joint for, that says it already.
    pub(super) fn about(&self, window: &Window) -> [usize; 2] {
        let [first, last] = window.samples;
        if MOST_REST * (last - first) as f64 >= 1.0 {
            return window.samples;
        }
        let stretch = &self.stretches[self.stretches.partition_point(|s| s.end <= first)];
        [
            first.saturating_sub(1).max(stretch.start),
            (last + 1).min(stretch.end - 1),
        ]
    }

    /// Share of a window for which nothing is known of the friction of a joint that turns round within: as long as it may be held, and the period
    /// between the samples about the turn, of which each has the friction of its own moment.
    pub(crate) fn turning(window: &Window) -> f64 {
        let [first, last] = window.samples;
        MOST_REST.max(1.0 / (last - first).max(1) as f64)
    }

    /// How long what is before a window's end was seen without a gap when the window begins, s.
    pub(crate) fn seen_before(&self, window: &Window) -> f64 {
        let first = window.samples[0];
        let stretch = self.stretches.partition_point(|s| s.end <= first);
        let start = self.stretches.get(stretch).map_or(first, |s| s.start);
        self.time[first] - self.time[start]
    }

    /// The least and the greatest position of a joint, rad.
    pub(crate) fn positions(&self, joint: usize) -> [f64; 2] {
        let q = || self.joint[joint].state.iter().map(|state| state[0]);
        [q().fold(f64::MAX, f64::min), q().fold(f64::MIN, f64::max)]
    }

    /// Whether a joint is judged between two samples.
    fn is_judged(&self, joint: &Trajectory, first: usize, last: usize) -> bool {
        self.is_followed(joint, first, last) && self.moves(joint, first, last)
    }

    /// Whether the ends of its motion are far enough away.
    fn is_followed(&self, joint: &Trajectory, first: usize, last: usize) -> bool {
        let stretch = self.stretches.partition_point(|s| s.end <= first);
        let Some(stretch) = self.stretches.get(stretch) else {
            return false;
        };
        let (start, end) = (self.time[stretch.start], self.time[stretch.end - 1]);
        let ends = joint.ends(end - start);
        self.time[first] - start >= ends && end - self.time[last] >= ends
    }

    /// Whether a joint is not held up for long between two samples.
    fn moves(&self, joint: &Trajectory, first: usize, last: usize) -> bool {
        let resting = (first + 1..=last).filter(|&k| joint.speed[k].abs() < joint.rest);
        let rest: f64 = resting.map(|k| self.time[k] - self.time[k - 1]).sum();
        rest < MOST_REST * (self.time[last] - self.time[first])
    }

    /// The samples that a model's torque in the chosen windows depends on: those within, and what smooths the load there. All, if most windows are
    /// chosen, or where a link moves against its motor: by all that came before, and by a load of which the whole log tells what is motion.
    pub(crate) fn asked(&self, values: &Values, chosen: &dyn Fn(usize) -> bool) -> Asked {
        let count = (0..self.windows.len()).filter(|w| chosen(*w)).count();
        let is_loose = values
            .places()
            .any(|place| place.0.description().is_compliant());
        if is_loose || 4 * count >= 3 * self.windows.len() {
            return None;
        }
        let mut asked = vec![false; self.time.len()];
        let mut range: Option<Range<usize>> = None;
        for (_, window) in self.windows.iter().enumerate().filter(|(w, _)| chosen(*w)) {
            let [first, last] = window.samples;
            let (begin, end) = (
                self.time[first] - 2.0 * REACH,
                self.time[last] + 2.0 * REACH,
            );
            let from = self.time[..first].partition_point(|t| *t < begin);
            let to = last + self.time[last..].partition_point(|t| *t <= end);
            // Those next to the window's ends, however far apart samples are.
            let (from, to) = (from.min(first.saturating_sub(1)), to.max(last + 2));
            let to = to.min(self.time.len());
            let known = range.clone().unwrap_or(from..to);
            range = Some(known.start.min(from)..known.end.max(to));
            asked[from..to].fill(true);
        }
        Some((range.unwrap_or(0..0), asked))
    }

    /// What the bristles of a joint that moves so have transmitted at each sample since the gap before it, per N m of presliding friction
    /// with this displacement (rad), s.
    pub(crate) fn presliding(&self, joint: &Trajectory, displacement: f64) -> Vec<f64> {
        let ways = self.ways(joint);
        let impulse = ways.iter().flat_map(|way| way.impulse(displacement));
        impulse.collect()
    }

    /// The way of a joint that moves so, stretch by stretch.
    pub(crate) fn ways(&self, joint: &Trajectory) -> Vec<Way> {
        let of = |stretch: &Range<usize>| {
            Way::of(&self.time[stretch.clone()], &joint.state[stretch.clone()])
        };
        self.stretches.iter().map(of).collect()
    }
}

/// The trajectory of a link by its own encoder; its velocity by the motor's, and by how the two move against each other.
fn link(
    recording: &LimbRecording,
    joint: usize,
    motor: &Trajectory,
    (time, stretches): (&[f64], &[Range<usize>]),
    period: f64,
) -> Option<Trajectory> {
    let n = recording.joints;
    let q: Vec<f64> = (recording.q_link.iter().skip(joint).step_by(n).copied()).collect();
    if q.is_empty() || q.iter().any(|q| !q.is_finite()) {
        return None;
    }
    let twist: Vec<f64> = (q.iter().zip(&motor.state))
        .map(|(q, motor)| q - motor[0])
        .collect();
    let velocity = |stretch: &Range<usize>| {
        let (t, twist) = (&time[stretch.clone()], &twist[stretch.clone()]);
        let slope = |k: usize| local_line(t, twist, k, around(t, k))[1];
        let motor = motor.state[stretch.clone()].iter().enumerate();
        motor
            .map(|(k, motor)| motor[1] + slope(k))
            .collect::<Vec<_>>()
    };
    let dq: Vec<f64> = stretches.iter().flat_map(velocity).collect();
    let of = |s: &Range<usize>| Stretch {
        t: &time[s.clone()],
        q: &q[s.clone()],
        dq: &dq[s.clone()],
    };
    Some(Trajectory::of(
        &stretches.iter().map(of).collect::<Vec<_>>(),
        period,
    ))
}
