//! The page of `compare` with several models.

use super::{Unreadable, header, of_data, torques};
use crate::compare::ModelsComparison;
use crate::report::Page;
use crate::report::models::{self, Row};

/// Errors as a table, and each joint's torque with what every model predicts.
///
/// # Errors
/// If a log cannot be read any more.
pub fn models(found: &ModelsComparison) -> Result<Page, Unreadable> {
    let mut findings = found.differences();
    findings.extend(found.warnings.iter().cloned());
    findings.extend(of_data(&found.data));
    let mut header = header("Models against measurement", findings, &found.logs)?;
    header.headline = found.headline();
    header.next = vec![found.next()];
    let names: Vec<String> = (found.models.iter())
        .map(|own| own.model.display().to_string())
        .collect();
    let rows = found.models.iter().flat_map(|own| {
        let name = own.model.display().to_string();
        let all = Row {
            model: name.clone(),
            joint: "all joints".to_owned(),
            rms: own.rms,
            fit_percent: own.fit_percent,
            floor: found.error().floor,
        };
        let joints = own.joints.iter().map(move |joint| Row {
            model: name.clone(),
            joint: joint.joint.clone(),
            rms: joint.rms,
            fit_percent: joint.fit_percent,
            floor: joint.floor,
        });
        [all].into_iter().chain(joints).collect::<Vec<_>>()
    });
    let rows: Vec<Row> = rows.collect();
    // The best is drawn last, over the others.
    let best = &found.series[found.best];
    let others = names.iter().zip(&found.series).enumerate();
    let others = others.filter(|(n, _)| *n != found.best);
    let others: Vec<_> = (others)
        .map(|(_, (name, series))| (name.clone(), series.clone()))
        .collect();
    Ok(Page {
        header,
        sections: vec![
            models::section(&rows),
            torques(best, &others, &names[found.best]),
        ],
    }
    .folded())
}
