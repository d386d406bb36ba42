//! How the error falls as effects are added.

use plotly::Bar;
use plotly::common::{DashType, Marker, Orientation};
use plotly::layout::{Axis, BarMode, RangeMode, Shape, ShapeLine, ShapeType};

use super::data_table::{Cell, Column, DataTable};
use super::escape;
use super::figure::{Figure, axis, colour, layout, plotted};
use super::section::{Key, Mark, Section};

/// Letters of a line of a label.
const LABEL: usize = 18;

/// A model on the way, and its error.
#[derive(Debug, Clone)]
pub struct Step {
    /// What was added, such as `+ coulomb, all calves`; for the first, the model one starts from.
    pub label: String,
    /// Names of the joints where the label only counts them.
    pub joints: Vec<String>,
    /// Root mean square of the error after it, N m.
    pub rms: f64,
}

/// Bars for the `steps` in order; `noise_floor` is the rms, N m, that no model can go below.
pub fn section(steps: &[Step], noise_floor: Option<f64>) -> Section {
    // An error that is below its noise by chance is at it.
    let least = steps
        .iter()
        .map(|step| step.rms)
        .fold(f64::INFINITY, f64::min);
    let floor = noise_floor.map(|floor| floor.min(least));
    let floor = floor.filter(|floor| floor.is_finite());
    let key = |label: &str, colour, mark| Key {
        label: label.to_owned(),
        colour,
        mark,
        trace: None,
    };
    let mut legend = vec![
        key("held-out error", colour::BAR, Mark::Area),
        key("explained by this step", colour::REMOVED, Mark::Area),
    ];
    legend.extend(floor.map(|_| key("noise floor", colour::LIMIT, Mark::Dashed)));
    let figures = if steps.is_empty() {
        Vec::new()
    } else {
        vec![figure(steps, floor)]
    };
    Section {
        id: "waterfall",
        title: "Error after each added effect",
        text: "From top to bottom, effects are added to the model one after the other, the most useful first. The dark bar is \
               the held-out error (root mean square), the pale part what the step \
               explained. No model can go below the noise floor; when the bars reach it, nothing is missing. The non-parametric bound is no model, \
               but shows what one could still explain."
            .to_owned(),
        legend,
        figures,
        table: (!steps.is_empty()).then(|| table(steps)),
        columns: 1,
        ..Section::default()
    }
}

fn figure(steps: &[Step], floor: Option<f64>) -> Figure {
    let rows = row_positions(steps.len());
    let left = plotted(steps.iter().map(|step| step.rms));
    let removed = plotted(steps.iter().enumerate().map(|(n, step)| {
        let before = n.checked_sub(1).map_or(step.rms, |n| steps[n].rms);
        (before - step.rms).max(0.0)
    }));
    let bar = |values: Vec<f64>, name: &str, colour: &'static str| {
        Bar::new(values, rows.clone())
            .name(name)
            .orientation(Orientation::Horizontal)
            .marker(Marker::new().color(colour))
            .hover_template("%{x:.4f} N m")
    };
    let x = axis("torque error, rms (N m)").range_mode(RangeMode::ToZero);
    let y = label_axis(&rows, steps.iter().map(|step| step.label.as_str()));
    let mut layout = layout(x, y).bar_mode(BarMode::Stack);
    if let Some(floor) = floor {
        layout.add_shape(
            Shape::new()
                .shape_type(ShapeType::Line)
                .y_ref("paper")
                .y0(0.0)
                .y1(1.0)
                .x_ref("x")
                .x0(floor)
                .x1(floor)
                .line(
                    ShapeLine::new()
                        .color(colour::LIMIT)
                        .width(2.0)
                        .dash(DashType::Dash),
                ),
        );
    }
    Figure {
        title: String::new(),
        traces: vec![
            bar(left, "held-out error", colour::BAR),
            bar(removed, "explained", colour::REMOVED),
        ],
        layout,
        group: None,
        height: height_of_bars(steps.len()),
    }
}

fn table(steps: &[Step]) -> DataTable {
    let column = Column::new;
    let row = |(n, step): (usize, &Step)| {
        vec![
            Cell::number(n.to_string(), n as f64),
            Cell::text(in_full(&step.label, &step.joints)),
            Cell::number(format!("{:.4}", step.rms), step.rms),
        ]
    };
    DataTable {
        columns: vec![
            column("step", true),
            column("added", false),
            column("rms (N m)", true),
        ],
        rows: steps.iter().enumerate().map(row).collect(),
    }
}

/// A label with the names of the joints that it only counts.
pub(super) fn in_full(label: &str, joints: &[String]) -> String {
    match joints {
        [] => label.to_owned(),
        joints => format!("{label}: {}", joints.join(", ")),
    }
}

/// Where `count` bars stand, the first on top.
pub(super) fn row_positions(count: usize) -> Vec<f64> {
    (0..count).rev().map(|row| row as f64).collect()
}

/// Height of a plot with `count` horizontal bars, px.
pub(super) fn height_of_bars(count: usize) -> usize {
    64 + 34 * count
}

/// A label in lines of at most [`LABEL`] letters, but for longer words: a chart on a phone is no wider than two labels.
fn broken(label: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    for word in label.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + word.chars().count() < LABEL => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.join("<br>")
}

/// A vertical axis with a label at each row. Rows are numbers: two bars of one name must stay two.
pub(super) fn label_axis<'a>(rows: &[f64], labels: impl Iterator<Item = &'a str>) -> Axis {
    Axis::new()
        .tick_values(rows.to_vec())
        .tick_text(labels.map(|label| broken(&escape::plot(label))).collect())
        .auto_margin(true)
        .show_grid(false)
        .zero_line(false)
        .fixed_range(true)
}
