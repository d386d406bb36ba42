//! A verdict against the truth.

use std::path::Path;

use super::truth::{LoggedCase, Place};
use super::verdict::{self, Verdict};

/// From this size on an effect has to be named, in standard deviations of an efficient estimate that knows the noise: a diagnosis
/// does not, and compares it with some sixty others.
pub const DETECTABLE: f64 = 10.0;
/// The error after the path may exceed that of the true model by this factor.
const AT_FLOOR: f64 = 1.05;
/// A value lies within so many of its standard deviations.
const WITHIN: f64 = 2.0;

/// What came of a case.
#[derive(Debug, Clone)]
pub struct Judgement {
    /// The case.
    pub case: LoggedCase,
    /// What is named first; empty if nothing is called missing.
    pub named: Vec<Place>,
    /// What else might be, as it says.
    pub alternatives: Vec<Vec<Place>>,
    /// What the path has in the end.
    pub path: Vec<Place>,
    /// Whether something outside the catalogue is reported.
    pub outside: bool,
    /// Held-out error in the end, and that of the true model, fitted, N m.
    pub after: f64,
    /// The latter.
    pub floor: f64,
    /// Estimate and its standard deviation of the hidden effect's leading parameter, where it is the only one missing.
    pub estimate: Option<[f64; 2]>,
    /// What the program says instead of a verdict.
    pub failure: Option<String>,
}

impl Judgement {
    /// Diagnoses a case with `program` and judges what it says.
    pub fn of(program: &Path, case: &LoggedCase) -> Self {
        let said = verdict::diagnose(program, case).and_then(|verdict| {
            let floor = verdict::held_out(program, &case.log(), &case.true_model())?.rms;
            Ok((verdict, floor))
        });
        match said {
            Ok((verdict, floor)) => Self::new(case.clone(), &verdict, floor),
            Err(failure) => Self {
                case: case.clone(),
                named: Vec::new(),
                alternatives: Vec::new(),
                path: Vec::new(),
                outside: false,
                after: f64::NAN,
                floor: f64::NAN,
                estimate: None,
                failure: Some(failure),
            },
        }
    }

    fn new(case: LoggedCase, verdict: &Verdict, floor: f64) -> Self {
        let alone = case.hidden().filter(|_| case.truth.missing.len() == 1);
        let candidate = alone.as_ref().and_then(|place| verdict.candidate(place));
        Self {
            named: verdict.named(),
            alternatives: verdict.alternatives(),
            path: verdict.path(),
            outside: !verdict.outside_catalogue.is_empty(),
            after: verdict.after(),
            floor,
            estimate: candidate.map(|c| [c.value, c.std]),
            failure: None,
            case,
        }
    }

    /// Whether the model lacks nothing.
    pub fn is_complete(&self) -> bool {
        self.case.truth.missing.is_empty()
    }

    /// Whether the log can tell what is hidden.
    pub fn is_detectable(&self) -> bool {
        self.case.truth.snr.is_none_or(|snr| snr >= DETECTABLE)
    }

    /// Whether all that is named is missing.
    pub fn is_top(&self) -> bool {
        is_right(&self.case, &self.named)
    }

    /// Whether what is named or one of its alternatives is missing.
    pub fn is_in_set(&self) -> bool {
        self.is_top() || self.alternatives.iter().any(|a| is_right(&self.case, a))
    }

    /// Whether the path has the hidden effect, or what of an equal one the model did not have yet.
    pub fn is_found(&self) -> bool {
        self.path.iter().any(|place| self.case.lacks(place))
    }

    /// What of the path is not there.
    pub fn extra(&self) -> Vec<&Place> {
        (self.path.iter())
            .filter(|place| !self.case.lacks(place))
            .collect()
    }

    /// Whether the end error is that of the true model.
    pub fn is_at_floor(&self) -> bool {
        self.after <= AT_FLOOR * self.floor
    }

    /// How many of its standard deviations the value is off; infinitely many if it has none.
    pub fn deviation(&self) -> Option<f64> {
        let [value, std] = self.estimate?;
        Some((value - self.case.truth.value?) / std).filter(|z| !z.is_nan())
    }

    /// Whether the value is right within its error.
    pub fn is_covered(&self) -> Option<bool> {
        Some(self.deviation()?.abs() <= WITHIN)
    }

    /// What is wrong, in words; empty if nothing is.
    pub fn errors(&self) -> Vec<String> {
        if let Some(failure) = &self.failure {
            return vec![failure.replace('\n', " ")];
        }
        let mut errors = Vec::new();
        let shown = |places: &[Place]| {
            let names: Vec<String> = places.iter().map(Place::to_string).collect();
            names.join(" ")
        };
        if self.is_complete() && !self.named.is_empty() {
            errors.push(format!("false alarm {}", shown(&self.named)));
        }
        if !self.is_complete() && self.is_detectable() {
            if !self.is_top() {
                let named = shown(&self.named);
                let nothing = if named.is_empty() { "nothing" } else { &named };
                let set = if self.is_in_set() { ", in the set" } else { "" };
                errors.push(format!("named {nothing}{set}"));
            }
            if !self.is_found() {
                errors.push("not in the path".to_owned());
            }
            if !self.is_at_floor() {
                let by = 100.0 * (self.after / self.floor - 1.0);
                errors.push(format!("end error {by:.0} % above the floor"));
            }
            if let (Some(false), Some(z)) = (self.is_covered(), self.deviation()) {
                errors.push(format!("value {z:+.1} std off"));
            }
        }
        let extra: Vec<Place> = self.extra().into_iter().cloned().collect();
        if !extra.is_empty() {
            errors.push(format!("extra {}", shown(&extra)));
        }
        if self.outside {
            errors.push("also outside the catalogue".to_owned());
        }
        errors
    }
}

/// Whether something is said, and all of it is missing.
fn is_right(case: &LoggedCase, places: &[Place]) -> bool {
    !places.is_empty() && places.iter().all(|place| case.lacks(place))
}
