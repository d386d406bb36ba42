//! The page of a walk: `compare --free-base`.

use super::{Unreadable, header};
use crate::compare::{CoordinateError, FreeBaseComparison, WalkSeries};
use crate::report::torque::{self, TorqueSeries};
use crate::report::{Page, stance};

/// A model against walks: each joint's torque over time in the equations that contact forces leave, and the feet that were left out.
///
/// # Errors
/// If a log cannot be read any more.
pub fn walk(comparison: &FreeBaseComparison) -> Result<Page, Unreadable> {
    let of = |own: &CoordinateError| {
        format!(
            "{}: {:.3} {} is left, {:.3} with the CAD alone, {:.3} of nothing.",
            own.name, own.rms, own.unit, own.cad_rms, own.zero_rms
        )
    };
    let mut worst: Vec<_> = comparison.coordinates.iter().skip(6).collect();
    worst.sort_by(|a, b| b.rms.total_cmp(&a.rms));
    let base = comparison.coordinates.iter().take(6);
    let mut findings: Vec<String> = worst.into_iter().chain(base).map(of).collect();
    findings.extend(comparison.warnings.iter().cloned());
    let mut header = header("A walk against the model", findings, &comparison.logs)?;
    header.headline = format!(
        "{:.3} N m where the CAD alone leaves {:.3}, in the {} equations of {} windows that contact forces leave",
        comparison.rms, comparison.cad_rms, comparison.windows.equations, comparison.windows.used
    );
    let series = comparison
        .series
        .iter()
        .map(|own: &WalkSeries| TorqueSeries {
            joint: own.joint.clone(),
            t: own.t.clone(),
            measured: own.measured.clone(),
            predicted: vec![
                ("the CAD alone".to_owned(), own.cad.clone()),
                ("the model".to_owned(), own.model.clone()),
            ],
        });
    Ok(Page {
        header,
        sections: vec![
            stance::section(&comparison.feet),
            torque::section(&series.collect::<Vec<_>>()),
        ],
    })
}
