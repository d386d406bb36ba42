//! A recording, walked to the end, as one diagnosis.

use proprio_core::effect::EffectKind;

use super::bodies;
use super::changed::changed;
use super::outside::Outside;
use super::path::path;
use super::{
    Alternative, CandidateReport, ChangedValue, Diagnosed, Diagnosis, FoundFormula, FoundFrame,
    FrameCorrection, JointError, LoadChangeReport, ParameterReport, Verdict, contact, text,
};
use crate::detect::contact::{Contact, words as contact_words};
use crate::detect::frame::OtherFrame;
use crate::detect::ladder::Yardsticks;
use crate::equation::values::Place;
use crate::equation::velocity::VelocityGain;
use crate::estimate::ParameterEstimate;
use crate::estimate::limb_data::Squares;
use crate::identify::model_fit::parameters;
use crate::parallel::side_by_side;
use crate::parameter;
use crate::select::candidate::Member;
use crate::select::ranking::Judged;

/// A joint with fewer windows in motion cannot be judged.
const LEAST_WINDOWS: usize = 100;

/// What was found, in values and words; of what is left `outside` the catalogue, and the formulas found for it.
pub(super) fn report(d: &Diagnosed, outside: &Outside, formulas: Vec<FoundFormula>) -> Diagnosis {
    let mut candidates = d.contacts();
    candidates.extend(d.catalogued());
    let joints = d.joint_errors();
    let (held_out_rms, log_rms, path) = path(d);
    let outside_catalogue: Vec<String> = (outside.told.iter())
        .map(|left| format!("{}: {}", left.joint, left.words))
        .collect();
    let still: Vec<&str> = (joints.iter())
        .filter(|j| j.n < LEAST_WINDOWS)
        .map(|j| &*j.joint)
        .collect();
    let kinematics = d.found_frames();
    let significant =
        candidates.iter().any(|c| c.significant) || !formulas.is_empty() || !kinematics.is_empty();
    let verdict = match (
        significant || !outside_catalogue.is_empty(),
        still.is_empty(),
    ) {
        (true, _) => Verdict::Missing,
        (false, true) => Verdict::Complete,
        (false, false) => Verdict::Insufficient,
    };
    let by_contact = (candidates.first()).is_some_and(|c| c.effect == Contact::EFFECT.name());
    let (reason, next) = if by_contact {
        contact::reason(&candidates, d.base_moves)
    } else {
        text::reason(
            verdict,
            (&candidates, &kinematics),
            &outside_catalogue,
            &still,
        )
    };
    let stands: Vec<_> = (d.feet.iter().enumerate())
        .filter_map(|(n, foot)| Some((d.foot(n), foot.clone()?)))
        .collect();
    let ladder: Vec<_> = (d.ladder.iter())
        .map(|own| (own.windows, own.errors))
        .collect();
    Diagnosis {
        yardsticks: Yardsticks::over_all(&ladder),
        has_values: d.model.has_values(),
        changed: d.changed(),
        verdict,
        reason,
        next,
        candidates,
        held_out_rms,
        log_rms,
        path,
        joints,
        second_encoder: (d.each_twist())
            .map(|(limb, twist)| text::twist(&d.name(limb, twist.joint), twist))
            .collect(),
        bodies: match &d.as_well {
            Some((bodies, _)) => text::bodies(bodies, true),
            None => text::bodies(&d.bodies, false),
        },
        bodies_instead: match &d.as_well {
            Some((bodies, are_loads)) => *are_loads && !bodies.is_empty(),
            None => d.freed && bodies::are_all(&d.bodies, &d.found),
        },
        kinematics,
        formulas,
        outside_catalogue,
        regimes: (outside.told.iter())
            .filter_map(|left| left.regime.clone())
            .collect(),
        load_changes: (d.load_changes.iter().enumerate())
            .filter_map(|(limb, change)| {
                let change = change.as_ref()?;
                Some(LoadChangeReport {
                    joint: d.name(limb, change.joint),
                    from: change.from,
                    mass: change.mass[0],
                    std: change.mass[1],
                })
            })
            .collect(),
        every_window: None,
        stands: !stands.is_empty(),
        logs: d.recording.logs.clone(),
        warnings: (d.recording.warnings.iter().cloned())
            .chain(contact_words(&stands, d.base_moves))
            .chain((!outside.alone.is_empty()).then(|| text::alone(&outside.alone)))
            .collect(),
    }
}

