//! The pages of a walk: `compare`, `identify` and `diagnose` with `--free-base`.

use std::path::Path;

use super::diagnose::{bars, ladder};
use super::identify::row;
use super::{Unreadable, add_moments, compare, drawing, header, torques};
use crate::compare::{CoordinateError, FreeBaseComparison};
use crate::diagnose::FreeBaseDiagnosis;
use crate::identify::FreeBaseIdentification;
use crate::model::Model;
use crate::report::parameters::{self, ParameterRow};
use crate::report::{Page, Section, stance, waterfall};
use crate::summary::Summary;

/// A model against walks: each joint's torque over time in the equations that contact forces leave, and the feet that were left out. `path` is the model's file.
///
/// # Errors
/// If a log cannot be read any more.
pub fn walk(
    found: &FreeBaseComparison,
    model: &Model,
    path: Option<&Path>,
) -> Result<Page, Unreadable> {
    let of = |own: &CoordinateError| {
        format!(
            "{}: error {:.3} {} (CAD alone {:.3}, no model {:.3}).",
            own.name, own.rms, own.unit, own.cad_rms, own.zero_rms
        )
    };
    let summary = found.summary(path);
    let mut findings = summary.points;
    findings.extend(found.coordinates.iter().take(6).map(of));
    findings.extend(found.comparison.warnings.iter().cloned());
    let mut header = header("A walk against the model", findings, &found.comparison.logs)?;
    add_moments(&mut header.findings, &found.comparison);
    header.headline = summary.headline;
    header.next = summary.next;
    header.drawing = drawing(model, &found.comparison.series);
    let mut sections = vec![stance::section(&found.feet, &found.names_of_feet)];
    sections.extend(compare::sections(
        &found.comparison,
        &compare::ladder(&found.comparison),
    ));
    Ok(Page { header, sections }.folded())
}

/// What was identified of a robot that walks; `comparison` is that of `model`, which the fit became; `file` is that of the model that was
/// fitted, `written` the one that has the values.
///
/// # Errors
/// If a log cannot be read any more.
pub fn walk_identification(
    found: &FreeBaseIdentification,
    comparison: &FreeBaseComparison,
    model: &Model,
    [file, written]: [Option<&Path>; 2],
) -> Result<Page, Unreadable> {
    let of = |own: &crate::identify::Quantity| {
        format!(
            "{}: {:.4} ± {:.4} {} (CAD {:.4}).",
            own.name, own.value, own.std, own.unit, own.prior
        )
    };
    let summary = found.summary(file, written);
    let points = summary.points.iter();
    // The star is that of a screen's table.
    let starred = |point: &String| point.replace("* at a bound", "At a bound");
    let mut findings: Vec<String> = points.map(starred).collect();
    findings.extend(found.quantities.iter().map(of));
    findings.extend(found.warnings.iter().cloned());
    let mut header = header("What was identified of a walk", findings, &found.logs)?;
    add_moments(&mut header.findings, &comparison.comparison);
    header.headline = summary.headline;
    header.next = summary.next;
    header.drawing = drawing(model, &comparison.comparison.series);
    let rows: Vec<ParameterRow> = found.parameters.iter().map(row).collect();
    let mut sections: Vec<Section> = feet_and_torques(comparison).into();
    sections.push(parameters::section(&rows));
    Ok(Page { header, sections }.folded())
}

/// What the model of a robot that walks lacks; `after` is the comparison of the model that has all of it, `complete`.
///
/// # Errors
/// If a log cannot be read any more.
pub fn walk_diagnosis(
    found: &FreeBaseDiagnosis,
    after: &FreeBaseComparison,
    complete: &Model,
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
    header.drawing = drawing(complete, &after.comparison.series);
    let mut sections = vec![
        waterfall::section(&ladder(diagnosis), None),
        bars(diagnosis),
    ];
    sections.extend(feet_and_torques(after));
    Ok(Page { header, sections }.folded())
}

/// When each foot was taken to carry a force, and each joint's torque over time.
fn feet_and_torques(found: &FreeBaseComparison) -> [Section; 2] {
    let comparison = &found.comparison;
    [
        stance::section(&found.feet, &found.names_of_feet),
        torques(&comparison.series, &comparison.baselines, "model"),
    ]
}
