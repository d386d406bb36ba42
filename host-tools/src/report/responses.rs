//! Frequency responses: magnitude and phase of each pair of joints, noise against distortion, values.

use plotly::Scatter;
use plotly::common::{Line, Marker, Mode};
use plotly::layout::AxisType;

use super::data_table::{Cell, Column, DataTable};
use super::figure::{Figure, axis, colour, layout, line, plotted};
use super::section::{Key, Mark, Section};
use crate::spectrum::{Curve, FrfValue};

/// Responses drawn at one point and more than this many joints squared would be too small to read.
const DRAWN: usize = 36;

/// The first point's curves: one of each pair of joints.
fn first_point(curves: &[Curve]) -> impl Iterator<Item = &Curve> {
    curves.iter().filter(|c| c.point == 1).take(DRAWN)
}

fn columns(curves: &[Curve]) -> usize {
    let pairs = first_point(curves).count();
    ((pairs as f64).sqrt() as usize).clamp(1, 6)
}

fn magnitude([re, im]: &[f64; 2]) -> f64 {
    re.hypot(*im)
}

fn degrees([re, im]: &[f64; 2]) -> f64 {
    im.atan2(*re).to_degrees()
}

/// Magnitude and phase by frequency, measured with a band of two standard deviations and modelled, at the first point.
pub fn bode(curves: &[Curve], unit: &str) -> Section {
    let points = curves.iter().map(|c| c.point).max().unwrap_or(0);
    let logarithmic = |title: &str| axis(title).type_(AxisType::Log);
    let mut figures = Vec::new();
    for curve in first_point(curves) {
        let f = || plotted(curve.f.iter().copied());
        let bound = |sign: f64| {
            let of =
                |(g, std): (&[f64; 2], &[f64; 2])| (magnitude(g) + sign * 2.0 * std[0]).max(1e-12);
            Scatter::new(
                f(),
                curve
                    .measured
                    .iter()
                    .zip(&curve.std)
                    .map(of)
                    .collect::<Vec<f64>>(),
            )
            .name("± 2σ")
            .mode(Mode::Lines)
            .line(Line::new().color(colour::BAND).width(1.0))
        };
        let measured = |of: fn(&[f64; 2]) -> f64| {
            Scatter::new(f(), curve.measured.iter().map(of).collect::<Vec<f64>>())
                .name("measured")
                .mode(Mode::Markers)
                .marker(Marker::new().color(colour::MEASURED).size(4))
        };
        let modelled = |of: fn(&[f64; 2]) -> f64| {
            Scatter::new(f(), curve.modelled.iter().map(of).collect::<Vec<f64>>())
                .name("model")
                .mode(Mode::Lines)
                .line(line(colour::MODELS[0], 2.0))
        };
        let pair = format!("{} by torque of {}", curve.output, curve.input);
        figures.push(Figure {
            title: format!("{pair}: magnitude"),
            traces: vec![
                measured(magnitude),
                modelled(magnitude),
                bound(1.0),
                bound(-1.0),
            ],
            layout: layout(
                logarithmic("f (Hz)"),
                logarithmic(if unit == "A" { "rad/A" } else { "rad/(N m)" }),
            ),
            group: Some("frequency"),
            height: 240,
        });
        figures.push(Figure {
            title: format!("{pair}: phase"),
            traces: vec![measured(degrees), modelled(degrees)],
            layout: layout(logarithmic("f (Hz)"), axis("degrees")),
            group: Some("frequency"),
            height: 160,
        });
    }
    Section {
        id: "bode",
        title: "Responses",
        text: format!(
            "Motor position by torque at the first of {points} points. A notch on the diagonal is an antiresonance: there the link swings while its \
             motor hardly moves. Where model and measurement part beyond the band, the model lacks something."
        ),
        legend: vec![
            Key::new("measured", colour::MEASURED, Mark::Point, Some(0)),
            Key::new("model", colour::MODELS[0], Mark::Solid, Some(1)),
            Key::new("± 2σ", colour::BAND, Mark::Solid, Some(2)),
        ],
        figures,
        columns: 2 * columns(curves),
        ..Section::default()
    }
}

/// Standard deviation by blocks against that by periods, as shares of the response.
pub fn scatter(curves: &[Curve]) -> Section {
    let mut figures = Vec::new();
    for curve in first_point(curves).filter(|c| c.output == c.input) {
        let share = |k: usize| {
            let of = |(g, std): (&[f64; 2], &[f64; 2])| 100.0 * std[k] / magnitude(g).max(1e-300);
            curve
                .measured
                .iter()
                .zip(&curve.std)
                .map(of)
                .collect::<Vec<f64>>()
        };
        let trace = |k: usize, name: &str, colour: &'static str| {
            Scatter::new(plotted(curve.f.iter().copied()), share(k))
                .name(name)
                .mode(Mode::Lines)
                .line(line(colour, 1.5))
        };
        figures.push(Figure {
            title: curve.output.clone(),
            traces: vec![
                trace(0, "noise and distortion", colour::MODELS[0]),
                trace(1, "noise", colour::MEASURED),
            ],
            layout: layout(
                axis("f (Hz)"),
                axis("% of the response").type_(AxisType::Log),
            ),
            group: Some("frequency"),
            height: 200,
        });
    }
    Section {
        id: "scatter",
        title: "Noise and distortion",
        text: "Scatter over periods is noise: more periods make it smaller. Scatter over blocks of other phases is noise and nonlinear distortion: \
               friction and backlash. With one block both are the same."
            .to_owned(),
        legend: vec![
            Key::new("noise and distortion", colour::MODELS[0], Mark::Solid, Some(0)),
            Key::new("noise", colour::MEASURED, Mark::Solid, Some(1)),
        ],
        figures,
        columns: 3,
        ..Section::default()
    }
}

/// All values.
pub fn values(values: &[FrfValue]) -> Section {
    let number = |x: f64| Cell::number(format!("{x:.3e}"), x);
    let row = |v: &FrfValue| {
        vec![
            Cell::text(&v.name),
            number(v.value),
            number(v.std),
            Cell::text(&v.unit),
            Cell::text(v.status),
        ]
    };
    let column = Column::new;
    Section {
        id: "values",
        title: "Values",
        text: "Estimates ± one standard deviation, by the scatter over blocks and points (of one block: over stretches of lines) and by what the model's \
               masses leave open."
            .to_owned(),
        table: Some(DataTable {
            columns: vec![
                column("value", false),
                column("estimate", true),
                column("±", true),
                column("unit", false),
                column("status", false),
            ],
            rows: values.iter().map(row).collect(),
        }),
        columns: 1,
        ..Section::default()
    }
}