/// What positions tell and no torque: the share of what is measured that it takes away, with its error, and its parameters.
fn measured(
    effect: EffectKind,
    joint: String,
    [held_out_gain, held_out_gain_error]: [f64; 2],
    values: &[[f64; 2]],
    unit: &dyn Fn(usize) -> &'static str,
) -> CandidateReport {
    let described = effect.description().parameters.iter().zip(values);
    let parameters: Vec<ParameterReport> = (described.enumerate())
        .map(|(n, (parameter, [value, std]))| ParameterReport {
            symbol: parameter.symbol,
            unit: unit(n),
            value: *value,
            std: *std,
        })
        .collect();
    let [value, std] = values.first().copied().unwrap_or_default();
    CandidateReport {
        effect: effect.name(),
        joints: vec![joint],
        held_out_gain,
        held_out_gain_error,
        z: value.abs() / std.max(f64::MIN_POSITIVE),
        value,
        std,
        parameters,
        torque_error_percent: 0.0,
        in_bounds: true,
        significant: true,
        alternatives: Vec::new(),
    }
}

/// What a candidate would add to a model that leaves a `total` sum of squares, (N m)².
pub(super) fn candidate(
    judged: &Judged,
    total: f64,
    names: &dyn Fn(&[Member]) -> Vec<String>,
    unit: &dyn Fn(usize) -> &'static str,
) -> CandidateReport {
    let c = &judged.candidate;
    let (held_out_gain, held_out_gain_error) = c.held_out_gain();
    let firsts: Vec<(f64, f64)> = judged.parameters.iter().map(|p| p[0]).collect();
    let n = firsts.len().max(1) as f64;
    let value = firsts.iter().map(|p| p.0).sum::<f64>() / n;
    let std = if c.is_shared() {
        firsts.first().map_or(0.0, |p| p.1)
    } else {
        firsts.iter().map(|p| p.1 * p.1).sum::<f64>().sqrt() / n
    };
    let described = c.effect.description().parameters.iter();
    let told = judged.parameters.iter().take(1).flatten();
    let parameters = described
        .zip(told)
        .enumerate()
        .map(|(n, (p, (value, std)))| ParameterReport {
            symbol: p.symbol,
            unit: unit(n),
            value: *value,
            std: *std,
        });
    let alternative = |(effect, members): &(EffectKind, Vec<Member>)| Alternative {
        effect: effect.name(),
        joints: names(members),
    };
    CandidateReport {
        effect: c.effect.name(),
        joints: names(&c.members),
        held_out_gain,
        held_out_gain_error,
        z: c.z(),
        value,
        std,
        parameters: parameters.collect(),
        torque_error_percent: 100.0 * c.torque_error_taken() / total.max(f64::MIN_POSITIVE),
        in_bounds: judged.possible,
        significant: judged.significant,
        alternatives: judged.alternatives.iter().map(alternative).collect(),
    }
}

