//! Logs of which a part was drawn: the errors over every window, minute by minute.

use plotly::Scatter;
use plotly::common::Mode;

use super::data_table::{Cell, Column, DataTable};
use super::figure::{Figure, axis, colour, dash, layout, line, plotted};
use super::section::{Key, Mark, Section};
use crate::detect::every_window::{EveryWindow, MinuteErrors};

/// A plot, and a table that can be sorted; `names` are those of the model before and after.
pub(crate) fn section(every: &EveryWindow, names: [&str; 2]) -> Section {
    let of = [
        |minute: &MinuteErrors| minute.before_rms,
        |minute: &MinuteErrors| minute.after_rms,
    ];
    let start = || plotted(every.minutes.iter().map(|minute| minute.t / 60.0));
    let traces = (0..2).map(|n| {
        let trace = Scatter::new(start(), plotted(every.minutes.iter().map(of[n])))
            .name(names[n])
            .mode(Mode::LinesMarkers)
            .line(line(colour::MODELS[n], 1.5).dash(dash(n)));
        trace as Box<dyn plotly::Trace>
    });
    let legend = (0..2).map(|n| Key {
        label: names[n].to_owned(),
        colour: colour::MODELS[n],
        mark: if n == 0 { Mark::Solid } else { Mark::Dashed },
        trace: Some(n),
    });
    let row = |minute: &MinuteErrors| {
        let number = |x: f64| Cell::number(format!("{x:.4}"), x);
        vec![
            Cell::text(minute.log.display().to_string()),
            Cell::number(format!("{:.0}", minute.start), minute.start),
            number(minute.before_rms),
            number(minute.after_rms),
            Cell::text(minute.worst_joint.clone()),
            number(minute.worst_joint_rms),
        ]
    };
    let column = Column::new;
    Section {
        id: "minutes",
        title: "Every window, by the minute",
        text: format!(
            "The log is long: fits and plots are of a part of it, drawn evenly over time. Here the models predict every window of its {:.0} s; \
             errors are root mean squares over all joints.",
            every.seconds
        ),
        legend: legend.collect(),
        figures: vec![Figure {
            title: "Error of each minute".to_owned(),
            traces: traces.collect(),
            layout: layout(axis("time (min)"), axis("error (N m)")),
            group: None,
            height: 260,
        }],
        table: Some(DataTable {
            columns: vec![
                column("log", false),
                column("from, s", true),
                column("before, N m", true),
                column("after, N m", true),
                column("worst joint", false),
                column("its error, N m", true),
            ],
            rows: every.minutes.iter().map(row).collect(),
        }),
        ..Section::default()
    }
}
