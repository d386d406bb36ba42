//! Which physical effect is missing: the verdict, the ranked effects and the way to a model that lacks none.

mod words;

use std::path::PathBuf;

use proprio_core::effect::EffectKind;
use serde::Serialize;

use super::CriticismError;
use super::column::BASE;
use super::contact;
use super::contact::{LeftOut, leave_out_contact};
use super::limb::{FOLDS, LimbCriticism, Place};
use super::recording::Recording;
use super::residual;
use super::rows::Blocks;
use super::selection::{self, Judged, Path};
use super::series::{JointSeries, Predict};
use super::velocity::VelocityGain;
use crate::model::{Limb, Model};

/// What `proprio diagnose` says.
#[derive(Debug, Clone, Serialize)]
pub struct Diagnosis {
    /// Whether an effect is missing.
    pub verdict: Verdict,
    /// Why, in words.
    pub reason: String,
    /// What to do next, in words.
    pub next: String,
    /// What each effect would add to the model as it was given, best first.
    pub candidates: Vec<CandidateReport>,
    /// Forward-backward selection: the error after each step.
    pub path: Vec<PathStep>,
    /// Held-out error of the model as it was given, root mean square over all joints, N m.
    pub held_out_rms: f64,
    /// Error that no model can go below, N m.
    pub noise_floor_rms: f64,
    /// Each joint's error.
    pub joints: Vec<JointError>,
    /// What is left when the catalogue is exhausted, if it is more than noise.
    pub outside_catalogue: Vec<String>,
    /// The logs.
    pub logs: Vec<PathBuf>,
    /// What a user should know about the logs.
    pub warnings: Vec<String>,
}

/// Whether an effect is missing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The model lacks something.
    Missing,
    /// Nothing is missing that these data can tell.
    Complete,
    /// The data are too short or too poor to say.
    Insufficient,
}

/// What an effect would add.
#[derive(Debug, Clone, Serialize)]
pub struct CandidateReport {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
    /// 1 − RSS with / RSS without, on held-out blocks of the rows that feel it.
    pub held_out_gain: f64,
    /// Its error, from the spread over blocks.
    pub held_out_gain_error: f64,
    /// Size in units of its standard deviation.
    pub z: f64,
    /// Estimated value of its first parameter.
    pub value: f64,
    /// Standard deviation: the larger of what independent residuals give and of the spread over blocks.
    pub std: f64,
    /// All parameters.
    pub parameters: Vec<ParameterReport>,
    /// Whether the value is physical.
    pub in_bounds: bool,
    /// Whether it is there beyond chance.
    pub significant: bool,
    /// What it cannot be told from on these data.
    pub alternatives: Vec<Alternative>,
}

/// A parameter of an effect.
#[derive(Debug, Clone, Serialize)]
pub struct ParameterReport {
    /// Its symbol.
    pub symbol: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Estimated value.
    pub value: f64,
    /// Standard deviation; zero for one that was scanned.
    pub std: f64,
}

/// An effect that cannot be told from another one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Alternative {
    /// Its name.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
}

/// One step of the selection.
#[derive(Debug, Clone, Serialize)]
pub struct PathStep {
    /// The effect.
    pub effect: &'static str,
    /// Where.
    pub joints: Vec<String>,
    /// Held-out error after this step, root mean square over all joints, N m.
    pub held_out_rms: f64,
    /// Whether the effect was taken out again.
    pub removed: bool,
}

/// A joint's held-out errors, root mean square, N m.
#[derive(Debug, Clone, Serialize)]
pub struct JointError {
    /// Which joint.
    pub joint: String,
    /// Windows.
    pub n: usize,
    /// Of the model as it was given.
    pub before: f64,
    /// At the end of the path.
    pub after: f64,
    /// That no model can go below.
    pub floor: f64,
}

