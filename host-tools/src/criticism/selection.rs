//! Forward-backward selection over the catalogue: the effects a limb's model lacks, one after the other.

use super::diagnosis::ParameterReport;
use super::limb::{Candidate, LimbCriticism, Place};

/// An effect counts from this size on, in units of its standard deviation: with some two hundred candidates, chance reaches
/// four once in a hundred complete models.
const LEAST_Z: f64 = 4.5;
/// What an effect adds in some stretches of time it may take back in others up to this share.
const MOST_HARM: f64 = 0.2;
/// Most effects that a limb is given.
const MOST_STEPS: usize = 24;
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

/// Whether a candidate is there beyond chance.
fn is_significant(limb: &LimbCriticism, candidate: &Candidate) -> bool {
    let (gain, error) = candidate.gain();
    let harm: f64 = candidate.gains.iter().map(|gain| gain.min(0.0)).sum();
    candidate.z >= LEAST_Z
        && gain > error
        && -harm < MOST_HARM * (gain - harm)
        && limb.in_bounds(candidate)
}

fn total(rss: &[Vec<f64>]) -> Vec<f64> {
    let joints = rss.first().map_or(0, Vec::len);
    (0..joints)
        .map(|j| rss.iter().map(|fold| fold[j]).sum())
        .collect()
}

/// What each effect would add to the model as it is, and that model's held-out sums of squares.
pub(crate) fn first(limb: &LimbCriticism) -> (Vec<Judged>, Vec<f64>) {
    (judge(limb, limb.candidates(None)), total(&limb.fit.rss))
}

/// Goes the whole way for one limb.
pub(crate) fn walk(limb: &mut LimbCriticism) -> Path {
    let (first, start) = first(limb);
    let mut steps: Vec<Step> = Vec::new();
    let mut refused: Vec<Place> = Vec::new();
    let mut best = first
        .iter()
        .find(|j| j.significant)
        .map(|j| j.candidate.place);
    let mut polished = false;
    loop {
        match best {
            Some(place) => {
                limb.add(place);
                if limb.is_physical(place) {
                    steps.push(Step {
                        place,
                        rss: total(&limb.fit.rss),
                        removed: false,
                    });
                    polished = false;
                } else {
                    limb.remove(place);
                    refused.push(place);
                }
            }
            None if limb.is_linearised() && !polished => {
                limb.rebuild();
                polished = true;
                if let Some(step) = steps.last_mut() {
                    step.rss = total(&limb.fit.rss);
                }
            }
            None => break,
        }
        best = None;
        if steps.len() < MOST_STEPS {
            let significant =
                |c: &Candidate| is_significant(limb, c) && !refused.contains(&c.place);
            best = limb
                .candidates(None)
                .into_iter()
                .find(|c| significant(c))
                .map(|c| c.place);
        }
    }
    prune(limb, &mut steps);
    Path {
        first,
        after_velocity: start.clone(),
        start,
        steps,
    }
}

/// Takes out again what has become superfluous.
fn prune(limb: &mut LimbCriticism, steps: &mut Vec<Step>) {
    let added: Vec<Place> = steps.iter().map(|step| step.place).collect();
    for place in added {
        if limb.is_superfluous(place) {
            limb.remove(place);
            steps.push(Step {
                place,
                rss: total(&limb.fit.rss),
                removed: true,
            });
        }
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
    let Some(best) = judged.iter().position(|j| j.significant) else {
        return judged;
    };
    let place = judged[best].candidate.place;
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
