//! What was recorded of one limb.

use std::ops::Range;
use std::sync::{Arc, OnceLock};

#[cfg(doc)]
use crate::log::Channel;
use crate::log::{BRIDGED, Periods};
use crate::once::made_once;
use crate::parallel::by_number;
use crate::signs::Signs;
use crate::trajectory::{Stretch, Trajectory};

/// s.
const NO_PERIOD: f64 = 0.02;
/// [`BRIDGED`] in µs. Begun anew after each few messages that were lost, a motion would not be known there at first.
const BRIDGED_US: u64 = (1e6 * BRIDGED) as u64;

/// What was recorded of one limb: samples of all its joints, repeats left out, logs one after the other.
#[derive(Debug, Clone, Default)]
pub struct LimbRecording {
    /// Number of joints.
    pub(crate) joints: usize,
    /// When, µs; starts again with each log, later.
    pub(crate) time_us: Vec<u64>,
    /// When each log begins, µs.
    pub(crate) log_starts: Vec<u64>,
    /// First sample of each stretch without a gap, ascending; the first is 0.
    pub(crate) starts: Vec<usize>,
    /// Position, rad, sample by sample, joint by joint; and so the others.
    pub(crate) q: Vec<f64>,
    /// Velocity, rad/s.
    pub(crate) dq: Vec<f64>,
    /// Motor torque, N m.
    pub(crate) tau: Vec<f64>,
    /// Motor temperature, °C; not a number where not recorded.
    pub(crate) temperature: Vec<f64>,
    /// Position of a second encoder, at the link, rad; not a number where a joint has none, empty where none has.
    pub(crate) q_link: Vec<f64>,
    /// The foot's sensor, in its own unit, where recorded.
    pub(crate) foot: Vec<f64>,
    /// What the drives were asked to do, by [`Channel::COMMAND`], of each sample and joint; not a number where not recorded, empty where it was not asked
    /// for ([`Recording::read_commanded`](super::Recording::read_commanded)).
    pub(crate) command: Vec<[f64; 5]>,
    /// Samples that repeat the one before, left out.
    pub repeated: u64,
    /// From when to when, µs, samples are known and not judged, ascending.
    pub(super) left_out_us: Arc<Vec<[u64; 2]>>,
    /// Times between the samples of the log that is being read.
    pub(super) periods: Periods,
    /// What is made of the samples once they are all there.
    pub(super) trajectories: Trajectories,
}

/// The joints' trajectories, made when first asked for; a copy, which may be changed, makes its own.
#[derive(Debug, Default)]
pub(super) struct Trajectories(OnceLock<Arc<Vec<Trajectory>>>);

impl Clone for Trajectories {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl LimbRecording {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_us.len()
    }

    /// Whether there is no sample.
    pub fn is_empty(&self) -> bool {
        self.time_us.is_empty()
    }

    /// The stretches without a gap.
    pub fn stretches(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let ends = self.starts.iter().skip(1).copied().chain([self.len()]);
        self.starts
            .iter()
            .copied()
            .zip(ends)
            .map(|(start, end)| start..end)
    }

    /// The stretches of one motion: messages are lost between some samples, and no more of it than a smoother follows ([`BRIDGED`]).
    pub(crate) fn motions(&self) -> Vec<Range<usize>> {
        let mut motions: Vec<Range<usize>> = Vec::new();
        for stretch in self.stretches() {
            let silent = |last: usize| self.time_us[stretch.start] - self.time_us[last];
            match motions.last_mut() {
                Some(known) if silent(known.end - 1) <= BRIDGED_US => known.end = stretch.end,
                _ => motions.push(stretch),
            }
        }
        motions
    }

    /// Mean sampling period, s: within stretches, whatever lies between them. Where no sample follows another there is none; any number
    /// will do then.
    pub(crate) fn period(&self) -> f64 {
        let of = |stretch: Range<usize>| {
            let time = &self.time_us[stretch];
            let span = time.last().zip(time.first());
            let span = span.map_or(0, |(last, first)| last - first);
            (1e-6 * span as f64, time.len().saturating_sub(1))
        };
        let (time, steps) = self
            .stretches()
            .map(of)
            .fold((0.0, 0), |(time, steps), (t, n)| (time + t, steps + n));
        if steps == 0 {
            NO_PERIOD
        } else {
            time / steps as f64
        }
    }

