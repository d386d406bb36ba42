//! One limb from the model as it was given to one that lacks nothing: contact first, then velocities, then the catalogue.

use proprio_core::effect::EffectKind;

use super::super::blocks::HeapFactor;
use super::super::column::BASE;
use super::super::contact::{LeftOut, leave_out_contact};
use super::super::drift::{Drift, drifts};
use super::super::limb::{LimbCriticism, Place, Squares};
use super::super::recording::Recording;
use super::super::selection::{self, Judged, Path};
use super::super::series::{JointSeries, Predict};
use super::super::velocity::VelocityGain;
use super::{Alternative, CandidateReport, JointError, ParameterReport};
use crate::model::{Limb, Model};

/// One limb, walked to the end.
pub(super) struct Walked<'a> {
    pub(super) criticism: LimbCriticism<'a>,
    pub(super) contact: Option<LeftOut>,
    pub(super) velocity: Vec<(usize, VelocityGain)>,
    pub(super) path: Path,
    /// Each joint's noise floor, N m.
    pub(super) floor: Vec<f64>,
    /// What changes with time.
    pub(super) drifts: Vec<Drift>,
    /// What the model at the end of the path says of time it has not seen.
    pub(super) series: Vec<JointSeries>,
}

/// Walks one limb; `None` if its recording is too short for folds.
pub(super) fn walk<'a>(
    recording: &'a Recording,
    model: &'a Model,
    limb: &'a Limb,
) -> Option<Walked<'a>> {
    let (limb, data) = recording.limbs.iter().find(|(known, _)| known == limb)?;
    let mut criticism = LimbCriticism::new(model, limb, data, true)?;
    if !criticism.blocks.can_hold_out() {
        return None;
    }
    let contact = leave_out_contact(&mut criticism);
    let swings = !contact.as_ref().is_some_and(|c| c.too_little_swing);
    let velocity = if swings {
        wrong_velocities(&criticism)
    } else {
        Vec::new()
    };
    let path = path(&mut criticism, &velocity, contact.as_ref());
    let names: Vec<String> = (limb.bodies.clone())
        .map(|body| model.joint_name(body).to_owned())
        .collect();
    let series = criticism.series(Predict::HeldOut, &names);
    let (floor, drifts) = (criticism.floor(), drifts(&criticism));
    criticism.forget_windows();
    Some(Walked {
        criticism,
        contact,
        velocity,
        path,
        series,
        floor,
        drifts,
    })
}

/// The joints whose velocity positions say to be wrong and the model does not.
fn wrong_velocities(criticism: &LimbCriticism) -> Vec<(usize, VelocityGain)> {
    let is_known = |joint: &usize| {
        let place = (EffectKind::VelocityGain, *joint);
        criticism.active.contains(&place)
    };
    let of = |joint: usize| {
        let gain = VelocityGain::of(criticism.recording, joint, &criticism.blocks)?;
        gain.is_significant().then_some((joint, gain))
    };
    (0..criticism.recording.joints)
        .filter(|joint| !is_known(joint))
        .filter_map(of)
        .collect()
}

/// Puts velocities right and goes the catalogue's way, if the foot swings enough.
fn path(
    criticism: &mut LimbCriticism,
    velocity: &[(usize, VelocityGain)],
    contact: Option<&LeftOut>,
) -> Path {
    let first = (!velocity.is_empty()).then(|| selection::first(criticism));
    for (joint, gain) in velocity {
        criticism.active.push((EffectKind::VelocityGain, *joint));
        criticism.corrections.velocity_gain[*joint] = gain.value;
    }
    if !velocity.is_empty() {
        criticism.rebuild();
    }
    let mut path = match contact {
        Some(contact) if contact.too_little_swing => {
            let squares = &criticism.fit.held_out_squares;
            Path {
                first: Vec::new(),
                start: squares.clone(),
                after_velocity: squares.clone(),
                steps: Vec::new(),
                unphysical: Vec::new(),
            }
        }
        _ => selection::walk(criticism),
    };
    if let Some((first, start)) = first {
        (path.first, path.start) = (first, start);
    }
    if let Some(contact) = contact {
        path.start.by_joint.clone_from(&contact.before);
    }
    path
}

impl Walked<'_> {
    pub(super) fn name(&self, joint: usize, model: &Model) -> String {
        let body = if joint == BASE {
            BASE
        } else {
            self.criticism.limb.bodies.start + joint
        };
        model.joint_name(body).to_owned()
    }

    /// The joint that carries the foot.
    pub(super) fn foot(&self, model: &Model) -> String {
        self.name(self.criticism.recording.joints - 1, model)
    }

    /// Windows of all joints in each log, if each log is held out as a whole.
    pub(super) fn windows_by_log(&self) -> Option<Vec<f64>> {
        let of = |fold: &Vec<HeapFactor>| fold.iter().map(|joint| joint.rows()).sum();
        let tests = &self.criticism.tests;
        (self.criticism.blocks.by_log).then(|| tests.iter().map(of).collect())
    }

    pub(super) fn windows(&self) -> Vec<f64> {
        let tests = &self.criticism.tests;
        (0..self.criticism.recording.joints)
            .map(|j| tests.iter().map(|fold| fold[j].rows()).sum())
            .collect()
    }

    /// Each joint's error before the first step and after the last.
    pub(super) fn joint_errors(&self, model: &Model) -> Vec<JointError> {
        let Path { start, steps, .. } = &self.path;
        let last = steps.last().map_or(start, |step| &step.squares);
        let of = |(j, n): (usize, f64)| {
            let rms = |squares: &Squares| (squares.by_joint[j] / n).sqrt();
            let after = rms(last);
            JointError {
                joint: self.name(j, model),
                n: n as usize,
                before: rms(start),
                after,
                floor: self.floor[j].min(after),
            }
        };
        self.windows().into_iter().enumerate().map(of).collect()
    }

    pub(super) fn candidate(&self, judged: &Judged, model: &Model) -> CandidateReport {
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

    pub(super) fn velocity_candidate(
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
