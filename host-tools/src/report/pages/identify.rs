//! The page of `identify`.

use std::path::Path;

use super::{Unreadable, add_moments, correlations, drawing, header, residuals, torques};
use crate::compare::Comparison;
use crate::estimate::{ParameterEstimate, Status};
use crate::identify::Fitted;
use crate::model::Model;
use crate::report::Page;
use crate::report::parameters::{self, ParameterRow};
use crate::report::waterfall::{self, Step};
use crate::summary::torque;

/// What was identified: errors, torque under the CAD and under the estimate, residual and its correlations, parameters. `comparison` is that
/// of `model`, which the fit became; `file` is that of the model that was fitted, `written` the one that has the values.
///
/// # Errors
/// If a log cannot be read any more.
pub fn fit(
    fitted: &Fitted,
    comparison: &Comparison,
    model: &Model,
    [file, written]: [Option<&Path>; 2],
) -> Result<Page, Unreadable> {
    let parameters = || fitted.parameters.iter().map(|p| &p.estimate);
    let is_identified = |p: &&ParameterEstimate| p.status == Status::Identified;
    let errors = &fitted.yardsticks;
    let after = fitted.held_out_rms.unwrap_or(fitted.rms);
    let summary = fitted.summary(file, written);
    let points = summary.points.iter();
    // The star is that of a screen's table.
    let starred = |point: &String| point.replace("* at a bound", "At a bound");
    let mut findings: Vec<String> = points.map(starred).collect();
    findings.push(format!(
        "Held-out error {} N m (fitted data {}, file as given {}, CAD alone {}; {}). {} of {} parameters are identified.",
        torque(after),
        torque(fitted.rms),
        torque(errors.given_rms),
        torque(errors.cad_rms),
        errors.floor_words(after),
        parameters().filter(is_identified).count(),
        fitted.parameters.len(),
    ));
    findings.extend(fitted.warnings.iter().cloned());
    findings.extend(comparison.contact_sentences());
    let name = "identified";
    let step = |label: &str, rms| Step {
        label: label.to_owned(),
        joints: Vec::new(),
        rms,
    };
    let ladder = [
        step("CAD", errors.cad_rms),
        step("file as given", errors.given_rms),
        step(name, after),
    ];
    let rows: Vec<ParameterRow> = parameters().map(row).collect();
    let mut header = header("What was identified", findings, &fitted.logs)?;
    add_moments(&mut header.findings, comparison);
    header.headline = summary.headline;
    header.next = summary.next;
    header.drawing = drawing(model, &comparison.series);
    Ok(Page {
        header,
        sections: vec![
            waterfall::section(&ladder, errors.noise_floor_rms),
            torques(&comparison.series, &comparison.baselines, name),
            residuals(&comparison.series, name),
            correlations(&comparison.criticism, name),
            parameters::section(&rows),
        ],
    }
    .folded())
}

/// A row of the parameters' table.
pub(super) fn row(p: &ParameterEstimate) -> ParameterRow {
    let status = match p.status {
        Status::Identified => "identified",
        Status::Prior => "prior",
        Status::Unexcited => "unexcited",
    };
    ParameterRow {
        name: p.name.clone(),
        unit: p.unit.to_owned(),
        value: p.value,
        std: p.std,
        prior: p.prior,
        prior_std: p.prior_std,
        status: status.to_owned(),
    }
}
