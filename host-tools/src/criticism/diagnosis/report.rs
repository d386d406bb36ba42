//! The limbs' walks as one diagnosis.

use proprio_core::effect::EffectKind;

use super::super::bursts::bursts;
use super::super::contact;
use super::super::drift::Drift;
use super::super::recording::Recording;
use super::super::residual;
use super::super::selection::Judged;
use super::super::series::JointSeries;
use super::path::path;
use super::{CandidateReport, Diagnosis, JointError, Verdict, Walked, words};
use crate::model::Model;

/// A joint with fewer windows in motion cannot be judged.
const LEAST_WINDOWS: usize = 100;
/// Share of a joint's error above the noise floor that is taken for a missing effect if tests find structure in it, %.
const MOST_ABOVE_NOISE: f64 = 20.0;

/// What the limbs' walks say together.
pub(super) fn report(recording: &Recording, model: &Model, walked: &[Walked]) -> Diagnosis {
    let mut candidates = contacts(walked, model);
    candidates.extend(velocities(walked, model));
    candidates.extend(from_catalogue(walked, model));
    let joints: Vec<JointError> = (walked.iter())
        .flat_map(|limb| limb.joint_errors(model))
        .collect();
    let windows: f64 = joints.iter().map(|j| j.n as f64).sum();
    let rms = |of: fn(&JointError) -> f64| {
        let squares: f64 = joints.iter().map(|j| of(j).powi(2) * j.n as f64).sum();
        (squares / windows).sqrt()
    };
    let (log_rms, path) = path(walked, model);
    let outside_catalogue = outside(walked, model);
    let still: Vec<&str> = joints
        .iter()
        .filter(|j| j.n < LEAST_WINDOWS)
        .map(|j| &*j.joint)
        .collect();
    let significant = candidates.iter().any(|c| c.significant);
    let verdict = match (
        significant || !outside_catalogue.is_empty(),
        still.is_empty(),
    ) {
        (true, _) => Verdict::Missing,
        (false, true) => Verdict::Complete,
        (false, false) => Verdict::Insufficient,
    };
    let by_contact = candidates
        .first()
        .is_some_and(|c| c.effect == EffectKind::Contact.name());
    let (reason, next) = if by_contact {
        contact::reason(&candidates)
    } else {
        words::reason(verdict, &candidates, &outside_catalogue, &still)
    };
    Diagnosis {
        verdict,
        reason,
        next,
        candidates,
        path,
        held_out_rms: rms(|j| j.before),
        log_rms,
        noise_floor_rms: rms(|j| j.floor),
        joints,
        outside_catalogue,
        logs: recording.logs.clone(),
        warnings: (recording.warnings.iter().cloned())
            .chain(contact_words(walked, model))
            .collect(),
    }
}

/// The velocities that are reported wrong, the joints' largest gain first.
fn velocities(walked: &[Walked], model: &Model) -> Vec<CandidateReport> {
    let of = |limb: &Walked| -> Vec<CandidateReport> {
        let wrong = limb.velocity.iter();
        wrong
            .map(|(joint, gain)| limb.velocity_candidate(*joint, gain, model))
            .collect()
    };
    let mut candidates: Vec<CandidateReport> = walked.iter().flat_map(of).collect();
    candidates.sort_by(|a, b| b.held_out_gain.total_cmp(&a.held_out_gain));
    candidates
}

/// What torques tell: limb by limb in their own order; limbs by what is missing most.
fn from_catalogue(walked: &[Walked], model: &Model) -> Vec<CandidateReport> {
    let gain = |j: &Judged| j.candidate.gain().0;
    let mut ranked: Vec<(bool, f64, &Walked, &Judged)> = Vec::new();
    for limb in walked {
        let mut least = f64::INFINITY;
        let significant = limb.path.first.iter().filter(|j| j.significant);
        let most = significant.map(gain).fold(f64::MIN, f64::max);
        for (n, judged) in limb.path.first.iter().enumerate() {
            let own = if n == 0 && judged.significant {
                most
            } else {
                gain(judged)
            };
            least = least.min(own);
            ranked.push((judged.significant, least, limb, judged));
        }
    }
    ranked.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
    ranked
        .iter()
        .map(|(_, _, limb, judged)| limb.candidate(judged, model))
        .collect()
}

/// The forces at feet that the model does not have, the joints' best agreement first.
fn contacts(walked: &[Walked], model: &Model) -> Vec<CandidateReport> {
    let reports = walked.iter().filter_map(|limb| {
        let contact = limb.contact.as_ref().filter(|c| !c.known)?;
        Some(contact.contact.report(limb.foot(model)))
    });
    let mut contacts: Vec<CandidateReport> = reports.collect();
    contacts.sort_by(|a, b| b.held_out_gain.total_cmp(&a.held_out_gain));
    contacts
}

/// What contact means for the rest of the diagnosis.
fn contact_words(walked: &[Walked], model: &Model) -> Vec<String> {
    let of = |limb: &Walked| Some((limb.foot(model), limb.contact.clone()?));
    contact::words(&walked.iter().filter_map(of).collect::<Vec<_>>())
}

/// What the catalogue's effects leave, joint by joint, where it is more than noise.
fn outside(walked: &[Walked], model: &Model) -> Vec<String> {
    let views: Vec<_> = (walked.iter().flat_map(|limb| &limb.series))
        .map(JointSeries::view)
        .collect();
    let left = residual::criticise(&views).into_iter().filter(|joint| {
        joint.structure_remains()
            && joint
                .above_noise_percent
                .is_some_and(|share| share > MOST_ABOVE_NOISE)
    });
    let structures = left.map(|joint| {
        let share = joint.above_noise_percent.unwrap_or(0.0);
        let place = joint
            .patterns
            .first()
            .map_or(String::new(), |pattern| format!(" {}", pattern.sentence));
        let words = format!(
            "no effect of the catalogue explains {share:.0} % of the error that is left.{place}"
        );
        (joint.joint.clone(), words)
    });
    let drifts = walked.iter().flat_map(|limb| {
        let of = |drift: &Drift| {
            (
                limb.name(drift.joint, model),
                words::drift(drift, limb.criticism.blocks.by_log),
            )
        };
        limb.drifts.iter().map(of)
    });
    let series = walked.iter().flat_map(|limb| &limb.series);
    let bursts = series.filter_map(|series| Some((series.joint.clone(), bursts(series)?)));
    let unphysical = walked.iter().flat_map(|limb| {
        let of = |judged: &Judged| {
            let candidate = limb.candidate(judged, model);
            (candidate.joints.join(", "), words::unphysical(&candidate))
        };
        limb.path.unphysical.iter().map(of)
    });
    let all = structures.chain(drifts).chain(bursts).chain(unphysical);
    // One sentence a joint: they are of one cause, the first says most.
    let mut told: Vec<(String, String)> = Vec::new();
    for (joint, words) in all {
        if told.iter().all(|(known, _)| *known != joint) {
            told.push((joint, words));
        }
    }
    let sentence = |(joint, words)| format!("{joint}: {words}");
    told.into_iter().map(sentence).collect()
}
