//! The pages of a walk: `compare`, `identify` and `diagnose` with `--free-base`.

use std::path::Path;

use super::diagnose::{bars, ladder};
use super::identify::row;
use super::{Unreadable, add_moments, compare, header, torques};
use crate::compare::{CoordinateError, FreeBaseComparison};
use crate::diagnose::FreeBaseDiagnosis;
use crate::identify::FreeBaseIdentification;
use crate::report::parameters::{self, ParameterRow};
use crate::report::{Page, Section, stance, waterfall};
use crate::summary::Summary;

/// A model against walks: each joint's torque over time in the equations that contact forces leave, and the feet that were left out.
///
/// # Errors
/// If a log cannot be read any more.
pub fn walk(found: &FreeBaseComparison, model: Option<&Path>) -> Result<Page, Unreadable> {
    let of = |own: &CoordinateError| {
        format!(
            "{}: {:.3} {} is left, {:.3} with the CAD alone, {:.3} of nothing.",
            own.name, own.rms, own.unit, own.cad_rms, own.zero_rms
        )
    };
    let summary = found.summary(model);
    let mut findings = summary.points;
    findings.extend(found.coordinates.iter().take(6).map(of));
    findings.extend(found.comparison.warnings.iter().cloned());
    let mut header = header("A walk against the model", findings, &found.comparison.logs)?;
    add_moments(&mut header.findings, &found.comparison);
    header.headline = summary.headline;
    header.next = summary.next;
    let mut sections = vec![stance::section(&found.feet, &found.names_of_feet)];
    sections.extend(compare::sections(
        &found.comparison,
        &compare::ladder(&found.comparison),
    ));
    Ok(Page { header, sections })
}

/// What was identified of a robot that walks; `comparison` is that of the model that the fit became.
///
/// # Errors
/// If a log cannot be read any more.
pub fn walk_identification(
    found: &FreeBaseIdentification,
    comparison: &FreeBaseComparison,
) -> Result<Page, Unreadable> {
    let of = |own: &crate::identify::Quantity| {
        format!(
            "{}: {:.4} ± {:.4} {}, {:.4} on paper.",
            own.name, own.value, own.std, own.unit, own.prior
        )
    };
    let mut findings: Vec<String> = found.quantities.iter().map(of).collect();
    findings.extend(found.warnings.iter().cloned());
    let mut header = header("What was identified of a walk", findings, &found.logs)?;
    header.headline = format!(
        "Error {:.4} N m{}, {:.4} with the CAD alone, in the {} equations of {} windows, contact forces eliminated",
        found.rms,
        found
            .held_out_rms
            .map_or(String::new(), |rms| format!(", {rms:.4} held out")),
        found.cad_rms,
        found.windows.equations,
        found.windows.used
    );
    let rows: Vec<ParameterRow> = found.parameters.iter().map(row).collect();
    let mut sections: Vec<Section> = feet_and_torques(comparison).into();
    sections.push(parameters::section(&rows));
    Ok(Page { header, sections })
}

/// What the model of a robot that walks lacks; `after` is the comparison of the model that has all of it.
///
/// # Errors
/// If a log cannot be read any more.
pub fn walk_diagnosis(
    found: &FreeBaseDiagnosis,
    after: &FreeBaseComparison,
    summary: Summary,
) -> Result<Page, Unreadable> {
    let diagnosis = &found.diagnosis;
    let mut findings = summary.points;
    findings.extend(diagnosis.outside_catalogue.iter().cloned());
    findings.extend(diagnosis.warnings.iter().cloned());
    let mut header = header("What the model of a walk lacks", findings, &diagnosis.logs)?;
    add_moments(&mut header.findings, &after.comparison);
    header.headline = summary.headline;
    header.next = summary.next;
    let mut sections = vec![
        waterfall::section(&ladder(diagnosis), None),
        bars(diagnosis).folded(),
    ];
    sections.extend(feet_and_torques(after));
    Ok(Page { header, sections })
}

/// When each foot was taken to carry a force, and each joint's torque over time.
fn feet_and_torques(found: &FreeBaseComparison) -> [Section; 2] {
    let comparison = &found.comparison;
    [
        stance::section(&found.feet, &found.names_of_feet),
        torques(&comparison.series, &comparison.baselines, "model"),
    ]
}
