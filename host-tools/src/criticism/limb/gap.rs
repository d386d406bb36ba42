//! Play is found by trying gaps: how a link falls through one is no straight line in its width.

use proprio_core::effect::EffectKind;

use super::super::motion::{MotorSide, slopes};
use super::super::windows::Windows;
use super::LimbCriticism;
use super::candidate::jackknife;
use super::fit::weighted;

/// The gaps that are tried first, rad: the smallest, each this much wider than the one before, and how many.
const SMALLEST: f64 = 2e-3;
const WIDER: f64 = 1.4;
const TRIED: i32 = 12;
/// Rounds of refinement, each half as wide as the last.
const ROUNDS: i32 = 3;
/// Between the gaps tried last, as a share of the gap: so far a column may move it.
pub(super) const STEP: f64 = 0.02;

/// What is the same for all gaps that are tried at a joint.
struct Scan {
    joint: usize,
    motor: MotorSide,
    /// See [`LimbCriticism::torque_to_follow`].
    follow: Vec<f64>,
    /// Of each joint's rows, N m.
    noise: Vec<f64>,
}

impl LimbCriticism<'_> {
    /// Finds the gaps of those joints whose model has play without a width.
    pub(super) fn find_gaps(&mut self) {
        for joint in 0..self.recording.joints {
            let is_active = self.active.contains(&(EffectKind::Backlash, joint));
            if is_active && !self.is_gap_given(joint) {
                self.find_gap(joint);
            }
        }
    }

    fn is_gap_given(&self, joint: usize) -> bool {
        let body = self.limb.bodies.start + joint;
        let play = self.model.effect(EffectKind::Backlash, body);
        play.is_some_and(|play| play.estimates[0].is_some())
    }

    /// Leaves a joint's play, which the model has, at the gap under which the held-out error is least. Its error is the spread
    /// of the gaps that are best without each fold in turn.
    pub(crate) fn find_gap(&mut self, joint: usize) {
        // Columns of what the model lacks are not needed meanwhile.
        let with_candidates = std::mem::replace(&mut self.with_candidates, false);
        self.corrections.gap[joint] = SMALLEST;
        self.rebuild();
        let scan = Scan {
            joint,
            motor: self.motors()[joint],
            follow: self.torque_to_follow(),
            noise: self.fit.noise.clone(),
        };
        let mut tried: Vec<(f64, Vec<f64>)> = (0..TRIED)
            .map(|n| self.try_gap(&scan, SMALLEST * WIDER.powi(n)))
            .collect();
        for round in 1..=ROUNDS {
            let step = WIDER.powf(0.5f64.powi(round));
            let middle = best(&tried, None);
            tried.extend([middle / step, middle * step].map(|gap| self.try_gap(&scan, gap)));
        }
        let gap = best(&tried, None);
        let without = (0..self.tests.len()).map(|fold| best(&tried, Some(fold)));
        self.gap_std[joint] = jackknife(without, gap).max(STEP * gap);
        self.with_candidates = with_candidates;
        self.corrections.gap[joint] = gap;
        self.rebuild();
    }

    /// A gap, and the weighted sum of squares of each fold with it.
    fn try_gap(&mut self, scan: &Scan, gap: f64) -> (f64, Vec<f64>) {
        self.corrections.gap[scan.joint] = gap;
        self.motion.fill_joint(
            self.recording,
            &self.corrections,
            scan.motor,
            &scan.follow,
            scan.joint,
        );
        self.windows = Windows::of(&self.rows());
        self.refold();
        let folds = self.fit.rss.iter();
        (gap, folds.map(|fold| weighted(fold, &scan.noise)).collect())
    }

    /// What an entry's value is uncertain by beside what its column says: a gap is chosen among those that were tried.
    pub(crate) fn scan_error(&self, entry: usize) -> f64 {
        let entry = &self.columns.entries[entry];
        match entry.effect {
            Some(EffectKind::Backlash) => self.gap_std[entry.joint],
            _ => 0.0,
        }
    }

    /// The torque that each link takes to follow its motor, at the present inertias, N m: sample by sample, joint by joint.
    /// While a link is free it is not what the gear transmits, which is nothing. Empty if no joint has play.
    pub(super) fn torque_to_follow(&self) -> Vec<f64> {
        let is_play = |&(effect, _): &(EffectKind, usize)| effect == EffectKind::Backlash;
        if !self.active.iter().any(is_play) {
            return Vec::new();
        }
        let (recording, n) = (self.recording, self.recording.joints);
        let mut torque = vec![0.0; recording.q.len()];
        let (mut dq, mut ddq) = (vec![0.0; n], vec![0.0; n]);
        for stretch in recording.stretches() {
            let times: Vec<f64> = (recording.time_us[stretch.clone()].iter())
                .map(|&t| 1e-6 * t as f64)
                .collect();
            let of_joint = |joint: usize| {
                let q: Vec<f64> = stretch
                    .clone()
                    .map(|k| recording.q[k * n + joint])
                    .collect();
                slopes(&times, &q)
            };
            let motion: Vec<Vec<[f64; 2]>> = (0..n).map(of_joint).collect();
            for (sample, k) in stretch.clone().enumerate() {
                for (joint, slopes) in motion.iter().enumerate() {
                    [dq[joint], ddq[joint]] = slopes[sample];
                }
                let at = k * n..(k + 1) * n;
                let motion = [&recording.q[at.clone()], &dq, &ddq];
                self.body
                    .inverse_dynamics(&self.base, motion, &mut torque[at]);
            }
        }
        torque
    }
}

/// The best of the gaps tried, by all folds or by all but one.
fn best(tried: &[(f64, Vec<f64>)], without: Option<usize>) -> f64 {
    let sum = |squares: &[f64]| -> f64 {
        let folds = squares.iter().enumerate();
        folds
            .filter(|(fold, _)| Some(*fold) != without)
            .map(|(_, square)| square)
            .sum()
    };
    let least = tried.iter().min_by(|a, b| sum(&a.1).total_cmp(&sum(&b.1)));
    least.map_or(SMALLEST, |(gap, _)| *gap)
}
