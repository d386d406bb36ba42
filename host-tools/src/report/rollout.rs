//! Positions of a model run forward against measured ones, and the errors after each horizon.

use plotly::Scatter;
use plotly::common::Mode;
use plotly::layout::AxisType;

use super::data_table::{Cell, Column, DataTable};
use super::figure::{Figure, axis, colour, dash, layout, line, plotted};
use super::section::{Key, Mark, Section};
use super::torque::{self, TorqueSeries};

/// What errors are of, and how a plot shows each.
const KINDS: [&str; 3] = ["model", "CAD alone", "joints’ displacement"];
const COLOURS: [&str; 3] = [colour::MODELS[0], colour::MODELS[1], colour::MEASURED];
const MARKS: [Mark; 3] = [Mark::Solid, Mark::Dashed, Mark::Dotted];

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
        legend: (KINDS.iter().zip(COLOURS).enumerate())
            .map(|(n, (kind, colour))| Key::new(kind, colour, MARKS[n], Some(n)))
            .collect(),
        figures: vec![growth(rows)],
        columns: 1,
        table: Some(DataTable {
            columns: vec![
                column("joint", false),
                column("unit", false),
                column("after, s", true),
                column(KINDS[0], true),
                column(KINDS[1], true),
                column(KINDS[2], true),
                column("rollouts", true),
                column("diverged", true),
            ],
            rows: rows.iter().map(row).collect(),
        }),
        ..Section::default()
    }
}

/// The error over all joints by the length of the rollouts: the rows of the first name.
fn growth(rows: &[Row]) -> Figure {
    let all = || rows.iter().filter(|row| row.joint == rows[0].joint);
    let trace = |n: usize| {
        let values = all().map(|row| row.rms[n].unwrap_or(f64::NAN));
        Scatter::new(plotted(all().map(|row| row.seconds)), plotted(values))
            .name(KINDS[n])
            .mode(Mode::LinesMarkers)
            .line(line(COLOURS[n], 2.0).dash(dash(n))) as Box<dyn plotly::Trace>
    };
    let logarithmic = |title: &str| axis(title).type_(AxisType::Log);
    let unit = rows.first().map_or("rad", |row| row.unit);
    Figure {
        title: "Error over all joints".to_owned(),
        traces: (0..KINDS.len()).map(trace).collect(),
        layout: layout(
            logarithmic("after (s)").tick_values(all().map(|row| row.seconds).collect()),
            logarithmic(&format!("error ({unit} rms)")).dtick(1.0),
        ),
        group: None,
        height: 320,
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
