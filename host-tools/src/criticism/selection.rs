//! Forward-backward selection over the catalogue: the effects a limb's model lacks, one after the other.

mod play;
mod refused;
mod walk;

use proprio_core::effect::EffectKind;

use super::diagnosis::ParameterReport;
use super::limb::{Candidate, LimbCriticism, Place, Squares, sum_and_error};

pub(crate) use walk::walk;

/// An effect counts from this size on, in units of its standard deviation: a leg has some sixty candidates, of which chance
/// makes one this large once in two hundred complete models.
const LEAST_Z: f64 = 4.0;
/// The same of effects whose shape is scanned: refinement tries more shapes than the grid has.
const LEAST_Z_OF_SCANNED: f64 = 4.5;
/// What an effect adds in some stretches of time it may take back in others up to this share.
const MOST_HARM: f64 = 0.2;
/// Smallest held-out gain of the joints that feel an effect: less is not worth a parameter.
const LEAST_GAIN: f64 = 0.02;
/// The same of effects that change as slowly as the position, or act at few moments: in one window they are small, and sure over
/// many.
const LEAST_GAIN_OF_SLOW: f64 = 0.005;
/// What is so sure, and explains so much of a joint's error, tells of something else if its value cannot be.
const SURE_Z: f64 = 5.0;
const SURE_GAIN: f64 = 0.05;
/// An effect whose held-out gain is at least this share of the best one's may be what the best one only resembles.
const RIVAL: f64 = 0.3;

/// One effect taken into a limb's model, and the limb's held-out error with it.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(crate) place: Place,
    /// Sum of squared residuals of each joint, as they are, all folds, (N m)².
    pub(crate) squares: Squares,
    pub(crate) removed: bool,
}

