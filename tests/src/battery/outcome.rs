//! One case simulated, diagnosed and judged.

use std::collections::HashMap;
use std::sync::Mutex;

use proprio_core::go2::{JointId, Leg};
use proprio_host::compare::{ValuesFrom, compare};
use proprio_host::detect::mismatch::mismatches;
use proprio_host::diagnose::Verdict;
use proprio_host::diagnose::{Diagnosis, diagnose};
use proprio_host::model::Model;
use proprio_host::recording::Recording;
use proprio_simulator::{HiddenEffect, HiddenKind, SimulatedSample, Sizes};

use super::bound::{Bound, Noise, Signature, noise};
use super::case::{Case, Group};

/// A hidden effect is detectable from this size on, in units of its Cramér-Rao standard deviation.
const DETECTABLE: f64 = 3.0;
/// The error after the path may exceed the noise floor by this factor.
const AT_FLOOR: f64 = 1.05;

/// What came of a case.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Its name.
    pub case: String,
    /// What it asks.
    pub group: Group,
    /// What was hidden, `coulomb:FR_calf`.
    pub hidden: Vec<String>,
    /// 0 small, 1 medium, 2 large.
    pub size: usize,
    /// The least of the hidden effects' sizes over their Cramér-Rao standard deviation; none where it is not known.
    pub snr: Option<f64>,
    /// Root mean square of the hidden torque, N m.
    pub torque: f64,
    /// The effect that the diagnosis puts first; none if it calls none missing.
    pub named: Option<String>,
    /// Its alternatives.
    pub alternatives: Vec<String>,
    /// What the path adds in the end.
    pub path: Vec<String>,
    /// Whether something outside the catalogue is reported.
    pub outside: bool,
    /// Held-out error after the path, N m.
    pub after: f64,
    /// That of the model that has exactly the true effects; none if the catalogue has no such model.
    pub floor: Option<f64>,
    /// Where another effect was named: the size of the hidden one, as `snr`, in what the named one at its medium size,
    /// fitted, leaves of it. Below 3 nobody could tell them apart on this log.
    pub apart: Option<f64>,
}

impl Outcome {
    /// Whether the log can tell what is hidden.
    pub fn is_detectable(&self) -> bool {
        self.snr.is_none_or(|snr| snr >= DETECTABLE)
    }

    /// Whether the hidden effect is named first, at its joint.
    pub fn is_top(&self) -> bool {
        self.named.as_ref() == self.hidden.first()
    }

    /// Whether it is named first or among the alternatives.
    pub fn is_in_set(&self) -> bool {
        self.is_top() || self.alternatives.iter().any(|a| self.hidden.contains(a))
    }

    /// Whether the path leaves no more than the noise; none where that is not known.
    pub fn is_at_floor(&self) -> Option<bool> {
        Some(self.after <= AT_FLOOR * self.floor?)
    }

    /// Whether the path has all hidden effects.
    pub fn has_all(&self) -> bool {
        self.hidden.iter().all(|h| self.path.contains(h))
    }

    /// Whether the case is as it should be.
    pub fn is_right(&self) -> bool {
        match self.group {
            Group::One => self.is_top(),
            Group::Two => self.has_all(),
            Group::Complete => self.named.is_none() && !self.outside,
            Group::Outside => self.outside,
        }
    }
}

/// Runs cases; keeps what many have in common.
#[derive(Default)]
pub struct Bench {
    /// Noise of the legs by seed.
    noise: Mutex<HashMap<(usize, u64), Noise>>,
}

impl Bench {
    /// Simulates a case, diagnoses it and judges the diagnosis.
    pub fn run(&self, case: &Case) -> Outcome {
        let recording = record(case);
        let model = case.model();
        // What is hidden is for the catalogue to say.
        assert_eq!(mismatches(&recording, &model), [], "{case}");
        let diagnosis = diagnose(&recording, &model).expect("20 s are long enough");
        let noise = self.noise(case);
        let bounds = bounds(case, &noise);
        let floor = match case.group() {
            // The model is the true one.
            Group::Complete => Some(diagnosis.held_out_rms),
            _ => case.true_model().and_then(|m| held_out(&recording, &m)),
        };
        let mut outcome = judge(&diagnosis, hidden(case));
        outcome.case = case.to_string();
        outcome.group = case.group();
        outcome.size = case.size;
        outcome.snr = bounds.iter().map(|b| b.snr).reduce(f64::min);
        outcome.torque = bounds.iter().fold(0.0, |most, b| most.max(b.torque));
        outcome.floor = floor;
        if case.group() == Group::One && !outcome.is_top() {
            outcome.apart = outcome
                .named
                .as_deref()
                .and_then(|name| apart(case, name, &noise));
        }
        outcome
    }

