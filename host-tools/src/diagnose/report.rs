//! A recording, walked to the end, as one diagnosis.

use proprio_core::effect::EffectKind;

use super::bodies;
use super::changed::changed;
use super::path::path;
use super::{
    Alternative, CandidateReport, ChangedValue, Diagnosed, Diagnosis, FoundFormula, JointError,
    LoadChangeReport, ParameterReport, Verdict, contact, text,
};
use crate::detect::black_box::Explained;
use crate::detect::bursts::bursts;
use crate::detect::contact::{Contact, words as contact_words};
use crate::detect::ladder::Yardsticks;
use crate::detect::load_change::{self, LoadChange};
use crate::detect::residual::{self, Criticism};
use crate::detect::series::JointSeries;
use crate::equation::values::Place;
use crate::equation::velocity::VelocityGain;
use crate::estimate::ParameterEstimate;
use crate::estimate::limb_data::Squares;
use crate::identify::model_fit::parameters;
use crate::parallel::{by_number, side_by_side};
use crate::parameter;
use crate::select::candidate::Member;
use crate::select::criteria::step::is_by_noise;
use crate::select::criteria::{RESOLUTION, STRUCTURE};
use crate::select::drift::Drift;
use crate::select::ranking::Judged;

/// A joint with fewer windows in motion cannot be judged.
const LEAST_WINDOWS: usize = 100;

/// What is left of a joint that is more than noise.
pub(super) struct Left {
    pub(super) joint: String,
    pub(super) words: String,
}

/// What is left of all joints.
pub(super) struct Outside {
    /// What may be an effect that the catalogue does not have.
    pub(super) told: Vec<Left>,
    /// Joints with windows that are large alone.
    pub(super) alone: Vec<String>,
    /// Joints of which all that could be told is noise.
    pub(super) noise: Vec<String>,
}

/// Windows that are large alone leave so much of a joint's squared error, and more is a law's.
const MOST_ALONE: f64 = 0.5;

