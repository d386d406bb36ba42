//! The page of `compare --rollout`.

use std::path::Path;

use super::{Unreadable, header, of_data};
use crate::compare::{HorizonError, Rollout};
use crate::report::Page;
use crate::report::rollout::{self, Row};
use crate::report::torque::TorqueSeries;

/// Errors as a table, and each joint's position in time. `path` is the model's file.
///
/// # Errors
/// If a log cannot be read any more.
pub fn rollout(found: &Rollout, path: Option<&Path>) -> Result<Page, Unreadable> {
    let summary = found.summary(path);
    let mut findings = summary.points;
    findings.extend(found.warnings.iter().cloned());
    findings.extend(of_data(&found.data));
    let mut header = header(
        "Model run forward against measurement",
        findings,
        &found.logs,
    )?;
    header.headline = summary.headline;
    header.next = summary.next;
    let rows = |joint: &str, unit: &'static str, horizons: &[HorizonError]| {
        let row = |h: &HorizonError| Row {
            joint: joint.to_owned(),
            unit,
            seconds: h.seconds,
            rms: [h.rms, h.cad_rms, h.displacement_rms],
            rollouts: h.rollouts,
            diverged: h.diverged,
        };
        horizons.iter().map(row).collect::<Vec<_>>()
    };
    let joints = found.joints.iter();
    let joints = joints.flat_map(|own| rows(&own.joint, own.unit, &own.horizons));
    let all = rows("all joints", found.unit, &found.horizons);
    let rows: Vec<Row> = all.into_iter().chain(joints).collect();
    let under = match found.torque {
        "commanded" => "what the drives were asked to do, by the simulated motion",
        _ => "the measured torque",
    };
    let seconds = found.series.first().map_or(0.0, |own| own.seconds);
    let series: Vec<_> = (found.series.iter())
        .map(|own| {
            let simulated = own.simulated.iter();
            let series = TorqueSeries {
                joint: own.joint.clone(),
                t: own.t.clone(),
                measured: own.measured.clone(),
                predicted: simulated
                    .map(|(name, q)| ((*name).to_owned(), q.clone()))
                    .collect(),
            };
            (series, own.unit)
        })
        .collect();
    Ok(Page {
        header,
        sections: vec![
            rollout::errors(&rows, under),
            rollout::positions(&series, seconds),
        ],
    }
    .folded())
}
