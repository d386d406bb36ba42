//! The page of `compare`.

use std::path::Path;

use super::{Unreadable, add_moments, correlations, drawing, header, of_data, residuals, torques};
use crate::compare::{Comparison, EffectValue, choices};
use crate::model::Model;
use crate::recording::Recording;
use crate::report::choices::{self as tick_boxes, Told};
use crate::report::minutes;
use crate::report::parameters::{self, ParameterRow};
use crate::report::waterfall::{self, Step};
use crate::report::{Page, Section};

/// Model against measurement: what to tick, errors, torque, residual and its correlations, the effects' values. `path` is the model's
/// file.
///
/// # Errors
/// If a log cannot be read any more.
pub fn comparison(
    comparison: &Comparison,
    recording: &Recording,
    model: &Model,
    path: Option<&Path>,
) -> Result<Page, Unreadable> {
    let summary = comparison.summary(path);
    let mut findings = summary.points;
    findings.extend(of_data(&comparison.data));
    findings.extend(comparison.contact_sentences().into_iter().skip(1));
    let effects = model.effects().iter();
    let names = effects.map(|e| format!("{}:{}", e.effect.name(), model.joint_name(e.joint)));
    let before =
        names.filter(|name| !comparison.added.is_empty() && !comparison.added.contains(name));
    let with = crate::summary::typed(&comparison.logs, path);
    let told = Told {
        before: before.collect(),
        compare: format!("proprio compare {with} --fit"),
        ..told(comparison)
    };
    let mut header = header("Model against measurement", findings, &comparison.logs)?;
    add_moments(&mut header.findings, comparison);
    header.headline = summary.headline;
    header.next = summary.next;
    header.drawing = drawing(model, &comparison.series);
    let mut sections = sections(comparison, &ladder(comparison));
    sections.splice(0..0, try_out(recording, model, &told)?);
    Ok(Page { header, sections }.folded())
}

/// What the tick boxes are told of a comparison.
pub(super) fn told(comparison: &Comparison) -> Told {
    Told {
        before: Vec::new(),
        floors: (comparison.joints.iter())
            .map(|joint| (joint.joint.clone(), joint.yardsticks.noise_floor_rms))
            .collect(),
        floor: comparison.yardsticks.noise_floor_rms,
        first: Vec::new(),
        compare: String::new(),
        rms: comparison.rms,
    }
}

/// Tick boxes, if the model can be fitted to the recording.
pub(super) fn try_out(
    recording: &Recording,
    model: &Model,
    told: &Told,
) -> Result<Option<Section>, Unreadable> {
    let section = choices(recording, model).map(|choices| tick_boxes::section(&choices, told));
    section.transpose().map_err(|e| (String::new(), e))
}

/// The sections of a comparison after those of how the error fell.
pub(super) fn sections(comparison: &Comparison, ladder: &[Step]) -> Vec<Section> {
    let name = "model";
    let every = comparison.every_window.iter();
    let every = every.map(|every| minutes::section(every, ["as given", name]));
    let ladder: Vec<Step> = ladder.iter().cloned().chain(boxes(comparison)).collect();
    let mut sections = vec![
        waterfall::section(&ladder, comparison.yardsticks.noise_floor_rms),
        torques(&comparison.series, &comparison.baselines, name),
        residuals(&comparison.series, name),
        correlations(&comparison.criticism, name),
    ];
    sections.splice(1..1, every);
    if !comparison.effects.is_empty() {
        let rows: Vec<ParameterRow> = comparison.effects.iter().map(row).collect();
        sections.push(parameters::section(&rows));
    }
    sections
}

/// How far black boxes come beyond the model: a larger one that does no better is the smaller one.
fn boxes(comparison: &Comparison) -> Vec<Step> {
    let mut least = f64::INFINITY;
    let rungs = comparison.black_box.iter().flat_map(|boxes| &boxes.rungs);
    rungs
        .map(|rung| {
            least = least.min(rung.rms);
            Step {
                label: format!("non-parametric bound: {}", rung.sees.in_short()),
                joints: Vec::new(),
                rms: least.min(comparison.rms),
            }
        })
        .collect()
}

/// From nothing over the baselines to the model.
pub(super) fn ladder(comparison: &Comparison) -> Vec<Step> {
    let step = |label: &str, rms| Step {
        label: label.to_owned(),
        joints: Vec::new(),
        rms,
    };
    let mut steps = vec![
        step("no model", comparison.yardsticks.zero_rms),
        step("CAD", comparison.yardsticks.cad_rms),
    ];
    steps.extend(comparison.before_rms.map(|rms| step("before", rms)));
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
