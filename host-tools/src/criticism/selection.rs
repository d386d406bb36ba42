//! Forward-backward selection over the catalogue: the effects a limb's model lacks, one after the other.

use proprio_core::effect::EffectKind;

use super::bursts::Bursts;
use super::diagnosis::ParameterReport;
use super::limb::{Candidate, LimbCriticism, Place, sum_and_error};

/// An effect counts from this size on, in units of its standard deviation: with some two hundred candidates, chance reaches
/// four once in a hundred complete models.
const LEAST_Z: f64 = 4.5;
/// What an effect adds in some stretches of time it may take back in others up to this share.
const MOST_HARM: f64 = 0.2;
/// Smallest held-out gain of the joints that feel an effect: less is not worth a parameter.
const LEAST_GAIN: f64 = 0.02;
/// The same of effects that change as slowly as the position, or act at few moments: in one window they are small, and sure over
/// many.
const LEAST_GAIN_OF_SLOW: f64 = 0.005;
/// Most effects that a limb is given.
const MOST_STEPS: usize = 16;
/// Most times that the data are gone over again.
const MOST_POLISHES: usize = 6;
/// They are gone over once more while that makes the held-out error smaller by this factor.
const WORTH_POLISHING: f64 = 0.98;
/// Going over the data again may make the held-out sum of squares larger by this factor,
const MOST_RISE: f64 = 1.01;
/// unless an effect keeps at least this share of what its derivative promised.
const LEAST_KEPT: f64 = 0.5;
/// What looks like a spring between motor and link is play if at least this share of the error stays with it,
const LEAST_LEFT: f64 = 0.55;
/// at least this share of whose square is more than noise with the same median,
const LEAST_IMPACT: f64 = 0.25;
/// in at least this share of the windows.
const LEAST_IMPACTS: f64 = 0.013;
/// An effect whose held-out gain is at least this share of the best one's may be what the best one only resembles.
const RIVAL: f64 = 0.3;

/// One effect taken into a limb's model, and the limb's held-out error with it.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(crate) place: Place,
    /// Sum of squared residuals of each joint, all folds, (N m)².
    pub(crate) rss: Vec<f64>,
    pub(crate) removed: bool,
}

/// A limb's way from its model to one that lacks nothing.
pub(crate) struct Path {
    /// What each effect would add to the model as it was given, best first.
    pub(crate) first: Vec<Judged>,
    /// Held-out sums of squares of the model as it was given, (N m)².
    pub(crate) start: Vec<f64>,
    /// The same once velocities are put right.
    pub(crate) after_velocity: Vec<f64>,
    pub(crate) steps: Vec<Step>,
}

/// A candidate and the verdict on it.
#[derive(Debug, Clone)]
pub(crate) struct Judged {
    pub(crate) candidate: Candidate,
    /// 1 − RSS with / RSS without on held-out data, and its error.
    pub(crate) held_out_gain: (f64, f64),
    /// Its parameters, as the catalogue means them.
    pub(crate) parameters: Vec<ParameterReport>,
    /// Whether it is there beyond chance.
    pub(crate) significant: bool,
    /// Whether its value is physical.
    pub(crate) in_bounds: bool,
    /// Effects that this one cannot be told from on these data.
    pub(crate) alternatives: Vec<Place>,
}

/// Whether a candidate is there beyond chance, and large enough to be worth a place.
fn is_significant(limb: &LimbCriticism, candidate: &Candidate) -> bool {
    let (gain, error) = candidate.gain();
    let harm: f64 = candidate.gains.iter().map(|gain| gain.min(0.0)).sum();
    let least_gain = match candidate.place.0 {
        EffectKind::Bias
        | EffectKind::Spring
        | EffectKind::EncoderOffset
        | EffectKind::BaseTilt
        | EffectKind::Payload
        | EffectKind::Saturation => LEAST_GAIN_OF_SLOW,
        _ => LEAST_GAIN,
    };
    candidate.z >= LEAST_Z
        && gain > error
        && -harm < MOST_HARM * (gain - harm)
        && limb.held_out_gain(candidate).0 > least_gain
        && limb.in_bounds(candidate)
        && limb.is_resolved(candidate)
}

/// The place of the best of significant candidates, best first; of two that differ by less than the error of their
/// difference, the one with fewer parameters.
fn best(candidates: &[&Candidate]) -> Option<Place> {
    let first = candidates.first()?;
    let as_good = |c: &&&Candidate| {
        let differences: Vec<f64> = first
            .gains
            .iter()
            .zip(&c.gains)
            .map(|(a, b)| a - b)
            .collect();
        let (difference, error) = sum_and_error(&differences);
        difference < error.max(LEAST_Z * LEAST_Z)
    };
    let mut simplest = first;
    for candidate in candidates.iter().filter(as_good) {
        if candidate.entries.len() < simplest.entries.len() {
            simplest = candidate;
        }
    }
    Some(simplest.place)
}