/// A joint with fewer windows in motion cannot be judged.
const LEAST_WINDOWS: usize = 100;
/// Share of a joint's error above the noise floor that is taken for a missing effect if tests find structure in it, %.
const MOST_ABOVE_NOISE: f64 = 20.0;

/// One limb, walked to the end.
struct Walked<'a> {
    criticism: LimbCriticism<'a>,
    contact: Option<LeftOut>,
    velocity: Vec<(usize, VelocityGain)>,
    path: Path,
}

/// Diagnoses what `model` lacks on a recording.
///
/// # Errors
/// [`CriticismError`] if no limb can be judged.
pub fn diagnose(recording: &Recording, model: &Model) -> Result<Diagnosis, CriticismError> {
    let mut walked = Vec::new();
    std::thread::scope(|scope| {
        let walks: Vec<_> = recording
            .limbs
            .iter()
            .map(|(limb, _)| scope.spawn(move || walk(recording, model, limb)))
            .collect();
        for walk in walks {
            // A panic goes on.
            walked.push(
                walk.join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            );
        }
    });
    let walked: Vec<Walked> = walked.into_iter().flatten().collect();
    if walked.is_empty() {
        return Err(CriticismError::TooShort {
            duration: recording.duration,
        });
    }
    Ok(report(recording, model, &walked))
}

fn walk<'a>(recording: &'a Recording, model: &'a Model, limb: &'a Limb) -> Option<Walked<'a>> {
    let (limb, data) = recording.limbs.iter().find(|(known, _)| known == limb)?;
    let mut criticism = LimbCriticism::new(model, limb, data, true)?;
    if criticism.blocks.count < FOLDS {
        return None;
    }
    let contact = leave_out_contact(&mut criticism);
    let blocks: Blocks = criticism.blocks;
    let mut velocity = Vec::new();
    for joint in 0..data.joints {
        let place = (EffectKind::VelocityGain, joint);
        if criticism.active.contains(&place) {
            continue;
        }
        if contact.as_ref().is_some_and(|c| c.too_little_swing) {
            break;
        }
        if let Some(gain) = VelocityGain::of(data, joint, blocks)
            && gain.is_significant()
        {
            velocity.push((joint, gain));
        }
    }
    let first = (!velocity.is_empty()).then(|| selection::first(&criticism));
    for (joint, gain) in &velocity {
        criticism.active.push((EffectKind::VelocityGain, *joint));
        criticism.corrections.velocity_gain[*joint] = gain.value;
    }
    if !velocity.is_empty() {
        criticism.rebuild();
    }
    let mut path = match &contact {
        Some(contact) if contact.too_little_swing => Path {
            first: Vec::new(),
            start: contact.after.clone(),
            after_velocity: contact.after.clone(),
            steps: Vec::new(),
        },
        _ => selection::walk(&mut criticism),
    };
    if let Some((first, start)) = first {
        (path.first, path.start) = (first, start);
    }
    if let Some(contact) = &contact {
        path.start.clone_from(&contact.before);
    }
    Some(Walked {
        criticism,
        contact,
        velocity,
        path,
    })
}

