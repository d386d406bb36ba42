//! Play or a spring between motor and link: to a first order the link lags the torque in both.

use proprio_core::effect::EffectKind;

use super::super::bursts::Bursts;
use super::super::limb::Place;
use super::Judged;
use super::walk::Walk;

/// What looks like a spring between motor and link is play if at least this share of the error stays with it,
const LEAST_LEFT: f64 = 0.55;
/// at least this share of whose square is more than noise with the same median,
const LEAST_IMPACT: f64 = 0.25;
/// in at least this share of the windows.
const LEAST_IMPACTS: f64 = 0.013;

impl Walk<'_, '_> {
    /// Whether what a spring between motor and link was taken for is play: a spring leaves noise, play leaves impacts, which no
    /// column has.
    pub(super) fn is_play(&self, joint: usize) -> bool {
        let left = self.limb.fit.held_out_squares[joint] / self.start[joint];
        let residuals = self.limb.held_out_residuals(joint);
        let impacts = |b: &Bursts| {
            b.share > LEAST_IMPACT && b.large.len() as f64 > LEAST_IMPACTS * residuals.len() as f64
        };
        left.sqrt() > LEAST_LEFT && Bursts::of(&residuals).as_ref().is_some_and(impacts)
    }

    /// Takes play into the model for the spring, if it explains more. What is found of it then.
    pub(super) fn take_for_spring(&mut self, joint: usize) -> Option<Play> {
        let (spring, play) = (
            (EffectKind::Elasticity, joint),
            (EffectKind::Backlash, joint),
        );
        let with_spring = self.limb.fit.held_out_squares[joint];
        self.exchange(spring, play);
        let with_play = self.limb.fit.held_out_squares[joint];
        if with_play < with_spring && self.steps.iter().any(|step| step.place == play) {
            let entry = *self.limb.columns.of_effect(play.0, joint).first()?;
            return Some(Play {
                gain: 1.0 - with_play / self.start[joint],
                gap: self.limb.corrections.gap[joint] + self.limb.fit.theta[entry],
                std: self.limb.fit.std[entry] * self.limb.memory[joint].sqrt(),
            });
        }
        self.exchange(play, spring);
        None
    }

    /// Takes one effect out and another one in.
    fn exchange(&mut self, out: Place, into: Place) {
        self.steps.retain(|step| step.place != out);
        self.limb.remove(out);
        self.refused.push(out);
        self.refused.retain(|place| *place != into);
        self.limb.add(into);
        self.push(into, false);
        self.settle();
    }
}

/// Play as it is found once it is in the model: before, its column is that of a gap not yet known.
pub(super) struct Play {
    /// 1 − the joint's held-out sum of squares with it over that without.
    gain: f64,
    /// rad.
    gap: f64,
    std: f64,
}

/// Says that play stands where a spring was named, or may stand there.
pub(super) fn name_play(first: &mut [Judged], joint: usize, found: Option<Play>) {
    let (spring, play) = (
        (EffectKind::Elasticity, joint),
        (EffectKind::Backlash, joint),
    );
    if first.first().is_none_or(|j| j.candidate.place != spring) {
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
            named.alternatives = vec![spring];
        }
        _ => first[0].alternatives.push(play),
    }
}
