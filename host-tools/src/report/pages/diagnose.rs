//! The page of `diagnose`.

use std::path::Path;

use super::compare::{sections, told, try_out};
use super::{Unreadable, add_moments, drawing, header, of_data};
use crate::compare::Comparison;
use crate::diagnose::{CandidateReport, Diagnosis, NEW_MODEL, PathStep};
use crate::model::Model;
use crate::recording::Recording;
use crate::report::candidates::{self, Candidate};
use crate::report::choices::Told;
use crate::report::minutes;
use crate::report::waterfall::Step;
use crate::report::{Page, Section};
use crate::summary::{joints_in_words, typed};

/// What the page of a diagnosis is made of.
pub struct DiagnosisPage<'a> {
    /// What was found.
    pub diagnosis: &'a Diagnosis,
    /// The comparison of the model that has all of it.
    pub after: &'a Comparison,
    /// What was diagnosed.
    pub recording: &'a Recording,
    /// The model as it was given.
    pub given: &'a Model,
    /// The model with what was found.
    pub complete: &'a Model,
    /// The model's file, if one was named.
    pub model: Option<&'a Path>,
    /// Whether the file has what was found already.
    pub written: bool,
}

impl DiagnosisPage<'_> {
    /// What is missing, tick boxes to try it, what each effect would gain, and the comparison of the model that has all of them.
    ///
    /// # Errors
    /// If a log cannot be read any more.
    pub fn page(&self) -> Result<Page, Unreadable> {
        let diagnosis = self.diagnosis;
        let summary = diagnosis.summary(self.given.robot(), self.model);
        let mut findings = summary.points;
        findings.push(format!("{}.", diagnosis.reason));
        findings.extend(of_data(&self.after.data));
        findings.extend(diagnosis.outside_catalogue.iter().skip(1).cloned());
        let mut all = sections(self.after, &ladder(diagnosis));
        all.insert(1, bars(diagnosis));
        let every = diagnosis.every_window.iter();
        let every = every.map(|every| minutes::section(every, ["as given", "with what was found"]));
        all.splice(1..1, every);
        let tick_boxes = try_out(self.recording, self.complete, &self.told(&summary.next))?;
        all.splice(0..0, tick_boxes);
        let mut header = header("What the model lacks", findings, &diagnosis.logs)?;
        add_moments(&mut header.findings, self.after);
        header.headline = summary.headline;
        header.next = match self.written {
            true => vec![format!(
                "proprio compare {}",
                typed(&diagnosis.logs, self.model)
            )],
            false => summary.next,
        };
        header.drawing = drawing(self.complete, &self.after.series);
        Ok(Page {
            header,
            sections: all,
        }
        .folded())
    }

    /// What the tick boxes are told; `next` adds to the model file what was found.
    fn told(&self, next: &[String]) -> Told {
        let adds = self.complete != self.given;
        let model = self.model.or(adds.then_some(Path::new(NEW_MODEL)));
        let given = self.given.effects().iter();
        Told {
            before: given
                .map(|e| format!("{}:{}", e.effect.name(), self.given.joint_name(e.joint)))
                .collect(),
            first: match adds && !self.written {
                true => next.to_vec(),
                false => Vec::new(),
            },
            compare: format!(
                "proprio compare {} --fit",
                typed(&self.diagnosis.logs, model)
            ),
            ..told(self.after)
        }
    }
}

/// How the error fell, step by step.
pub(super) fn ladder(diagnosis: &Diagnosis) -> Vec<Step> {
    let all = diagnosis.joint_names();
    let start = |label: &str, rms| Step {
        label: label.to_owned(),
        joints: Vec::new(),
        rms,
    };
    let step = |own: &PathStep| {
        let (label, joints) = label(own.effect, &own.joints, &all);
        let sign = if own.removed { '−' } else { '+' };
        Step {
            label: format!("{sign} {label}"),
            joints,
            rms: own.held_out_rms,
        }
    };
    let given = [
        start("the model as given", diagnosis.yardsticks.given_rms),
        start("its values fitted anew", diagnosis.held_out_rms),
    ];
    given
        .into_iter()
        .chain(diagnosis.path.iter().map(step))
        .collect()
}

/// What each candidate would gain.
pub(super) fn bars(diagnosis: &Diagnosis) -> Section {
    let all = diagnosis.joint_names();
    let candidate = |c: &CandidateReport| {
        let (name, joints) = label(c.effect, &c.joints, &all);
        let alike = c.alternatives.iter();
        Candidate {
            name,
            joints,
            gain: c.held_out_gain,
            gain_std: c.held_out_gain_error,
            look_alikes: alike.map(|a| label(a.effect, &a.joints, &all).0).collect(),
        }
    };
    let candidates: Vec<Candidate> = diagnosis.candidates.iter().map(candidate).collect();
    candidates::section(&candidates)
}

/// An effect by where it is, `coulomb, all calves`; and the joints' names where that only counts them.
fn label(effect: &str, joints: &[String], all: &[String]) -> (String, Vec<String>) {
    let words = joints_in_words(joints, all);
    let counted = words == format!("{} joints", joints.len());
    let joints = if counted { joints.to_vec() } else { Vec::new() };
    (format!("{effect}, {words}"), joints)
}