/// Held-out sum of squares in units of these noises.
fn weighted(rss: &[Vec<f64>], noise: &[f64]) -> f64 {
    let squares = total(rss).into_iter().zip(noise);
    squares
        .map(|(square, noise)| square / (noise * noise))
        .sum()
}

/// The factor by which sums of squares differ, mean over joints.
fn mean_ratio(a: &[f64], b: &[f64]) -> f64 {
    let ratios = a.iter().zip(b).map(|(a, b)| a / b.max(f64::MIN_POSITIVE));
    ratios.sum::<f64>() / a.len().max(1) as f64
}

fn total(rss: &[Vec<f64>]) -> Vec<f64> {
    let joints = rss.first().map_or(0, Vec::len);
    (0..joints)
        .map(|j| rss.iter().map(|fold| fold[j]).sum())
        .collect()
}

/// What each effect would add to the model as it is, and that model's held-out sums of squares.
pub(crate) fn first(limb: &LimbCriticism) -> (Vec<Judged>, Vec<f64>) {
    (
        judge(limb, limb.candidates(None)),
        limb.fit.held_out_squares.clone(),
    )
}

/// Goes the whole way for one limb.
pub(crate) fn walk(limb: &mut LimbCriticism) -> Path {
    let (mut first, start) = first(limb);
    let significant = first.iter().find(|j| j.significant);
    let mut next = significant.map(|j| j.candidate.place);
    let mut walk = Walk {
        limb,
        steps: Vec::new(),
        refused: Vec::new(),
        polishes: 0,
        start: start.clone(),
    };
    let mut is_settled = false;
    loop {
        match next {
            Some(place) => {
                if walk.take(place) {
                    // What a wrong shape leaves looks like other effects.
                    let is_elastic = place.0 == EffectKind::Elasticity;
                    is_settled =
                        is_elastic || place.0.description().parameters.iter().any(|p| p.shape);
                    if is_settled {
                        walk.settle();
                    }
                    if is_elastic && walk.is_play(place.1) {
                        let found = walk.take_for_spring(place.1);
                        name_play(&mut first, place.1, found);
                    }
                }
            }
            None if !is_settled && walk.settle() => is_settled = true,
            None => break,
        }
        next = walk.next();
    }
    walk.prune();
    Path {
        first,
        after_velocity: start.clone(),
        start,
        steps: walk.steps,
    }
}

/// A limb's way so far.
struct Walk<'a, 'b> {
    limb: &'a mut LimbCriticism<'b>,
    steps: Vec<Step>,
    /// Effects that did not keep what they promised.
    refused: Vec<Place>,
    polishes: usize,
    /// Held-out sums of squares before the first step, (N m)².
    start: Vec<f64>,
}

impl Walk<'_, '_> {
    /// The effect to be taken next.
    fn next(&self) -> Option<Place> {
        if self.steps.len() >= MOST_STEPS {
            return None;
        }
        let candidates = self.limb.candidates(None);
        let is_good =
            |c: &&Candidate| !self.refused.contains(&c.place) && is_significant(self.limb, c);
        best(&candidates.iter().filter(is_good).collect::<Vec<_>>())
    }

    fn push(&mut self, place: Place, removed: bool) {
        self.steps.push(Step {
            place,
            rss: self.limb.fit.held_out_squares.clone(),
            removed,
        });
    }

    /// Takes an effect into the model, if it keeps what it promised.
    fn take(&mut self, place: Place) -> bool {
        let noise = self.limb.fit.noise.clone();
        let before = weighted(&self.limb.fit.rss, &noise);
        self.limb.add(place);
        let keeps = self.limb.is_physical(place) && weighted(&self.limb.fit.rss, &noise) < before;
        if keeps {
            self.push(place, false);
        } else {
            self.limb.remove(place);
            self.refused.push(place);
        }
        keeps
    }

    /// Whether what a spring between motor and link was taken for is play: a spring leaves noise, play leaves impacts, which no
    /// column has.
    fn is_play(&self, joint: usize) -> bool {
        let left = self.limb.fit.held_out_squares[joint] / self.start[joint];
        let residuals = self.limb.held_out_residuals(joint);
        let impacts = |b: &Bursts| {
            b.share > LEAST_IMPACT && b.large.len() as f64 > LEAST_IMPACTS * residuals.len() as f64
        };
        left.sqrt() > LEAST_LEFT && Bursts::of(&residuals).as_ref().is_some_and(impacts)
    }