impl Walked<'_> {
    fn name(&self, joint: usize, model: &Model) -> String {
        let body = if joint == BASE {
            BASE
        } else {
            self.criticism.limb.bodies.start + joint
        };
        model.joint_name(body).to_owned()
    }

    /// The joint that carries the foot.
    fn foot(&self, model: &Model) -> String {
        self.name(self.criticism.recording.joints - 1, model)
    }

    fn windows(&self) -> Vec<f64> {
        let tests = &self.criticism.tests;
        (0..self.criticism.recording.joints)
            .map(|j| tests.iter().map(|fold| fold[j].rows()).sum())
            .collect()
    }

    fn candidate(&self, judged: &Judged, model: &Model) -> CandidateReport {
        let candidate = &judged.candidate;
        let (effect, joint) = candidate.place;
        let (held_out_gain, held_out_gain_error) = judged.held_out_gain;
        let parameters = judged.parameters.clone();
        CandidateReport {
            effect: effect.name(),
            joints: vec![self.name(joint, model)],
            held_out_gain,
            held_out_gain_error,
            z: candidate.z,
            value: parameters[0].value,
            std: parameters[0].std,
            parameters,
            in_bounds: judged.in_bounds,
            significant: judged.significant,
            alternatives: judged
                .alternatives
                .iter()
                .map(|place| self.alternative(*place, model))
                .collect(),
        }
    }

    fn alternative(&self, (effect, joint): Place, model: &Model) -> Alternative {
        Alternative {
            effect: effect.name(),
            joints: vec![self.name(joint, model)],
        }
    }

    fn velocity_candidate(
        &self,
        joint: usize,
        gain: &VelocityGain,
        model: &Model,
    ) -> CandidateReport {
        let parameter = &EffectKind::VelocityGain.description().parameters[0];
        CandidateReport {
            effect: EffectKind::VelocityGain.name(),
            joints: vec![self.name(joint, model)],
            held_out_gain: gain.held_out_gain,
            held_out_gain_error: gain.error,
            z: gain.z(),
            value: gain.value,
            std: gain.std,
            parameters: vec![ParameterReport {
                symbol: parameter.symbol,
                unit: parameter.unit,
                value: gain.value,
                std: gain.std,
            }],
            in_bounds: true,
            significant: true,
            alternatives: Vec::new(),
        }
    }
}

