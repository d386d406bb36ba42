//! `velocity_gain`, which positions tell better than any torque: the check of the data gates
//! ([`crate::gate`]) over all logs of a limb, in blocks of time.

use proprio_core::effect::EffectKind;

use super::folds::Blocks;
use crate::gate::TOLERATED_GAIN;
use crate::gate::quantum::Differences;
use crate::gate::velocity::{Times, VelocityCheck};
use crate::recording::LimbRecording;

/// A gain error must be so many standard deviations.
const LEAST_Z: f64 = 5.0;

/// What positions say of a joint's velocity.
#[derive(Debug, Clone)]
pub(crate) struct VelocityGain {
    /// Reported over true.
    pub(crate) value: f64,
    /// Standard deviation, from the spread over blocks of time.
    pub(crate) std: f64,
    /// 1 − the held-out sum of squares of ∫ q̇ dt / g − Δq over that with g = 1.
    pub(crate) held_out_gain: f64,
    /// Error of that, from the spread over blocks.
    pub(crate) error: f64,
}

impl VelocityGain {
    /// The effect that it is.
    pub(crate) const EFFECT: EffectKind = EffectKind::VelocityGain;

    pub(crate) fn z(&self) -> f64 {
        (self.value - 1.0).abs() / self.std
    }

    pub(crate) fn is_significant(&self) -> bool {
        (self.value - 1.0).abs() > TOLERATED_GAIN
            && self.z() > LEAST_Z
            && self.held_out_gain > self.error
    }

    /// Measures one joint; `None` if it hardly moves.
    pub(crate) fn of(recording: &LimbRecording, joint: usize, blocks: &Blocks) -> Option<Self> {
        let begin = *recording.time_us.first()?;
        let mut check = VelocityCheck::over_blocks_of(blocks.length());
        let (mut times, mut steps) = (Times::default(), Differences::new());
        let at = |x: &[f64], k: usize| x[k * recording.joints + joint];
        for stretch in recording.stretches() {
            let first = stretch.start;
            for k in stretch {
                let before = k.saturating_sub(1).max(first);
                let [since, now] = [recording.time_us[before], begin]
                    .map(|from| 1e-6 * (recording.time_us[k] - from) as f64);
                steps.push(at(&recording.q, k) - at(&recording.q, before));
                check.push(since, at(&recording.q, k), at(&recording.dq, k));
                if k == first {
                    check.interrupt();
                }
                if let Some(around) = times.push(now, k == first) {
                    check.end_stretch(&around);
                }
            }
        }
        let quantum = steps.quantum().unwrap_or(0.0);
        let found = check.result(quantum)?;
        let [held_out_gain, error] = check.held_out_gain(quantum)?;
        Some(Self {
            value: found.gain,
            std: found.gain_std,
            held_out_gain,
            error,
        })
    }
}
