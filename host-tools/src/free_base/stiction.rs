//! Joints that dry friction may hold.
//!
//! A joint that turns round is held for as long as all else on it is less than its friction: of a robot that sways for a tenth of a second and
//! more. Friction is then anything up to its size, and a model that gives it the sign of the velocity is wrong by as much: it told encoders that
//! are read too late, and doubled what was left of a sway. The equation of such a joint is left out of the window, like that of a foot's force:
//! it costs rows, not truth.

use proprio_core::effect::STANDING_NOISE;

use super::channels::Channels;
use crate::robust;

/// Below this rate (Hz) a joint may turn round between two samples, and a slope between them is not the velocity at one.
pub(super) const LEAST_RATE: f64 = 200.0;
/// A velocity of fewer standard deviations of its noise may have either sign.
const SURE: f64 = 3.0;
/// The same as a share of the joint's greatest speeds, as a joint of the pinned path has it ([`crate::trajectory`]).
const SLOW: f64 = 0.002;
/// A joint that is slower than so many times that may be held, as there.
const RESTING: f64 = 2.0;

/// What is known of joints near standstill.
#[derive(Debug, Clone)]
pub(crate) struct Rest {
    /// Speeds below which the sign of a joint's may be noise, rad/s.
    pub(crate) speed_noise: Vec<f64>,
    /// How many samples before each, and in all, found a joint so slow that friction may hold it.
    slow: Vec<Vec<u32>>,
}

impl Rest {
    /// By the velocities (rad/s) of all samples, which are so far apart, s. Slow samples tell no rest: a joint turns round between two of them.
    pub(super) fn of(velocities: &Channels, period: f64) -> Self {
        let joints = velocities.width();
        let of = |j: usize| speed_noise(&velocities.of(j).collect::<Vec<_>>());
        let speed_noise: Vec<f64> = (0..joints).map(of).collect();
        let mut sum = vec![0; joints];
        let mut slow = vec![sum.clone()];
        let shows_rest = period <= 1.0 / LEAST_RATE;
        for dq in velocities.iter() {
            let is_slow = |j: usize| shows_rest && dq[j].abs() < RESTING * speed_noise[j];
            (0..joints).for_each(|j| sum[j] += u32::from(is_slow(j)));
            slow.push(sum.clone());
        }
        Self { speed_noise, slow }
    }

    /// Joints that may be held in a window of this length that begins with sample n of those at `time_us`: one slow sample is enough. With two,
    /// trots' friction was within two deviations less often (of a trot of 30 s with a load 30 of 36, and 36 with one); where an eighth of a window was
    /// asked for, hops without noise came out 0.2 % too heavy and trots 0.07 %.
    pub(super) fn within(&self, time_us: &[u64], n: usize, window_us: u64) -> Vec<bool> {
        let end = time_us[n] + window_us;
        // The first sample that is late enough ends the window.
        let last = n + time_us[n..].partition_point(|t| *t < end);
        let end = (last + 1).min(time_us.len());
        let both = self.slow[end].iter().zip(&self.slow[n]);
        both.map(|(after, before)| after > before).collect()
    }
}

/// Speed below which the sign of a joint's velocity may be noise, rad/s: no more than that of a standing Go2's reported velocity. The noise by
/// third differences, of which that of n is 20 n² (their coefficients' squares); the middle one, for touch-downs are rare.
fn speed_noise(velocity: &[f64]) -> f64 {
    let third = velocity.windows(4);
    let third = third.map(|x| x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0]);
    let noise = robust::scale(third).unwrap_or(0.0) / 20f64.sqrt();
    let fast = robust::quantile(velocity.iter().map(|v| v.abs()), 0.95).unwrap_or(0.0);
    let least = (SURE * noise).max(SLOW * fast);
    least.clamp(f64::MIN_POSITIVE, STANDING_NOISE)
}