    fn noise(&self, case: &Case) -> Noise {
        let key = (case.leg.index(), case.seed);
        let known = |noise: &HashMap<_, Noise>| noise.get(&key).copied();
        if let Some(noise) = known(&self.noise.lock().expect("no thread panics")) {
            return noise;
        }
        let complete = Case {
            hidden: Vec::new(),
            ..case.clone()
        };
        let found = noise(&complete.simulation());
        let mut noise = self.noise.lock().expect("no thread panics");
        *noise.entry(key).or_insert(found)
    }
}

/// A case's log.
pub fn record(case: &Case) -> Recording {
    let simulation = case.simulation();
    let samples: Vec<SimulatedSample> = simulation.samples().map_while(Result::ok).collect();
    Recording::from_samples(&Model::default(), &case.leg.joint_names(), &samples)
}

/// The held-out error of a model whose effects are fitted, N m.
fn held_out(recording: &Recording, model: &Model) -> Option<f64> {
    compare(recording, model, ValuesFrom::Fitted)
        .ok()
        .map(|c| c.rms)
}

/// What was hidden, as a diagnosis would name it.
fn hidden(case: &Case) -> Vec<String> {
    case.hidden.iter().map(HiddenEffect::place).collect()
}

/// What a diagnosis says of a log in which `hidden` was.
pub fn judge(diagnosis: &Diagnosis, hidden: Vec<String>) -> Outcome {
    let best = diagnosis.candidates.iter().find(|c| c.significant);
    let best = best.filter(|_| diagnosis.verdict == Verdict::Missing);
    let mut path: Vec<String> = Vec::new();
    for step in &diagnosis.path {
        for joint in &step.joints {
            let place = place(step.effect, std::slice::from_ref(joint));
            path.retain(|known| *known != place);
            if !step.removed {
                path.push(place);
            }
        }
    }
    let last = diagnosis.path.last();
    Outcome {
        case: String::new(),
        group: Group::One,
        hidden,
        size: 0,
        snr: None,
        torque: 0.0,
        named: best.map(|c| place(c.effect, &c.joints)),
        alternatives: best.map_or_else(Vec::new, |c| {
            let places = c.alternatives.iter().map(|a| place(a.effect, &a.joints));
            places.collect()
        }),
        path,
        outside: !diagnosis.outside_catalogue.is_empty(),
        after: last.map_or(diagnosis.held_out_rms, |step| step.held_out_rms),
        floor: None,
        apart: None,
    }
}

/// `coulomb:FR_calf`, `base_tilt`.
fn place(effect: &str, joints: &[String]) -> String {
    match &joints.join(",")[..] {
        "base" => effect.to_owned(),
        joints => format!("{effect}:{joints}"),
    }
}

/// What the log can tell of each hidden effect beside the others.
fn bounds(case: &Case, noise: &Noise) -> Vec<Bound> {
    let signatures: Vec<Signature> = case
        .hidden
        .iter()
        .map(|e| Signature::new(case, std::slice::from_ref(e)))
        .collect();
    let bound = |n: usize| {
        let others = signatures.iter().enumerate().filter(|(k, _)| *k != n);
        let others: Vec<&Signature> = others.map(|(_, s)| s).collect();
        signatures[n].bound(case, noise, &others)
    };
    (0..signatures.len()).map(bound).collect()
}

/// What the log can tell of the hidden effect beside the named one.
fn apart(case: &Case, named: &str, noise: &Noise) -> Option<f64> {
    let (kind, joint) = named.split_once(':').unwrap_or((named, ""));
    let kind = HiddenKind::from_name(kind)?;
    let joint = JointId::from_name(joint).unwrap_or(JointId::of(case.leg)[Leg::ALL.len() - 2]);
    let rival = Sizes::of(kind).at(1, joint).ok()?;
    let hidden = Signature::new(case, &case.hidden);
    let rival = Signature::new(case, &[rival]);
    Some(hidden.bound(case, noise, &[&rival]).snr)
}