    /// When each sample was, s since the recording's start: the same time in all limbs and in every part of a log.
    pub(crate) fn seconds(&self) -> Vec<f64> {
        self.time_us.iter().map(|t| 1e-6 * *t as f64).collect()
    }

    /// The joints' smooth trajectories; `velocity_gain` is each joint's reported velocity over the true one.
    pub(crate) fn trajectories(&self, velocity_gain: &[f64]) -> Arc<Vec<Trajectory>> {
        let as_reported = || Arc::new(by_number(0..self.joints, |j| self.trajectory(j, 1.0)));
        let as_reported = made_once(&self.trajectories.0, as_reported);
        if velocity_gain.iter().all(|gain| *gain == 1.0) {
            return as_reported.clone();
        }
        let of = |(j, gain): (usize, &f64)| match *gain == 1.0 {
            true => as_reported[j].clone(),
            false => self.trajectory(j, *gain),
        };
        Arc::new(velocity_gain.iter().enumerate().map(of).collect())
    }

    fn trajectory(&self, joint: usize, velocity_gain: f64) -> Trajectory {
        let channel = |x: &[f64], scale: f64| -> Vec<f64> {
            let own = x.iter().skip(joint).step_by(self.joints);
            own.map(|x| x / scale).collect()
        };
        let time = self.seconds();
        let (q, dq) = (channel(&self.q, 1.0), channel(&self.dq, velocity_gain));
        let of = |s: Range<usize>| Stretch {
            t: &time[s.clone()],
            q: &q[s.clone()],
            dq: &dq[s],
        };
        let motions: Vec<Stretch> = self.motions().into_iter().map(of).collect();
        Trajectory::of(&motions, self.period())
    }

    /// The trajectories as they would be told if the same motion were measured once more: what smoothing left of each reading is added to `smooth` with
    /// a sign that is drawn (the wild bootstrap; Wu 1986, Annals of Statistics 14:1261), and smoothed again. Smoothing has let a part of the noise pass,
    /// so that what it left is made as large as the channel's noise is.
    pub(crate) fn measured_again(
        &self,
        smooth: &[Trajectory],
        velocity_gain: &[f64],
    ) -> Arc<Vec<Trajectory>> {
        let mut again = self.clone();
        let mut signs = Signs::new();
        let n = self.joints;
        let smooth_at = |k: usize| {
            let [position, velocity, ..] = smooth[k % n].state[k / n];
            [position, velocity * velocity_gain[k % n]]
        };
        let larger = |joint: usize| {
            let mut squares = [0.0; 2];
            for k in (joint..self.q.len()).step_by(n) {
                let [position, velocity] = smooth_at(k);
                squares[0] += (self.q[k] - position).powi(2);
                squares[1] += (self.dq[k] - velocity).powi(2);
            }
            [0, 1].map(|channel| {
                let left = (squares[channel] / self.len() as f64).sqrt();
                let noise = smooth[joint].noise[channel];
                f64::max(1.0, noise / left.max(f64::MIN_POSITIVE))
            })
        };
        let larger: Vec<[f64; 2]> = (0..n).map(larger).collect();
        for (k, (q, dq)) in again.q.iter_mut().zip(&mut again.dq).enumerate() {
            let ([position, velocity], larger) = (smooth_at(k), larger[k % n]);
            *q = position + larger[0] * signs.of(*q - position);
            *dq = velocity + larger[1] * signs.of(*dq - velocity);
        }
        // A velocity that is made of the positions is made of the new ones.
        for joint in (0..n).filter(|&j| smooth[j].noise[1].is_infinite()) {
            for motion in self.motions() {
                let (first, last) = (motion.start, motion.end - 1);
                for k in motion {
                    let [before, after] = [first.max(k.saturating_sub(1)), last.min(k + 1)];
                    let moved = again.q[after * n + joint] - again.q[before * n + joint];
                    let time = 1e-6 * (self.time_us[after] - self.time_us[before]) as f64;
                    again.dq[k * n + joint] = if time > 0.0 { moved / time } else { 0.0 };
                }
            }
        }
        again.trajectories(velocity_gain)
    }

