//! Whether residuals know of their own past, or of the inputs.

use plotly::Scatter;
use plotly::common::{Line, Mode};
use plotly::layout::{Shape, ShapeLayer, ShapeLine, ShapeType};

use super::escape;
use super::figure::{Figure, axis, colour, layout, line, plotted};
use super::section::{Key, Mark, Section};
use super::thin;

/// Lags of a line.
const POINTS: usize = 1500;

/// A correlation function of a joint's residual.
#[derive(Debug, Clone)]
pub struct Correlation {
    /// Name of the joint.
    pub joint: String,
    /// Name of the input for a cross-correlation, such as `q̇`; none for the autocorrelation.
    pub input: Option<String>,
    /// Lag, s; positive: the input came first.
    pub lag: Vec<f64>,
    /// Correlation at each lag, between −1 and 1.
    pub value: Vec<f64>,
    /// Half width of the 99 % band around zero of what chance gives.
    pub band: f64,
}

/// A plot for each function.
pub fn section(correlations: &[Correlation]) -> Section {
    Section {
        id: "correlation",
        title: "Correlation of the residual with its past and with the inputs",
        text: "If a model explains all but noise, its residual at one time tells nothing about the residual a little later \
               (autocorrelation), nor does the motion tell anything about it (cross-correlation): the line then stays in \
               the grey band for 99 of 100 lags. A line that leaves the band says that something is missing, and at which \
               delay. The autocorrelation at lag zero is always 1."
            .to_owned(),
        legend: vec![
            Key {
                label: "correlation".to_owned(),
                colour: colour::BAR,
                mark: Mark::Solid,
                trace: None,
            },
            Key {
                label: "99 % of chance".to_owned(),
                colour: colour::LIMIT,
                mark: Mark::Area,
                trace: None,
            },
        ],
        figures: correlations.iter().map(figure).collect(),
        table: None,
        columns: 4,
    }
}

fn figure(correlation: &Correlation) -> Figure {
    let Correlation {
        joint,
        input,
        lag,
        value,
        band,
    } = correlation;
    let kept = thin::extremes(value, POINTS);
    let lags = plotted(kept.iter().filter_map(|&k| lag.get(k).copied()));
    let values = plotted(kept.iter().map(|&k| value[k]));
    let trace = Scatter::new(lags, values)
        .name("correlation")
        .mode(Mode::Lines)
        .line(Line::from(line(colour::BAR, 1.5)));
    let mut layout = layout(axis("lag (s)"), axis("correlation"));
    if band.is_finite() {
        let band = escape::rounded(band.abs(), 5);
        let area = Shape::new()
            .shape_type(ShapeType::Rect)
            .layer(ShapeLayer::Below)
            .x_ref("paper")
            .x0(0.0)
            .x1(1.0)
            .y_ref("y")
            .y0(-band)
            .y1(band)
            .fill_color(colour::LIMIT)
            .opacity(0.3)
            .line(ShapeLine::new().width(0.0));
        layout.add_shape(area);
    }
    Figure {
        title: match input {
            None => format!("{joint}, autocorrelation"),
            Some(input) => format!("{joint}, with {input}"),
        },
        traces: vec![trace],
        layout,
        group: None,
        height: 210,
    }
}
