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
    let mut names: Vec<String> = Vec::new();
    for own in &found.models {
        let name = own.model.display().to_string();
        // One file named twice is two models.
        let same = names
            .iter()
            .filter(|known| known.split(" (").next() == Some(&name))
            .count();
        names.push(match same {
            0 => name,
            n => format!("{name} ({})", n + 1),
        });
    }
    let rows = found.models.iter().zip(&names).flat_map(|(own, name)| {
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
            models::section(&rows, &names),
            torques(best, &others, &names[found.best]),
        ],
    }
    .folded())
}