    /// Replaces position (rad), velocity (rad/s) and torque (N m) of each sample and joint.
    pub(crate) fn replace(&mut self, with: impl Fn(usize, [f64; 3]) -> [f64; 3]) {
        self.trajectories = Trajectories::default();
        for k in 0..self.q.len() {
            let own = [self.q[k], self.dq[k], self.tau[k]];
            [self.q[k], self.dq[k], self.tau[k]] = with(k % self.joints, own);
        }
    }

    /// Replaces position, velocity and torque of one joint, sample by sample.
    pub(crate) fn replace_joint(&mut self, joint: usize, with: impl Fn(usize) -> [f64; 3]) {
        self.trajectories = Trajectories::default();
        for k in 0..self.len() {
            let at = k * self.joints + joint;
            [self.q[at], self.dq[at], self.tau[at]] = with(k);
        }
    }

    /// Adds a sample: positions, velocities, torques, temperatures, positions of second encoders (nothing where there are none);
    /// `new_log` where nothing is continuous with what came before.
    pub(super) fn push(&mut self, time_us: u64, sample: [&[f64]; 5], foot: f64, new_log: bool) {
        self.trajectories = Trajectories::default();
        let n = self.joints;
        let [q, dq, tau, temperature, q_link] = sample;
        if let Some(&last) = self.time_us.last() {
            let same = |old: &[f64], new: &[f64]| old[old.len() - n..] == *new;
            if time_us <= last {
                return;
            }
            if !new_log && same(&self.q, q) && same(&self.dq, dq) && same(&self.tau, tau) {
                self.repeated += 1;
                return;
            }
            if new_log {
                self.periods = Periods::default();
            }
            if new_log || self.periods.is_gap(1e-6 * (time_us - last) as f64) {
                self.starts.push(self.time_us.len());
            }
        } else {
            self.starts.push(0);
        }
        if new_log || self.log_starts.is_empty() {
            self.log_starts.push(time_us);
        }
        self.time_us.push(time_us);
        self.q.extend_from_slice(q);
        self.dq.extend_from_slice(dq);
        self.tau.extend_from_slice(tau);
        self.temperature.extend_from_slice(temperature);
        if !q_link.is_empty() || !self.q_link.is_empty() {
            // Logs before, or this one, may have no second encoder.
            self.q_link.resize(n * (self.time_us.len() - 1), f64::NAN);
            self.q_link.extend_from_slice(q_link);
            self.q_link.resize(n * self.time_us.len(), f64::NAN);
        }
        self.foot.push(foot);
    }

    /// All channels that have a number per joint.
    fn of_joints(&mut self) -> [&mut Vec<f64>; 5] {
        [
            &mut self.q,
            &mut self.dq,
            &mut self.tau,
            &mut self.temperature,
            &mut self.q_link,
        ]
    }

    /// Gives back the room that was kept for more samples.
    pub(super) fn shrink(&mut self) {
        self.time_us.shrink_to_fit();
        self.foot.shrink_to_fit();
        self.command.shrink_to_fit();
        let channels = self.of_joints();
        channels.into_iter().for_each(Vec::shrink_to_fit);
    }

