//! What was recorded of one limb.

use crate::log::Periods;

/// What was recorded of one limb: samples of all its joints, repeats left out, logs one after the other.
#[derive(Debug, Clone, Default)]
pub struct LimbRecording {
    /// Number of joints.
    pub joints: usize,
    /// When, µs; starts again with each log, later.
    pub time_us: Vec<u64>,
    /// When each log begins, µs.
    pub log_starts: Vec<u64>,
    /// First sample of each stretch without a gap, ascending; the first is 0.
    pub starts: Vec<usize>,
    /// Position, rad, sample by sample, joint by joint; and so the others.
    pub q: Vec<f64>,
    /// Velocity, rad/s.
    pub dq: Vec<f64>,
    /// Motor torque, N m.
    pub tau: Vec<f64>,
    /// Motor temperature, °C; not a number where not recorded.
    pub temperature: Vec<f64>,
    /// Position of a second encoder, at the link, rad; not a number where a joint has none, empty where none has.
    pub q_link: Vec<f64>,
    /// The foot's sensor, in its own unit, where recorded.
    pub foot: Vec<f64>,
    /// Samples that repeat the one before, left out.
    pub repeated: u64,
    /// Times between the samples of the log that is being read.
    pub(super) periods: Periods,
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
    pub fn stretches(&self) -> impl Iterator<Item = std::ops::Range<usize>> + '_ {
        let ends = self.starts.iter().skip(1).copied().chain([self.len()]);
        self.starts
            .iter()
            .copied()
            .zip(ends)
            .map(|(start, end)| start..end)
    }

    /// Mean sampling period, s: within stretches, whatever lies between them.
    pub(crate) fn period(&self) -> f64 {
        let of = |stretch: std::ops::Range<usize>| {
            let time = &self.time_us[stretch];
            let span = time.last().zip(time.first());
            let span = span.map_or(0, |(last, first)| last - first);
            (1e-6 * span as f64, time.len().saturating_sub(1))
        };
        let (time, steps) = self
            .stretches()
            .map(of)
            .fold((0.0, 0), |(time, steps), (t, n)| (time + t, steps + n));
        time / steps.max(1) as f64
    }

    /// Adds a sample: positions, velocities, torques, temperatures, positions of second encoders (nothing where there are none);
    /// `new_log` where nothing is continuous with what came before.
    pub(super) fn push(&mut self, time_us: u64, sample: [&[f64]; 5], foot: f64, new_log: bool) {
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

    /// Leaves out the samples whose time is not to be kept; what is left out is a gap.
    pub(super) fn keep(&mut self, keeps: impl Fn(u64) -> bool) {
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
        for channel in [
            &mut self.q,
            &mut self.dq,
            &mut self.tau,
            &mut self.temperature,
            &mut self.q_link,
        ] {
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
    use super::*;

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