/// What is said of a joint of a complete model.
struct ByNoise {
    /// The share of the squared error that has structure.
    structure: f64,
    /// The share that a black box takes.
    share: f64,
    /// How far the motion alone has each of the joint's windows off, N m.
    off: Vec<f64>,
}

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
    let significant = candidates.iter().any(|c| c.significant) || !formulas.is_empty();
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
        text::reason(verdict, &candidates, &outside_catalogue, &still)
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
        formulas,
        outside_catalogue,
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

    fn candidate(&self, judged: &Judged, total: f64) -> CandidateReport {
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

    /// What the catalogue's effects leave, joint by joint, where it is more than noise: of the torque and of the motion.
    pub(super) fn outside(&self) -> Outside {
        let (mut series, mut drifting, mut boxes) = (Vec::new(), Vec::new(), Vec::new());
        let mut places: Vec<(usize, usize)> = Vec::new();
        let fits: Vec<_> = self.found.end.fits.iter().enumerate().collect();
        let left = side_by_side(&fits, |(_, fit)| {
            let below = fit.below_limits();
            let predicted = below.with_unfollowed(&fit.values, fit.predicted_held_out()?);
            let doubts: Vec<_> = (0..below.joints()).map(|n| fit.doubt(&below, n)).collect();
            let taken = |joint: usize| Explained::of(&below, &predicted, joint, &doubts[joint]);
            let boxes = by_number(0..below.joints(), taken);
            let own = JointSeries::of(&below, &predicted).into_iter().zip(doubts);
            Some((own.collect::<Vec<_>>(), boxes))
        });
        for ((limb, fit), left) in fits.into_iter().zip(left) {
            let Some((own, taken)) = left else { continue };
            let joint = |joint: usize| (limb, joint);
            places.extend((0..own.len()).map(joint));
            series.extend(own);
            boxes.extend(taken);
            let by_log = fit.data.blocks.by_log;
            let told = |drift: &Drift| (self.name(limb, drift.joint), text::drift(drift, by_log));
            drifting.extend(self.found.source.drifts(limb).iter().map(told));
        }
        for ((series, _), ladder) in series.iter_mut().zip(&self.ladder) {
            series.noise = ladder.noise;
        }
        let (mut lasting, mut alone, mut rest) = (Vec::new(), Vec::new(), Vec::new());
        for (series, doubt) in &mut series {
            let moments = bursts(series, doubt);
            let before = series.rms();
            if let Some(moments) = moments.as_ref().filter(|moments| !moments.lasts) {
                // They tell of themselves, and nothing of what the others have in common.
                (moments.windows.iter()).for_each(|&w| series.residual[w] = 0.0);
                alone.push(series.joint.clone());
            }
            rest.push((series.rms() / before.max(f64::MIN_POSITIVE)).powi(2));
            lasting.push(moments.filter(|moments| moments.lasts));
        }
        let views: Vec<_> = series.iter().map(|(series, _)| series.view()).collect();
        let criticism = residual::criticise(&views);
        let structure = |joint: usize| rest[joint] * criticism[joint].structure();
        let may_be_told = |joint: usize| {
            structure(joint) > STRUCTURE
                || lasting[joint].is_some()
                || boxes[joint].as_ref().and_then(text::black_box).is_some()
        };
        let asked: Vec<bool> = (0..places.len()).map(may_be_told).collect();
        let by_noise = self.by_noise(&places, &asked);
        let is_more = |joint: usize, share: f64, noise: &dyn Fn(&ByNoise) -> f64| {
            !is_by_noise(by_noise[joint].as_ref().map_or(0.0, noise), share)
        };
        let lasting = lasting.into_iter().enumerate().filter_map(|(k, moments)| {
            let (own, moments) = (&series[k].0, moments?);
            let square = |all: &[f64]| moments.windows.iter().map(|&w| all[w].powi(2)).sum();
            let is_more = is_more(k, square(&own.residual), &|noise| square(&noise.off));
            is_more.then(|| (own.joint.clone(), moments.words))
        });
        let left = criticism.iter().enumerate().filter(|(k, _)| {
            let share = structure(*k);
            share > STRUCTURE && is_more(*k, share, &|noise| noise.structure)
        });
        let structures = left.map(|(k, joint)| {
            let share = 100.0 * structure(k);
            let place = joint
                .patterns
                .first()
                .map_or(String::new(), |p| format!(" {}", p.sentence));
            let words = format!(
                "no effect of the catalogue explains {share:.0} % of the error that is left.{place}"
            );
            (joint.joint.clone(), words)
        });
        let boxes = boxes.iter().enumerate().filter_map(|(k, taken)| {
            let taken = taken.as_ref()?;
            let is_more = is_more(k, taken.share, &|noise| noise.share);
            let joint = series[k].0.joint.clone();
            Some((joint, text::black_box(taken).filter(|_| is_more)?))
        });
        let total: f64 = self.found.end.squares.iter().map(|s| s.total()).sum();
        let unphysical = self.found.unphysical.iter().map(|judged| {
            let candidate = self.candidate(judged, total);
            (candidate.joints.join(", "), text::unphysical(&candidate))
        });
        // Of what a few windows ask for nothing is told but those.
        let joints = series.iter().zip(&rest);
        let few = joints.filter(|(_, rest)| **rest < MOST_ALONE);
        let few: Vec<String> = few.map(|((series, _), _)| series.joint.clone()).collect();
        let unphysical = unphysical.filter(|(joint, _)| !few.contains(joint));
        let mut resolved = self.resolved();
        let mut told: Vec<Left> = Vec::new();
        for (limb, change) in self.load_changes.iter().enumerate() {
            let Some(change) = change else { continue };
            // It is the cause of what is left at all joints of its limb.
            resolved.extend(self.all[self.judged[limb]].joint_names());
            told.push(Left {
                joint: self.name(limb, change.joint),
                words: text::load_change(change),
            });
        }
        // One sentence a joint: they are of one cause, the first says most.
        for (joint, words) in (structures.chain(boxes))
            .chain(drifting)
            .chain(lasting)
            .chain(unphysical)
        {
            if resolved.contains(&joint) {
                continue;
            }
            if told.iter().all(|left| left.joint != joint) {
                told.push(Left { joint, words });
            }
        }
        let joints = series.iter().zip(asked).filter(|(_, asked)| *asked);
        let names = joints.map(|((series, _), _)| series.joint.clone());
        let noise = names
            .chain(few)
            .filter(|joint| told.iter().all(|left| left.joint != *joint));
        Outside {
            noise: noise.collect(),
            told,
            alone,
        }
    }

    /// Of joints, by limb and number, what is said of those `asked` for where the model is complete and its motion measured once more.
    fn by_noise(&self, places: &[(usize, usize)], asked: &[bool]) -> Vec<Option<ByNoise>> {
        let mut limbs: Vec<usize> = places.iter().map(|place| place.0).collect();
        limbs.dedup();
        let of = |&limb: &usize| {
            let first = places.iter().position(|place| place.0 == limb)?;
            let fit = &self.found.end.fits[limb];
            let own = || first..first + fit.data.joints();
            if !own().any(|joint| asked[joint]) {
                return None;
            }
            let (again, [predicted, off]) = fit.below_limits().as_if_complete(&fit.values);
            let n = again.joints();
            let off = |joint: usize| -> Vec<f64> {
                let counting = (0..again.left_out.len()).filter(|&w| again.counts(w, joint));
                counting.map(|w| off[w * n + joint]).collect()
            };
            let predicted = again.with_unfollowed(&fit.values, predicted);
            let mut series = JointSeries::of(&again, &predicted);
            for (series, joint) in series.iter_mut().zip(own()) {
                series.noise = self.ladder[joint].noise;
            }
            let views: Vec<_> = series.iter().map(JointSeries::view).collect();
            let structures = residual::criticise(&views).into_iter();
            let share = |joint: usize| {
                let doubt = fit.doubt(&again, joint);
                Explained::of(&again, &predicted, joint, &doubt).map(|taken| taken.share)
            };
            let of = |(joint, criticism): (usize, Criticism)| ByNoise {
                off: off(joint),
                structure: criticism.structure(),
                share: share(joint).unwrap_or(0.0),
            };
            Some(structures.enumerate().map(of).collect::<Vec<_>>())
        };
        let found = side_by_side(&limbs, of);
        let joints = limbs.iter().zip(found).flat_map(|(limb, found)| {
            let count = places.iter().filter(|place| place.0 == *limb).count();
            match found {
                Some(found) => found.into_iter().map(Some).collect::<Vec<_>>(),
                None => (0..count).map(|_| None).collect(),
            }
        });
        joints.collect()
    }

    /// Of each limb the load that comes or goes within the log, if one does.
    pub(super) fn load_changes(&self) -> Vec<Option<LoadChange>> {
        let mut ladder = self.ladder.iter().map(|joint| joint.noise);
        let limbs: Vec<_> = (self.found.end.fits.iter())
            .map(|fit| {
                (
                    fit,
                    ladder.by_ref().take(fit.data.joints()).collect::<Vec<_>>(),
                )
            })
            .collect();
        side_by_side(&limbs, |(fit, noise)| {
            let below = fit.below_limits();
            // The whole fit: those that each leave a fold out have more of the load or less of it.
            load_change::of(&below, &fit.values, &fit.predicted(), noise)
        })
    }

    /// The limbs and joints of which more is left than a sampled log resolves, and than `outside` takes for noise.
    pub(super) fn unresolved(&self, outside: &Outside) -> Vec<(usize, usize)> {
        let mut resolved = self.resolved();
        resolved.extend(outside.noise.iter().cloned());
        let limbs = self.judged.iter().enumerate();
        // What a load that comes or goes leaves at each joint is no law of that joint.
        let limbs = limbs.filter(|(limb, _)| self.load_changes[*limb].is_none());
        let of = |(limb, &n): (usize, &usize)| {
            let names = self.all[n].joint_names().into_iter().enumerate();
            let open = names.filter(|(_, name)| !resolved.contains(name));
            open.map(move |(joint, _)| (limb, joint))
                .collect::<Vec<_>>()
        };
        limbs.flat_map(of).collect()
    }

    /// The joints of which no more is left than a sampled log resolves. A torque that is reported in steps may be off by as much as
    /// rounding leaves of one sample (a step over √12), however many a window holds: without noise they are all rounded alike.
    fn resolved(&self) -> Vec<String> {
        let mut resolved = Vec::new();
        for (fit, left) in self.found.end.fits.iter().zip(&self.found.end.squares) {
            let data = fit.data;
            let torque = data.squares(&vec![0.0; data.torque.len()]).by_joint();
            let told = left
                .by_joint()
                .into_iter()
                .zip(torque)
                .zip(fit.left_by_sampling());
            let names = data.joint_names().into_iter().enumerate();
            for ((j, name), ((left, torque), sampling)) in names.zip(told) {
                let windows = (0..data.motion.windows.len()).filter(|w| data.counts(*w, j));
                let rounding = windows.count() as f64 * self.torque_step(&name).powi(2) / 12.0;
                if left <= RESOLUTION.powi(2) * torque + sampling + rounding {
                    resolved.push(name);
                }
            }
        }
        resolved
    }

    /// The steps in which a joint's torque is reported, N m, the largest of all logs; zero if there are none.
    fn torque_step(&self, joint: &str) -> f64 {
        let gates = self
            .recording
            .gates
            .iter()
            .flat_map(|log| &log.report.joints);
        let steps = gates
            .filter(|gate| gate.joint == joint)
            .filter_map(|gate| gate.quantum[2]);
        steps.fold(0.0, f64::max)
    }
}
