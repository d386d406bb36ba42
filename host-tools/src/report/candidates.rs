//! Which effects would help, and by how much.

use plotly::Bar;
use plotly::common::{ErrorData, ErrorType, Marker, Orientation};
use plotly::layout::Shape;

use super::data_table::{Cell, Column, DataTable};
use super::figure::{Figure, axis, colour, layout, plotted};
use super::section::{Key, Mark, Section};
use super::waterfall::{height_of_bars, in_full, label_axis, row_positions};

/// Bars drawn; the table has all.
const BARS: usize = 20;

/// An effect that may be missing.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// What it is, such as `coulomb, all calves`.
    pub name: String,
    /// Names of the joints where the name only counts them.
    pub joints: Vec<String>,
    /// Share of the held-out squared error which it takes away: 1 − RSS with it / RSS without it.
    pub gain: f64,
    /// Standard error of that.
    pub gain_std: f64,
    /// What cannot be told apart from it on this log.
    pub look_alikes: Vec<String>,
}

/// Bars for the candidates, best first, and a table with their look-alikes.
pub fn section(candidates: &[Candidate]) -> Section {
    let figures = if candidates.is_empty() {
        Vec::new()
    } else {
        vec![figure(&candidates[..candidates.len().min(BARS)])]
    };
    let key = |label: &str, colour, mark| Key {
        label: label.to_owned(),
        colour,
        mark,
        trace: None,
    };
    Section {
        id: "candidates",
        title: "What each missing effect would gain",
        text: "Each bar is an effect added alone: the share of the held-out squared error that it explains, \
               with its standard error. A bar that does not clear zero by some of its errors is no evidence. Look-alikes \
               explain this log equally well: another motion separates them. The number after \
               ≈ says how many there are; the table names them."
            .to_owned(),
        legend: vec![
            key("gain", colour::BAR, Mark::Area),
            key("± standard error", colour::ERROR, Mark::Solid),
        ],
        figures,
        table: (!candidates.is_empty()).then(|| table(candidates)),
        columns: 1,
        ..Section::default()
    }
}

fn figure(candidates: &[Candidate]) -> Figure {
    let rows = row_positions(candidates.len());
    let percent = |share: f64| 100.0 * share;
    let gains = plotted(candidates.iter().map(|c| percent(c.gain)));
    let errors = ErrorData::new(ErrorType::Data)
        .array(plotted(candidates.iter().map(|c| percent(c.gain_std))))
        .color(colour::ERROR)
        .thickness(1.5)
        .width(4);
    let bars = Bar::new(gains, rows.clone())
        .name("gain")
        .orientation(Orientation::Horizontal)
        .marker(Marker::new().color(colour::BAR))
        .error_x(errors)
        .hover_template("%{x:.2f} %");
    let labels: Vec<String> = candidates
        .iter()
        .map(|c| match c.look_alikes.len() {
            0 => c.name.clone(),
            n => format!("{} (≈ {n})", c.name),
        })
        .collect();
    let x = axis("gain on held-out data (%)");
    let y = label_axis(&rows, labels.iter().map(String::as_str));
    Figure {
        title: String::new(),
        traces: vec![bars],
        layout: layout(x, y).shapes(Vec::<Shape>::new()),
        group: None,
        height: height_of_bars(candidates.len()),
    }
}

fn table(candidates: &[Candidate]) -> DataTable {
    let column = |title, numeric| Column { title, numeric };
    let row = |candidate: &Candidate| {
        let (gain, std) = (100.0 * candidate.gain, 100.0 * candidate.gain_std);
        let alike = match candidate.look_alikes.as_slice() {
            [] => "none".to_owned(),
            alike => alike.join(", "),
        };
        vec![
            Cell::text(in_full(&candidate.name, &candidate.joints)),
            Cell::number(crate::table::with_std(gain, std), gain),
            Cell::text(alike),
        ]
    };
    DataTable {
        columns: vec![
            column("effect", false),
            column("gain (%)", true),
            column("look-alikes on this log", false),
        ],
        rows: candidates.iter().map(row).collect(),
    }
}
