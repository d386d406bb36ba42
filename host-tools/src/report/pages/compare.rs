//! The page of `compare`.

use super::{Unreadable, correlations, header, of_data, residuals, torques};
use crate::compare::Comparison;
use crate::compare::EffectValue;
use crate::report::parameters::{self, ParameterRow};
use crate::report::waterfall::{self, Step};
use crate::report::{Page, Section};

/// Patterns told in the header.
const TOLD: usize = 3;

/// Model against measurement: errors, torque, residual and its correlations, the effects' values.
///
/// # Errors
/// If a log cannot be read any more.
pub fn comparison(comparison: &Comparison) -> Result<Page, Unreadable> {
    let mut findings = vec![format!("{}.", comparison.headline())];
    findings.extend(of_data(&comparison.data));
    findings.extend(comparison.contact_sentences());
    let told = comparison.patterns.iter().take(TOLD);
    findings.extend(told.map(|p| {
        format!(
            "{:.0} % of the square error: {}.",
            p.share_percent, p.sentence
        )
    }));
    Ok(Page {
        header: header("Model against measurement", findings, &comparison.logs)?,
        sections: sections(comparison, &ladder(comparison)),
    })
}

/// The sections of a comparison after those of how the error fell.
pub(super) fn sections(comparison: &Comparison, ladder: &[Step]) -> Vec<Section> {
    let name = "model";
    let mut sections = vec![
        waterfall::section(ladder, comparison.yardsticks.noise_floor_rms),
        torques(&comparison.series, &comparison.baselines, name),
        residuals(&comparison.series, name),
        correlations(&comparison.criticism, name),
    ];
    if !comparison.effects.is_empty() {
        let rows: Vec<ParameterRow> = comparison.effects.iter().map(row).collect();
        sections.push(parameters::section(&rows));
    }
    sections
}

/// From nothing over the baselines to the model.
fn ladder(comparison: &Comparison) -> Vec<Step> {
    let step = |label: &str, rms| Step {
        label: label.to_owned(),
        rms,
    };
    let mut steps = vec![
        step("no model", comparison.yardsticks.zero_rms),
        step("CAD", comparison.yardsticks.cad_rms),
    ];
    steps.extend(
        comparison
            .yardsticks
            .before_rms
            .map(|rms| step("before", rms)),
    );
    let last = if comparison.added.is_empty() || comparison.added.len() > 3 {
        "model".to_owned()
    } else {
        format!("+ {}", comparison.added.join(", "))
    };
    steps.push(step(&last, comparison.rms));
    steps
}

fn row(effect: &EffectValue) -> ParameterRow {
    let status = match (effect.value, effect.std) {
        (None, _) => "no value yet",
        (Some(_), Some(std)) if std > 0.99 * effect.prior_std => "unexcited",
        (Some(_), Some(std)) if std > 0.5 * effect.prior_std => "prior",
        _ => "identified",
    };
    ParameterRow {
        name: effect.name.clone(),
        unit: effect.unit.to_owned(),
        value: effect.value.unwrap_or(f64::NAN),
        std: effect.std.unwrap_or(f64::NAN),
        prior: effect.prior,
        prior_std: effect.prior_std,
        status: status.to_owned(),
    }
}