impl Diagnosed<'_> {
    /// The joint that carries a limb's foot.
    fn foot(&self, limb: usize) -> String {
        self.all[limb].joint_names().pop().unwrap_or_default()
    }

    /// The values of the model's file that these logs contradict; nothing of a file without values or with those of these very logs.
    fn changed(&self) -> Vec<ChangedValue> {
        let model = self.model;
        if !model.has_values() || model.is_of(&self.recording.logs, &self.recording.only) {
            return Vec::new();
        }
        let values = side_by_side(&self.found.end.fits, |fit| parameters(fit));
        let fitted: Vec<ParameterEstimate> =
            (values.into_iter().flatten()).map(|p| p.estimate).collect();
        changed(model, &fitted)
    }

    /// The forces at feet that the model does not have, the joints' best agreement first.
    fn contacts(&self) -> Vec<CandidateReport> {
        let reports = self.feet.iter().enumerate().filter_map(|(n, foot)| {
            let foot = foot.as_ref().filter(|foot| !foot.known)?;
            Some(foot.contact.report(self.foot(n)))
        });
        let mut contacts: Vec<CandidateReport> = reports.collect();
        contacts.sort_by(|a, b| b.held_out_gain.total_cmp(&a.held_out_gain));
        contacts
    }

    /// What torques tell, the headline first, and what positions say of velocities where it belongs by the torque error it takes.
    fn catalogued(&self) -> Vec<CandidateReport> {
        let total: f64 = self.found.start.iter().map(|s| s.total()).sum();
        let mut all: Vec<CandidateReport> = self
            .found
            .first
            .iter()
            .map(|judged| self.candidate(judged, total))
            .collect();
        let mut wrong = Vec::new();
        for (limb, joints) in self.velocity.iter().enumerate() {
            let of =
                |(joint, gain): &(usize, VelocityGain)| self.velocity_candidate(limb, *joint, gain);
            wrong.extend(joints.iter().map(of));
        }
        wrong.sort_by(|a, b| b.held_out_gain.total_cmp(&a.held_out_gain));
        for (limb, twist) in self.each_twist() {
            wrong.extend(self.lacking(limb, twist).map(|(place, values)| {
                let joint = self.name(limb, place.1);
                let unit = |n| self.unit(limb, place, n);
                measured(place.0, joint, twist.told, &values, &unit)
            }));
        }
        // Faults of the data, and what encoders tell, are told apart; among the candidates they stand after what torques miss beyond chance.
        let at = all.iter().position(|c| !c.significant).unwrap_or(all.len());
        all.splice(at..at, wrong);
        all
    }

    /// A judged candidate, of a model that leaves a `total` sum of squares, (N m)².
    pub(super) fn candidate(&self, judged: &Judged, total: f64) -> CandidateReport {
        let unit = |n| match judged.candidate.members.first() {
            Some((limb, place)) => self.unit(*limb, *place, n),
            None => judged.candidate.effect.description().parameters[n].unit,
        };
        candidate(judged, total, &|members| self.names(members), &unit)
    }

    /// The unit of a parameter of an effect at a joint of a limb that is judged.
    fn unit(&self, limb: usize, place: Place, n: usize) -> &'static str {
        let data = &self.all[self.judged[limb]];
        data.model.unit(place.0, data.body_of(place.1), n)
    }

    /// The joints' names, each once.
    fn names(&self, members: &[Member]) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for (limb, place) in members {
            let name = self.name(*limb, place.1);
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// The frames that are not where the description has them.
    fn found_frames(&self) -> Vec<FoundFrame> {
        let of = |(_, frame): &(usize, OtherFrame)| {
            let joint = self.model.joint_name(frame.joint).to_owned();
            let correction = |(quantity, value, std)| FrameCorrection {
                quantity,
                value,
                std,
            };
            FoundFrame {
                words: text::frame(&joint, frame),
                joint,
                corrections: frame.quantities().map(correction).collect(),
            }
        };
        self.frames.iter().map(of).collect()
    }

    fn velocity_candidate(
        &self,
        limb: usize,
        joint: usize,
        gain: &VelocityGain,
    ) -> CandidateReport {
        let joint = self.name(limb, joint);
        let told = [gain.held_out_gain, gain.error];
        CandidateReport {
            z: gain.z(),
            ..measured(
                VelocityGain::EFFECT,
                joint,
                told,
                &[[gain.value, gain.std]],
                &|_| parameter::unit(VelocityGain::EFFECT),
            )
        }
    }

    /// Each joint's error of the file as given and after the last step; of a limb that stands, nothing is told.
    fn joint_errors(&self) -> Vec<JointError> {
        let names = (self.judged.iter()).flat_map(|&n| self.all[n].joint_names());
        let after = self.found.end.squares.iter().flat_map(Squares::by_joint);
        let joints = names.zip(after).zip(&self.ladder);
        joints
            .map(|((joint, after), ladder)| JointError {
                joint,
                n: ladder.windows as usize,
                error: (ladder.errors).error((after / ladder.windows.max(1.0)).sqrt()),
            })
            .collect()
    }
}