/// A limb's way from its model to one that lacks nothing.
pub(crate) struct Path {
    /// What each effect would add to the model as it was given, best first.
    pub(crate) first: Vec<Judged>,
    /// Held-out sums of squares of the model as it was given, (N m)².
    pub(crate) start: Squares,
    /// The same once velocities are put right.
    pub(crate) after_velocity: Squares,
    pub(crate) steps: Vec<Step>,
    /// What would explain much of what is left, if its value were physical.
    pub(crate) unphysical: Vec<Judged>,
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

/// From which size on an effect counts, standard deviations.
fn least_z(place: Place) -> f64 {
    match place.0.description().shape() {
        Some(_) => LEAST_Z_OF_SCANNED,
        None => LEAST_Z,
    }
}

/// Whether a candidate is larger than chance makes one, and helps with data that were held out.
fn is_beyond_chance(candidate: &Candidate) -> bool {
    let (gain, error) = candidate.gain();
    candidate.z >= least_z(candidate.place) && gain > error
}

/// Whether a candidate is there beyond chance, large enough to be worth a place, and physical.
fn is_significant(limb: &LimbCriticism, candidate: &Candidate) -> bool {
    is_there(limb, candidate) && limb.in_bounds(candidate)
}

/// Whether a candidate is there beyond chance and large enough to be worth a place, whatever its value.
fn is_there(limb: &LimbCriticism, candidate: &Candidate) -> bool {
    let (gain, _) = candidate.gain();
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
    is_beyond_chance(candidate)
        && -harm < MOST_HARM * (gain - harm)
        && limb.held_out_gain(candidate).0 > least_gain
        && limb.is_resolved(candidate)
}

/// The place of the best of significant candidates, best first.
///
/// Candidates whose held-out gains differ by less than the error of their difference, or by less than ln n for each parameter
/// more, n windows, are equals there. Among them counts how much the sum of squares of all data and of the CAD's prior falls, less
/// ln n for each parameter (Schwarz 1978, *Annals of Statistics* 6:461): what a heavier body explains as well as an effect does
/// may yet be a body that the CAD rules out. A simpler rival that is [there anyhow](there_anyhow) goes before.
fn best(limb: &LimbCriticism, candidates: &[&Candidate]) -> Option<Place> {
    let first = candidates.first()?;
    // Scanned shapes count as well.
    let parameters = |c: &Candidate| c.place.0.description().parameters.len() as f64;
    let windows: f64 = limb.all.iter().map(|factor| factor.rows()).sum();
    let is_equal = |c: &&&Candidate| {
        let differences: Vec<f64> = first
            .gains
            .iter()
            .zip(&c.gains)
            .map(|(a, b)| a - b)
            .collect();
        let (difference, error) = sum_and_error(&differences);
        let more = (parameters(first) - parameters(c)).max(0.0);
        // The first is its own equal.
        difference <= error.max(more * windows.ln())
    };
    let worth = |c: &Candidate| c.fall - parameters(c) * windows.ln();
    let equals = candidates.iter().filter(is_equal);
    let best = equals.max_by(|a, b| worth(a).total_cmp(&worth(b)))?;
    let is_simpler =
        |c: &&&Candidate| parameters(c) < parameters(best) && c.gain().0 >= RIVAL * best.gain().0;
    let simpler = candidates.iter().filter(is_simpler).map(|c| c.place);
    let simpler: Vec<Place> = simpler.collect();
    Some(there_anyhow(limb, &simpler, best.place).unwrap_or(best.place))
}

/// The first of simpler rivals that is there beyond chance even beside `place`, which may gain more only because it takes up part
/// of several: a load on a calf swings with it as its rotor turns. What is there anyhow comes first.
fn there_anyhow(limb: &LimbCriticism, simpler: &[Place], place: Place) -> Option<Place> {
    if simpler.is_empty() {
        return None;
    }
    let beside = limb.candidates(Some(place));
    let is_there = |simple: &&Place| {
        let found = beside.iter().find(|c| c.place == **simple);
        found.is_some_and(|c| is_beyond_chance(c) && limb.in_bounds(c))
    };
    simpler.iter().find(is_there).copied()
}

/// Of each joint over all folds.
fn total(rss: &[Vec<f64>]) -> Vec<f64> {
    let joints = rss.first().map_or(0, Vec::len);
    (0..joints)
        .map(|j| rss.iter().map(|fold| fold[j]).sum())
        .collect()
}

/// What is there beyond all doubt, but with a value that cannot be: of each joint the best.
fn unphysical(limb: &LimbCriticism) -> Vec<Judged> {
    let is_it = |c: &Candidate| {
        c.z >= SURE_Z
            && limb.held_out_gain(c).0 > SURE_GAIN
            && is_there(limb, c)
            && !limb.in_bounds(c)
    };
    let mut found: Vec<Judged> = Vec::new();
    for candidate in limb.candidates(None).into_iter().filter(is_it) {
        if found
            .iter()
            .all(|known| known.candidate.place.1 != candidate.place.1)
        {
            found.push(judged(limb, candidate));
        }
    }
    found
}

/// What each effect would add to the model as it is, and that model's held-out sums of squares.
pub(crate) fn first(limb: &LimbCriticism) -> (Vec<Judged>, Squares) {
    (
        judge(limb, limb.candidates(None)),
        limb.fit.held_out_squares.clone(),
    )
}

fn judged(limb: &LimbCriticism, candidate: Candidate) -> Judged {
    Judged {
        significant: is_significant(limb, &candidate),
        in_bounds: limb.in_bounds(&candidate),
        alternatives: Vec::new(),
        held_out_gain: limb.held_out_gain(&candidate),
        parameters: limb.parameters(&candidate),
        candidate,
    }
}

/// Judges candidates, best first, and finds the best one's look-alikes.
fn judge(limb: &LimbCriticism, candidates: Vec<Candidate>) -> Vec<Judged> {
    let mut judged: Vec<Judged> = candidates
        .into_iter()
        .map(|candidate| judged(limb, candidate))
        .collect();
    let significant: Vec<&Candidate> = judged
        .iter()
        .filter(|j| j.significant)
        .map(|j| &j.candidate)
        .collect();
    let Some(place) = best(limb, &significant) else {
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
    let left = with.iter().find(|c| c.place == place);
    left.is_some_and(|left| !is_beyond_chance(left))
}