    /// Leaves out the samples whose time is not to be kept; what is left out is a gap.
    pub(super) fn keep(&mut self, keeps: impl Fn(u64) -> bool) {
        self.trajectories = Trajectories::default();
        let n = self.joints;
        let kept: Vec<bool> = self.time_us.iter().map(|&t| keeps(t)).collect();
        let mut starts = Vec::new();
        let mut next = self.starts.iter().copied().peekable();
        let (mut length, mut whole) = (0, false);
        for (k, &kept) in kept.iter().enumerate() {
            whole &= next.next_if_eq(&k).is_none();
            if kept {
                if !whole {
                    starts.push(length);
                }
                length += 1;
            }
            whole = kept;
        }
        self.starts = starts;
        retain(&mut self.time_us, &kept, 1);
        retain(&mut self.foot, &kept, 1);
        retain(&mut self.command, &kept, n);
        for channel in self.of_joints() {
            retain(channel, &kept, n);
        }
    }
}

/// Leaves of numbers, so many per sample, those of the samples kept.
fn retain<T>(numbers: &mut Vec<T>, kept: &[bool], per_sample: usize) {
    let mut place = 0;
    numbers.retain(|_| {
        place += 1;
        kept[(place - 1) / per_sample]
    });
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// A joint that swings.
    fn swing(t: f64) -> [f64; 2] {
        let omega = 30.0;
        [0.2 * (omega * t).sin(), 0.2 * omega * (omega * t).cos()]
    }

    #[test]
    fn a_motion_is_followed_over_lost_messages() {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let mut limb = LimbRecording {
            joints: 1,
            ..LimbRecording::default()
        };
        let mut next_motion = None;
        for k in 0..4000u64 {
            // Five of 40 messages are lost, and once the log is silent for a tenth of a second.
            let time = 2_000 * k + if k < 2_000 { 0 } else { 100_000 };
            if k % 40 > 34 {
                continue;
            }
            if k >= 2_000 {
                next_motion = next_motion.or(Some(limb.len()));
            }
            let [q, dq] = swing(1e-6 * time as f64);
            let (q, dq) = (q + 1e-5 * normal(), dq + 0.03 * normal());
            limb.push(
                time,
                [&[q], &[dq], &[k as f64], &[f64::NAN], &[]],
                0.0,
                false,
            );
        }
        let next = next_motion.unwrap();
        assert_eq!(limb.motions(), [0..next, next..limb.len()]);
        assert!(limb.stretches().count() > 90);
        let trajectory = &limb.trajectories(&[1.0])[0];
        let time = limb.seconds();
        let off = |k: usize| (trajectory.state[k][1] - swing(time[k])[1]).abs();
        // The first samples after a gap are told as well as the others: momentum is made of the speed.
        let firsts = limb.stretches().map(|stretch| stretch.start);
        let firsts = firsts.filter(|&k| k != 0 && k != next);
        let worst = firsts.map(off).fold(0.0, f64::max);
        assert!(worst < 0.03, "{worst} rad/s of 6");
    }

    #[test]
    fn what_is_left_out_is_a_gap() {
        let mut limb = LimbRecording {
            joints: 2,
            ..LimbRecording::default()
        };
        for k in 0..20u64 {
            // A gap before sample 7.
            let time = 2_000 * k + if k < 7 { 0 } else { 50_000 };
            let x = k as f64;
            let pair = [x, -x];
            let q_link: &[f64] = if k < 5 { &[] } else { &pair };
            limb.push(time, [&pair, &pair, &pair, &pair, q_link], x, false);
        }
        assert_eq!(limb.starts, [0, 7]);
        assert!((limb.period() - 0.002).abs() < 1e-12);
        let index = |t: u64| {
            if t < 50_000 {
                t / 2_000
            } else {
                (t - 50_000) / 2_000
            }
        };
        limb.keep(|t| [3, 4, 5, 6, 7, 8, 12, 13].contains(&index(t)));
        assert_eq!(limb.foot, [3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 12.0, 13.0]);
        assert_eq!(limb.starts, [0, 4, 6]);
        assert!((limb.period() - 0.002).abs() < 1e-12);
        assert_eq!(limb.dq[14..], [13.0, -13.0]);
        assert!(limb.q_link[3].is_nan());
        assert_eq!(limb.q_link[4..], limb.dq[4..]);
        assert_eq!(limb.time_us.len(), limb.len());
        limb.keep(|_| false);
        assert!(limb.is_empty() && limb.starts.is_empty());
    }
}
