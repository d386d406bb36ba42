//! Positions of a model run forward against measured ones, and the errors after each horizon.

use super::data_table::{Cell, Column, DataTable};
use super::section::Section;
use super::torque::{self, TorqueSeries};

/// A joint's error after a time, or that over all joints.
#[derive(Debug, Clone)]
pub struct Row {
    /// The joint, or all of them.
    pub joint: String,
    /// Its unit: rad or m.
    pub unit: &'static str,
    /// Length of the rollouts, s.
    pub seconds: f64,
    /// Root mean square of measured less simulated position at their ends, by the model, by the CAD alone, and by a joint that stays.
    pub rms: [Option<f64>; 3],
    /// How many rollouts.
    pub rollouts: usize,
    /// How many of them diverged.
    pub diverged: usize,
}

/// A table that can be sorted, of rollouts under a torque, in words.
pub fn errors(rows: &[Row], under: &str) -> Section {
    let column = Column::new;
    let row = |row: &Row| {
        let rms = row.rms.map(|rms| match rms {
            Some(rms) => Cell::number(format!("{rms:.5}"), rms),
            None => Cell::text(""),
        });
        let count = |n: usize| Cell::number(n.to_string(), n as f64);
        [Cell::text(row.joint.clone()), Cell::text(row.unit)]
            .into_iter()
            .chain([Cell::number(row.seconds.to_string(), row.seconds)])
            .chain(rms)
            .chain([count(row.rollouts), count(row.diverged)])
            .collect()
    };
    Section {
        id: "errors",
        title: "Error after a time",
        text: format!(
            "Root mean square of measured less simulated position at the end of rollouts, each from the measured state and under {under}. A \
             rollout that diverged is in no error."
        ),
        table: Some(DataTable {
            columns: vec![
                column("joint", false),
                column("unit", false),
                column("after, s", true),
                column("model", true),
                column("CAD alone", true),
                column("joints’ displacement", true),
                column("rollouts", true),
                column("diverged", true),
            ],
            rows: rows.iter().map(row).collect(),
        }),
        ..Section::default()
    }
}

/// A plot for each joint, with its unit; `predicted` are simulated positions, started anew every so many `seconds`.
pub fn positions(series: &[(TorqueSeries, &'static str)], seconds: f64) -> Section {
    let all: Vec<TorqueSeries> = series.iter().map(|(own, _)| own.clone()).collect();
    let opening = torque::worst_stretch(&all);
    Section {
        id: "positions",
        title: "Position against time",
        text: format!(
            "Each plot is a joint: its measured position, and where each model comes from the measured state under the measured torque, \
             started anew every {seconds} s; below, on a scale of its own, the error of the last model."
        ),
        legend: all.first().map_or_else(Vec::new, torque::legend),
        figures: (series.iter())
            .map(|(own, unit)| torque::figure(own, opening, &format!("position ({unit})")))
            .collect(),
        columns: 3,
        ..Section::default()
    }
}
