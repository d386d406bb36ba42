//! `velocity_gain`, which positions tell better than any torque: ∫ q̇ dt against Δq.
//!
//! The position's quantum is so fine that all the noise is in the velocity; regressing ∫ q̇ dt on Δq is then unbiased. Over
//! stretches of [`STRETCH_US`] a filter in the drive's velocity hardly shows.

use super::limb::FOLDS;
use super::recording::LimbRecording;
use super::rows::Blocks;

/// Length of a stretch, µs.
const STRETCH_US: u64 = 100_000;
/// Smallest gain error that counts: below it, time stamps and filters look the same.
const LEAST: f64 = 0.02;
/// And it must be so many standard deviations.
const LEAST_Z: f64 = 5.0;

/// What positions say of a joint's velocity.
#[derive(Debug, Clone)]
pub(crate) struct VelocityGain {
    /// Reported over true.
    pub(crate) value: f64,
    /// Standard deviation, from the spread over folds of time.
    pub(crate) std: f64,
    /// 1 − the held-out sum of squares of ∫ q̇ dt / g − Δq over that with g = 1.
    pub(crate) held_out_gain: f64,
    /// Error of that, from the spread over folds.
    pub(crate) error: f64,
}

impl VelocityGain {
    pub(crate) fn z(&self) -> f64 {
        (self.value - 1.0).abs() / self.std
    }

    pub(crate) fn is_significant(&self) -> bool {
        (self.value - 1.0).abs() > LEAST && self.z() > LEAST_Z && self.held_out_gain > self.error
    }

    /// Measures one joint; `None` if it hardly moves.
    pub(crate) fn of(recording: &LimbRecording, joint: usize, blocks: Blocks) -> Option<Self> {
        let folds = FOLDS.min(blocks.count);
        let mut sums = vec![[0.0f64; 3]; folds];
        let begin = *recording.time_us.first()?;
        let at = |x: &[f64], k: usize| x[k * recording.joints + joint];
        for stretch in recording.stretches() {
            let (mut first, mut integral) = (stretch.start, 0.0);
            for k in stretch.skip(1) {
                let step = 1e-6 * (recording.time_us[k] - recording.time_us[k - 1]) as f64;
                integral += 0.5 * step * (at(&recording.dq, k) + at(&recording.dq, k - 1));
                if recording.time_us[k] - recording.time_us[first] < STRETCH_US {
                    continue;
                }
                let moved = at(&recording.q, k) - at(&recording.q, first);
                let fold = ((recording.time_us[first] - begin) / blocks.length_us) as usize % folds;
                let numbers = [moved * moved, moved * integral, integral * integral];
                sums[fold]
                    .iter_mut()
                    .zip(numbers)
                    .for_each(|(sum, x)| *sum += x);
                (first, integral) = (k, 0.0);
            }
        }
        let all = sums
            .iter()
            .fold([0.0; 3], |a, b| [a[0] + b[0], a[1] + b[1], a[2] + b[2]]);
        let gain = |s: [f64; 3]| s[1] / s[0];
        if folds < 2 || all[0] <= 0.0 || all[1] <= 0.0 {
            return None;
        }
        let without = |fold: usize| std::array::from_fn(|n| all[n] - sums[fold][n]);
        let misfit = |s: [f64; 3], g: f64| s[2] / (g * g) - 2.0 * s[1] / g + s[0];
        let (mut spread, mut gains, mut before) = (0.0, Vec::new(), 0.0);
        for fold in 0..folds {
            let g = gain(without(fold));
            spread += (g - gain(all)).powi(2);
            gains.push(misfit(sums[fold], 1.0) - misfit(sums[fold], g));
            before += misfit(sums[fold], 1.0);
        }
        let n = folds as f64;
        let fall: f64 = gains.iter().sum();
        let scatter: f64 = gains.iter().map(|x| (x - fall / n).powi(2)).sum();
        Some(Self {
            value: gain(all),
            std: (spread * (n - 1.0) / n).sqrt(),
            held_out_gain: fall / before,
            error: (scatter * n / (n - 1.0)).sqrt() / before,
        })
    }
}