fn report(recording: &Recording, model: &Model, walked: &[Walked]) -> Diagnosis {
    let mut candidates = Vec::new();
    for limb in walked {
        candidates.extend(
            limb.velocity
                .iter()
                .map(|(joint, gain)| limb.velocity_candidate(*joint, gain, model)),
        );
    }
    candidates.sort_by(|a, b| b.held_out_gain.total_cmp(&a.held_out_gain));
    let mut contacts = contacts(walked, model);
    contacts.append(&mut candidates);
    let mut candidates = contacts;
    // Limb by limb in their own order; limbs by what is missing most.
    let gain = |j: &Judged| j.candidate.gain().0;
    let mut ranked: Vec<(bool, f64, &Walked, &Judged)> = Vec::new();
    for limb in walked {
        let mut least = f64::INFINITY;
        let most = limb
            .path
            .first
            .iter()
            .filter(|j| j.significant)
            .map(gain)
            .fold(f64::MIN, f64::max);
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
    candidates.extend(
        ranked
            .iter()
            .map(|(_, _, limb, judged)| limb.candidate(judged, model)),
    );

    let rms = |rss: f64, n: f64| (rss / n).sqrt();
    let (mut joints, mut floor, mut windows) = (Vec::new(), 0.0, 0.0);
    for limb in walked {
        let floors = limb.criticism.floor();
        let last = limb
            .path
            .steps
            .last()
            .map_or(&limb.path.start, |step| &step.rss);
        for (j, n) in limb.windows().into_iter().enumerate() {
            let after = rms(last[j], n);
            let noise = floors[j].min(after);
            floor += noise * noise * n;
            windows += n;
            joints.push(JointError {
                joint: limb.name(j, model),
                n: n as usize,
                before: rms(limb.path.start[j], n),
                after,
                floor: noise,
            });
        }
    }
    let path = path(walked, model, windows);
    let start: f64 = walked.iter().flat_map(|limb| &limb.path.start).sum();
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
        held_out_rms: rms(start, windows),
        noise_floor_rms: rms(floor, windows),
        joints,
        outside_catalogue,
        logs: recording.logs.clone(),
        warnings: (recording.warnings.iter().cloned())
            .chain(contact_words(walked, model))
            .collect(),
    }
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

/// The limbs' steps as one path: the limbs' first steps, those of one effect together, then their second ones.
fn path(walked: &[Walked], model: &Model, windows: f64) -> Vec<PathStep> {
    let mut now: Vec<Vec<f64>> = walked.iter().map(|limb| limb.path.start.clone()).collect();
    let mut path: Vec<PathStep> = Vec::new();
    let rms = |now: &[Vec<f64>]| (now.iter().flatten().sum::<f64>() / windows).sqrt();
    let mut feet = Vec::new();
    for (now, limb) in now.iter_mut().zip(walked) {
        if let Some(contact) = limb.contact.as_ref().filter(|c| !c.known) {
            now.clone_from(&contact.after);
            feet.push(limb.foot(model));
        }
    }
    if !feet.is_empty() {
        path.push(PathStep {
            effect: EffectKind::Contact.name(),
            joints: feet,
            held_out_rms: rms(&now),
            removed: false,
        });
    }
    for (n, limb) in walked.iter().enumerate() {
        for (joint, _) in &limb.velocity {
            let joints = vec![limb.name(*joint, model)];
            path.push(PathStep {
                effect: EffectKind::VelocityGain.name(),
                joints,
                held_out_rms: rms(&now),
                removed: false,
            });
        }
        now[n].clone_from(&limb.path.after_velocity);
    }
    if let Some(last) = path.last_mut()
        && last.effect == EffectKind::VelocityGain.name()
    {
        last.held_out_rms = rms(&now);
    }
    let rounds = walked
        .iter()
        .map(|limb| limb.path.steps.len())
        .max()
        .unwrap_or(0);
    for round in 0..rounds {
        let mut groups: Vec<(EffectKind, bool, Vec<usize>)> = Vec::new();
        for (n, limb) in walked.iter().enumerate() {
            let Some(step) = limb.path.steps.get(round) else {
                continue;
            };
            match groups
                .iter_mut()
                .find(|(effect, removed, _)| (*effect, *removed) == (step.place.0, step.removed))
            {
                Some((_, _, limbs)) => limbs.push(n),
                None => groups.push((step.place.0, step.removed, vec![n])),
            }
        }
        let fall = |limbs: &[usize]| -> f64 {
            let of = |&n: &usize| -> f64 {
                now[n].iter().sum::<f64>() - walked[n].path.steps[round].rss.iter().sum::<f64>()
            };
            limbs.iter().map(of).sum()
        };
        groups.sort_by(|a, b| fall(&b.2).total_cmp(&fall(&a.2)));
        for (effect, removed, limbs) in groups {
            let mut joints = Vec::new();
            for n in limbs {
                let step = &walked[n].path.steps[round];
                now[n].clone_from(&step.rss);
                let name = walked[n].name(step.place.1, model);
                if !joints.contains(&name) {
                    joints.push(name);
                }
            }
            path.push(PathStep {
                effect: effect.name(),
                joints,
                held_out_rms: rms(&now),
                removed,
            });
        }
    }
    path
}

/// What the catalogue's effects leave, joint by joint, where it is more than noise.
fn outside(walked: &[Walked], model: &Model) -> Vec<String> {
    let series: Vec<JointSeries> = walked
        .iter()
        .flat_map(|limb| {
            let joints = 0..limb.criticism.recording.joints;
            let names: Vec<String> = joints.map(|j| limb.name(j, model)).collect();
            limb.criticism.series(Predict::HeldOut, &names)
        })
        .collect();
    let views: Vec<_> = series.iter().map(JointSeries::view).collect();
    let left = residual::criticise(&views).into_iter().filter(|joint| {
        joint.structure_remains()
            && joint
                .above_noise_percent
                .is_some_and(|share| share > MOST_ABOVE_NOISE)
    });
    left.map(|joint| {
        let share = joint.above_noise_percent.unwrap_or(0.0);
        let place = joint.patterns.first().map_or(String::new(), |pattern| format!(" {}", pattern.sentence));
        format!(
            "{}: no effect of the catalogue explains {share:.0} % of the error that is left.{place}",
            joint.joint
        )
    })
    .collect()
}
