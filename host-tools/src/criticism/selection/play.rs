//! Play or a spring between motor and link: to a first order the link lags the torque in both.
//!
//! Under a load that keeps its sign a link with play rests on one side of the gap and follows the motor exactly, while one on a
//! spring goes on giving way: the compliance by these windows alone, over that by all, is zero for play and one for a spring.

use proprio_core::effect::EffectKind;

use super::super::bursts::Bursts;
use super::super::limb::Place;
use super::super::rows::WINDOW_US;
use super::super::triangle::Triangle;
use super::Judged;
use super::walk::Walk;

/// Impacts may be left by what looks like a spring or a delay if at least this share of the error stays with it,
const LEAST_LEFT: f64 = 0.55;
/// at least this share of whose square is more than noise with the same median,
const LEAST_IMPACT: f64 = 0.25;
/// in at least this share of the windows.
const LEAST_IMPACTS: f64 = 0.013;
/// A load that has kept its sign so long has brought the link to rest on one side of the gap, µs: two windows.
const SETTLED_US: u64 = 2 * WINDOW_US;
/// Under such loads what may be play has less than this share of the compliance that a spring would have,
const MOST_STEADY: f64 = 0.8;
/// and a spring is so many standard deviations away.
const LEAST_STEADY_Z: f64 = 3.0;
/// Then play stands for the spring though it leaves a sum of squares up to this factor larger: how it bounces is not known.
const MOST_WORSE: f64 = 1.25;

impl Walk<'_, '_> {
    /// Puts play in the place of what has just been taken into the model, if that lags as play does and play explains more;
    /// `first` names it then.
    pub(super) fn judge_lag(&mut self, place: Place, first: &mut [Judged]) {
        let joint = place.1;
        let lags = [EffectKind::Elasticity, EffectKind::Delay].contains(&place.0);
        let play = (EffectKind::Backlash, joint);
        let has = |place: Place| self.limb.active.contains(&place);
        // What has been refused is not tried again: else it and the lag could take turns for ever.
        if !lags || !has(place) || has(play) || self.refused.has(play) {
            return;
        }
        let most = if place.0 == EffectKind::Elasticity && self.rests_under_load(joint) {
            MOST_WORSE
        } else if self.leaves_impacts(joint) {
            1.0
        } else {
            return;
        };
        let found = self.take_play_for(place, most);
        name_play(first, place, found);
    }

    /// Whether impacts are left, which no column has: a spring or a delay leaves noise.
    fn leaves_impacts(&self, joint: usize) -> bool {
        let left = self.limb.fit.held_out_squares.by_joint[joint] / self.start.by_joint[joint];
        let residuals = self.limb.held_out_residuals(joint);
        let impacts = |b: &Bursts| {
            b.share > LEAST_IMPACT && b.large.len() as f64 > LEAST_IMPACTS * residuals.len() as f64
        };
        left.sqrt() > LEAST_LEFT && Bursts::of(&residuals).as_ref().is_some_and(impacts)
    }

    /// Whether the link does not give way under loads that keep their sign, as it would on the spring of the model.
    fn rests_under_load(&self, joint: usize) -> bool {
        let limb = &*self.limb;
        let active = limb.active_entries();
        let entry = limb.columns.of_effect(EffectKind::Elasticity, joint)[0];
        let Some(at) = active.iter().position(|&e| e == entry) else {
            return false;
        };
        let held = self.load_held_us(joint);
        let samples: Vec<[usize; 2]> = limb.windows.iter().map(|w| w.samples).collect();
        let is_steady = |window: usize| {
            let [first, last] = samples[window];
            held[first] >= SETTLED_US && held[last] > held[first]
        };
        let (_, steady) = limb.fold_windows(is_steady).without_each(&limb.columns);
        let triangle = Triangle::new(
            &limb.columns,
            &limb.prior,
            &steady,
            &limb.fit.noise,
            &active,
            &[],
        );
        let known = limb.corrections.compliance[joint];
        let all = known + limb.fit.theta[entry];
        let share = (known + triangle.solve(limb.columns.entries.len(), &[])[entry]) / all;
        let std = triangle.std()[at] * limb.memory[joint].sqrt() / all;
        share < MOST_STEADY && 1.0 - share > LEAST_STEADY_Z * std
    }

    /// For how long, at each sample, a joint's load has kept its sign, µs.
    fn load_held_us(&self, joint: usize) -> Vec<u64> {
        let (recording, motion) = (self.limb.recording, &self.limb.motion);
        let time = &recording.time_us;
        let sign = |k: usize| motion.states[k * recording.joints + joint].load.signum();
        let mut held = Vec::with_capacity(time.len());
        for stretch in recording.stretches() {
            let mut since = stretch.start;
            for k in stretch {
                if sign(k) != sign(since) {
                    since = k;
                }
                held.push(time[k] - time[since]);
            }
        }
        held
    }

    /// Takes play into the model in the place of what looks like it, if its sum of squares is at most so many times as large.
    /// What is found of it then.
    fn take_play_for(&mut self, place: Place, most: f64) -> Option<Play> {
        let joint = place.1;
        let play = (EffectKind::Backlash, joint);
        let without = self.limb.fit.held_out_squares.by_joint[joint];
        self.exchange(place, play);
        let with_play = self.limb.fit.held_out_squares.by_joint[joint];
        if with_play < most * without && self.steps.iter().any(|step| step.place == play) {
            let entry = *self.limb.columns.of_effect(play.0, joint).first()?;
            return Some(Play {
                gain: 1.0 - with_play / self.start.by_joint[joint],
                gap: self.limb.corrections.gap[joint] + self.limb.fit.theta[entry],
                std: self.limb.fit.std[entry] * self.limb.memory[joint].sqrt(),
            });
        }
        self.exchange(play, place);
        self.refused.for_good(play);
        None
    }

    /// Takes one effect out and another one in.
    fn exchange(&mut self, out: Place, into: Place) {
        self.steps.retain(|step| step.place != out);
        self.limb.remove(out);
        self.limb.add(into);
        self.push(into, false);
        self.settle();
    }
}

/// Play as it is found once it is in the model: before, its column is that of a gap not yet known.
struct Play {
    /// 1 − the joint's held-out sum of squares with it over that without.
    gain: f64,
    /// rad.
    gap: f64,
    std: f64,
}

/// Says that play stands where a spring or a delay was named, or may stand there.
fn name_play(first: &mut [Judged], place: Place, found: Option<Play>) {
    let play = (EffectKind::Backlash, place.1);
    if first.first().is_none_or(|j| j.candidate.place != place) {
        return;
    }
    let at = first.iter().position(|j| j.candidate.place == play);
    match (found, at) {
        (Some(found), Some(at)) => {
            first[..=at].rotate_right(1);
            let named = &mut first[0];
            named.held_out_gain.0 = found.gain;
            named.candidate.z = found.gap / found.std;
            (named.parameters[0].value, named.parameters[0].std) = (found.gap, found.std);
            (named.significant, named.in_bounds) = (true, true);
            named.alternatives = vec![place];
        }
        _ => first[0].alternatives.push(play),
    }
}
