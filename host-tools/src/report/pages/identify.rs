//! The page of `identify`.

use super::{Unreadable, correlations, header, residuals, torques};
use crate::criticism::comparison::JointSeries;
use crate::criticism::residual;
use crate::estimate::{ParameterEstimate, Status};
use crate::identification::Identification;
use crate::report::Page;
use crate::report::parameters::{self, ParameterRow};
use crate::report::waterfall::{self, Step};

/// What was identified: errors, torque under the CAD and under the estimate, residual and its correlations, parameters.
///
/// # Errors
/// If a log cannot be read any more.
pub fn identification(
    result: &Identification,
    cad: Vec<JointSeries>,
    series: &[JointSeries],
) -> Result<Page, Unreadable> {
    let views: Vec<_> = series.iter().map(JointSeries::view).collect();
    let criticism = residual::criticise(&views);
    let identified = result.parameters.iter();
    let identified = identified
        .filter(|p| p.status == Status::Identified)
        .count();
    let mut findings = vec![format!(
        "Torque error {:.4} N m rms{}; {:.4} with the CAD alone. {identified} of {} parameters are identified.",
        result.rms,
        result.held_out_rms.map_or(String::new(), |rms| format!(
            ", {rms:.4} on data the fit has not seen"
        )),
        result.urdf_rms,
        result.parameters.len(),
    )];
    findings.extend(result.warnings.iter().cloned());
    let name = "identified";
    let step = |label: &str, rms| Step {
        label: label.to_owned(),
        rms,
    };
    let ladder = [step("CAD", result.urdf_rms), step(name, result.rms)];
    let rows: Vec<ParameterRow> = result.parameters.iter().map(row).collect();
    Ok(Page {
        header: header("What was identified", findings, &result.logs)?,
        sections: vec![
            waterfall::section(&ladder, None),
            torques(series, &[("CAD", cad)], name),
            residuals(series, name),
            correlations(&criticism, name),
            parameters::section(&rows),
        ],
    })
}

fn row(p: &ParameterEstimate) -> ParameterRow {
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