    /// Takes play into the model for the spring, if it explains more. What is found of it then.
    fn take_for_spring(&mut self, joint: usize) -> Option<Play> {
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

    /// Goes over the data again while it helps. False if there was no reason to.
    fn settle(&mut self) -> bool {
        let mut did = false;
        while self.polishes < MOST_POLISHES {
            self.polishes += 1;
            match self.polish() {
                None => break,
                Some(change) => {
                    did = true;
                    if change > WORTH_POLISHING {
                        break;
                    }
                }
            }
        }
        did
    }

    /// Goes over the data again: what is left may tell a shape that was hidden before, and derivatives hold better near where
    /// they are used. The factor by which the held-out sum of squares changes; `None` if there is no reason to. An effect whose
    /// derivative misled is taken out again.
    fn polish(&mut self) -> Option<f64> {
        let limb = &mut *self.limb;
        if !limb.scan_shapes() && !limb.is_linearised() {
            return None;
        }
        let (fit, corrections, columns) = (
            limb.fit.clone(),
            limb.corrections.clone(),
            limb.columns.clone(),
        );
        limb.relinearise();
        // Not the whitened rows' sums: they may have been whitened for another noise.
        let after = &limb.fit.held_out_squares;
        let mut change = mean_ratio(after, &fit.held_out_squares);
        let misled = self
            .steps
            .iter()
            .rposition(|step| limb.is_correction(step.place));
        if let Some(misled) = misled
            && change > MOST_RISE
        {
            let step = &self.steps[misled];
            let without = misled
                .checked_sub(1)
                .map_or(&self.start, |before| &self.steps[before].rss);
            let promised = 1.0 - mean_ratio(&step.rss, without);
            if 1.0 - mean_ratio(after, without) < LEAST_KEPT * promised {
                let place = self.steps.remove(misled).place;
                (limb.fit, limb.corrections, limb.columns) = (fit, corrections, columns);
                limb.remove(place);
                self.refused.push(place);
                // All else is to be judged again without it.
                change = 0.0;
            }
        }
        if let Some(step) = self.steps.last_mut() {
            step.rss = self.limb.fit.held_out_squares.clone();
        }
        Some(change)
    }

    /// Takes out again what has become superfluous.
    fn prune(&mut self) {
        let added: Vec<Place> = self.steps.iter().map(|step| step.place).collect();
        for place in added {
            if self.limb.is_superfluous(place) {
                self.limb.remove(place);
                self.push(place, true);
            }
        }
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

/// Says that play stands where a spring was named, or may stand there.
fn name_play(first: &mut [Judged], joint: usize, found: Option<Play>) {
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

/// Judges candidates, best first, and finds the best one's look-alikes.
fn judge(limb: &LimbCriticism, candidates: Vec<Candidate>) -> Vec<Judged> {
    let mut judged: Vec<Judged> = candidates
        .into_iter()
        .map(|candidate| Judged {
            significant: is_significant(limb, &candidate),
            in_bounds: limb.in_bounds(&candidate),
            alternatives: Vec::new(),
            held_out_gain: limb.held_out_gain(&candidate),
            parameters: limb.parameters(&candidate),
            candidate,
        })
        .collect();
    let significant: Vec<&Candidate> = judged
        .iter()
        .filter(|j| j.significant)
        .map(|j| &j.candidate)
        .collect();
    let Some(place) = best(&significant) else {
        return judged;
    };
    let Some(best) = judged.iter().position(|j| j.candidate.place == place) else {
        return judged;
    };
    // First, though another with more parameters may have gained a little more by chance.
    judged[..=best].rotate_right(1);
    let best = 0;
    let (most, _) = judged[best].candidate.gain();
    let rivals: Vec<Place> = judged
        .iter()
        .filter(|j| j.candidate.place != place && j.candidate.gain().0 >= RIVAL * most)
        .map(|j| j.candidate.place)
        .collect();
    judged[best].alternatives = rivals
        .into_iter()
        .filter(|&rival| explains(limb, rival, place))
        .collect();
    if place.0 == EffectKind::Bias && limb.active.contains(&(EffectKind::Coulomb, place.1)) {
        // With Coulomb friction in the model, friction that differs with the direction is a bias but at rest.
        judged[best]
            .alternatives
            .push((EffectKind::AsymmetricCoulomb, place.1));
    }
    judged
}

/// Whether with `rival` in the model `place` adds nothing beyond its error: then the data cannot rule the rival out.
fn explains(limb: &LimbCriticism, rival: Place, place: Place) -> bool {
    let with = limb.candidates(Some(rival));
    let Some(left) = with.iter().find(|c| c.place == place) else {
        return false;
    };
    let (gain, error) = left.gain();
    left.z < LEAST_Z || gain <= error
}
