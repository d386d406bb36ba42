//! Frequency responses: magnitude and phase of each pair of joints, noise against distortion, values.

use plotly::Scatter;
use plotly::common::{ExponentFormat, Line, Marker, Mode};
use plotly::layout::AxisType;

use super::data_table::{Cell, Column, DataTable};
use super::figure::{Figure, axis, colour, layout, line, plotted};
use super::section::{Key, Mark, Section};
use crate::spectrum::{Curve, FrfValue};

/// Responses drawn at one point and more than this many joints squared would be too small to read.
const DRAWN: usize = 36;

/// Room above and below a magnitude, decades.
const ROOM: f64 = 0.2;

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

/// Phases without jumps, degrees: from line to line by the shorter way, the first of them between -270 and 90, for a mass alone is at -180.
fn unwrapped(responses: &[[f64; 2]]) -> Vec<f64> {
    let mut last = -90.0;
    let phase = |[re, im]: &[f64; 2]| {
        last = near(im.atan2(*re).to_degrees(), last);
        last
    };
    responses.iter().map(phase).collect()
}

/// An angle, degrees, by whole turns as near as can be to another.
fn near(angle: f64, other: f64) -> f64 {
    angle - 360.0 * ((angle - other) / 360.0).round()
}

/// The least range of whole quarters of a turn that has all of these angles, degrees.
fn quarters(angles: &[f64]) -> Vec<f64> {
    let low = angles.iter().copied().fold(f64::MAX, f64::min);
    let high = angles.iter().copied().fold(f64::MIN, f64::max);
    let low = 90.0 * (low / 90.0).floor();
    vec![low, (90.0 * (high / 90.0).ceil()).max(low + 90.0)]
}

/// Frequencies that are named on a logarithmic axis, Hz: 1, 2 and 5 of each decade.
fn named_frequencies() -> Vec<f64> {
    let decades = [0.1, 1.0, 10.0, 100.0, 1000.0];
    decades
        .iter()
        .flat_map(|decade| [1.0, 2.0, 5.0].map(|times| times * decade))
        .collect()
}

/// Magnitude and phase by frequency, measured with a band of two standard deviations and modelled, at the first point.
pub fn bode(curves: &[Curve], unit: &str) -> Section {
    let points = curves.iter().map(|c| c.point).max().unwrap_or(0);
    let frequency = || {
        axis("f (Hz)")
            .type_(AxisType::Log)
            .tick_values(named_frequencies())
    };
    let mut figures = Vec::new();
    for curve in first_point(curves) {
        let f = || plotted(curve.f.iter().copied());
        let bound = |sign: f64| {
            // A band that reaches 0 has no lower end on a logarithmic axis.
            let of = |(g, std): (&[f64; 2], &[f64; 2])| {
                let end = magnitude(g) + sign * 2.0 * std[0];
                if end > 0.0 { end } else { f64::NAN }
            };
            Scatter::new(f(), plotted(curve.measured.iter().zip(&curve.std).map(of)))
                .name("± 2σ")
                .mode(Mode::Lines)
                .line(Line::new().color(colour::BAND).width(1.0))
        };
        let measured = |values: Vec<f64>| {
            Scatter::new(f(), plotted(values))
                .name("measured")
                .mode(Mode::Markers)
                .marker(Marker::new().color(colour::MEASURED).size(4))
        };
        let modelled = |values: Vec<f64>| {
            Scatter::new(f(), plotted(values))
                .name("model")
                .mode(Mode::Lines)
                .line(line(colour::MODELS[0], 2.0))
        };
        let magnitudes = |of: &[[f64; 2]]| of.iter().map(magnitude).collect::<Vec<f64>>();
        let shown = || {
            magnitudes(&curve.measured)
                .into_iter()
                .chain(magnitudes(&curve.modelled))
        };
        let shown = || shown().filter(|value| *value > 0.0);
        let ends = [
            shown().fold(f64::MAX, f64::min),
            shown().fold(f64::MIN_POSITIVE, f64::max),
        ];
        let phase = unwrapped(&curve.modelled);
        // Measured noise would lead the way astray: each stands where it is nearest to the model.
        let around = curve.measured.iter().zip(&phase);
        let around: Vec<f64> = around
            .map(|([re, im], phase)| near(im.atan2(*re).to_degrees(), *phase))
            .collect();
        let turned: Vec<f64> = phase.iter().chain(&around).copied().collect();
        let pair = format!("{} by torque of {}", curve.output, curve.input);
        figures.push(Figure {
            title: format!("{pair}: magnitude"),
            traces: vec![
                measured(magnitudes(&curve.measured)),
                modelled(magnitudes(&curve.modelled)),
                bound(1.0),
                bound(-1.0),
            ],
            layout: layout(
                frequency(),
                axis(if unit == "A" { "rad/A" } else { "rad/(N m)" })
                    .type_(AxisType::Log)
                    .range(vec![ends[0].log10() - ROOM, ends[1].log10() + ROOM])
                    .exponent_format(ExponentFormat::Power)
                    .dtick(1.0),
            ),
            group: Some("frequency"),
            height: 200,
        });
        figures.push(Figure {
            title: format!("{pair}: phase"),
            traces: vec![measured(around), modelled(phase)],
            layout: layout(
                frequency(),
                axis("degrees").range(quarters(&turned)).dtick(90.0),
            ),
            group: Some("frequency"),
            height: 200,
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A delay turns on and on; a mass begins at -180, also where noise has it at +179.
    #[test]
    fn phases_have_no_jumps() {
        let at = |degrees: f64| [degrees.to_radians().cos(), degrees.to_radians().sin()];
        let phases = unwrapped(&[179.0, -170.0, 100.0, 20.0, -60.0, -140.0].map(at));
        let expected = [-181.0, -170.0, -260.0, -340.0, -420.0, -500.0];
        for (phase, expected) in phases.iter().zip(expected) {
            assert!((phase - expected).abs() < 1e-9, "{phases:?}");
        }
        assert_eq!(quarters(&[-200.0, -179.0]), [-270.0, -90.0]);
        assert_eq!(quarters(&[-180.0]), [-180.0, -90.0]);
        assert!((near(175.0, -200.0) + 185.0).abs() < 1e-9);
    }
}
