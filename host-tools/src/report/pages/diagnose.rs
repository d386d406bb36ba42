//! The page of `diagnose`.

use super::compare::sections;
use super::{Unreadable, header, of_data};
use crate::compare::Comparison;
use crate::diagnose::Diagnosis;
use crate::report::candidates::{self, Candidate};
use crate::report::waterfall::Step;
use crate::report::{Page, Section};

/// What is missing, what each effect would gain, and the comparison of the model that has all of them.
///
/// # Errors
/// If a log cannot be read any more.
pub fn diagnosis(diagnosis: &Diagnosis, after: &Comparison) -> Result<Page, Unreadable> {
    let mut findings = vec![
        format!("{}.", diagnosis.reason),
        format!("Next: {}.", diagnosis.next),
    ];
    findings.extend(of_data(&after.data));
    findings.extend(diagnosis.outside_catalogue.iter().cloned());
    let start = Step {
        label: "the model as given".to_owned(),
        rms: diagnosis.held_out_rms,
    };
    let steps = diagnosis.path.iter().map(|step| Step {
        label: step.to_string(),
        rms: step.held_out_rms,
    });
    let ladder: Vec<Step> = [start].into_iter().chain(steps).collect();
    let mut all = sections(after, &ladder);
    all.insert(1, bars(diagnosis));
    Ok(Page {
        header: header("What the model lacks", findings, &diagnosis.logs)?,
        sections: all,
    })
}

fn bars(diagnosis: &Diagnosis) -> Section {
    let candidate = |c: &crate::diagnose::CandidateReport| Candidate {
        name: c.name(),
        gain: c.held_out_gain,
        gain_std: c.held_out_gain_error,
        look_alikes: c
            .alternatives
            .iter()
            .map(|a| format!("{}:{}", a.effect, a.joints.join(",")))
            .collect(),
    };
    let all: Vec<Candidate> = diagnosis.candidates.iter().map(candidate).collect();
    candidates::section(&all)
}
