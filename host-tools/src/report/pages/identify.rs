//! The page of `identify`.

use std::path::PathBuf;

use super::{Unreadable, correlations, header, residuals, torques};
use crate::compare::{Comparison, JointSeries};
use crate::detect::residual::{self, Criticism};
use crate::estimate::{ParameterEstimate, Status};
use crate::identify::{Fitted, Identification};
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
    let identified = Identified {
        rms: result.rms,
        held_out_rms: result.held_out_rms,
        cad_rms: result.urdf_rms,
        parameters: result.parameters.iter().collect(),
        warnings: result.warnings.clone(),
        logs: &result.logs,
    };
    identified.page(series, &[("CAD", cad)], &residual::criticise(&views))
}

/// The same of a model's own effects: `comparison` is that of the model that the fit became.
///
/// # Errors
/// If a log cannot be read any more.
pub fn fit(fitted: &Fitted, comparison: &Comparison) -> Result<Page, Unreadable> {
    let identified = Identified {
        rms: comparison.rms,
        held_out_rms: None,
        cad_rms: comparison.yardsticks.cad_rms,
        parameters: fitted.parameters.iter().map(|p| &p.estimate).collect(),
        warnings: (fitted.warnings.iter().cloned())
            .chain(comparison.contact_sentences())
            .collect(),
        logs: &fitted.logs,
    };
    let Comparison {
        series,
        baselines,
        criticism,
        ..
    } = comparison;
    identified.page(series, baselines, criticism)
}

/// What both ways to identify tell; errors in N m.
struct Identified<'a> {
    rms: f64,
    held_out_rms: Option<f64>,
    cad_rms: f64,
    parameters: Vec<&'a ParameterEstimate>,
    warnings: Vec<String>,
    logs: &'a [PathBuf],
}

impl Identified<'_> {
    fn page(
        &self,
        series: &[JointSeries],
        baselines: &[(&'static str, Vec<JointSeries>)],
        criticism: &[Criticism],
    ) -> Result<Page, Unreadable> {
        let is_identified = |p: &&&ParameterEstimate| p.status == Status::Identified;
        let mut findings = vec![format!(
            "Torque error {:.4} N m rms{}; {:.4} with the CAD alone. {} of {} parameters are identified.",
            self.rms,
            self.held_out_rms.map_or(String::new(), |rms| format!(
                ", {rms:.4} on data the fit has not seen"
            )),
            self.cad_rms,
            self.parameters.iter().filter(is_identified).count(),
            self.parameters.len(),
        )];
        findings.extend(self.warnings.iter().cloned());
        let name = "identified";
        let step = |label: &str, rms| Step {
            label: label.to_owned(),
            rms,
        };
        let ladder = [step("CAD", self.cad_rms), step(name, self.rms)];
        let rows: Vec<ParameterRow> = self.parameters.iter().map(|p| row(p)).collect();
        Ok(Page {
            header: header("What was identified", findings, self.logs)?,
            sections: vec![
                waterfall::section(&ladder, None),
                torques(series, baselines, name),
                residuals(series, name),
                correlations(criticism, name),
                parameters::section(&rows),
            ],
        })
    }
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
