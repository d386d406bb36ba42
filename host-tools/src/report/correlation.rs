//! Whether residuals know of their own past, or of the inputs.

use plotly::Scatter;
use plotly::common::Mode;
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

/// A plot for each function of the residual that the model of the name `model` leaves.
pub fn section(correlations: &[Correlation], model: &str) -> Section {
    Section {
        id: "correlation",
        title: "Correlation of the residual with its past and with the inputs",
        text: format!(
            "These are residuals of the model “{}”. If a model explains all but noise, its residual at one time does not predict the residual a little later \
               (autocorrelation), nor does the motion predict it (cross-correlation): the line then stays in \
               the grey band for 99 of 100 lags. A line that leaves the band shows that something is missing, and at which \
               delay. Lag zero, where every autocorrelation is 1, is not drawn.",
            escape::html(model),
        ),
        legend: vec![
            Key {
                label: "correlation".to_owned(),
                colour: colour::MODELS[0],
                mark: Mark::Solid,
                trace: None,
            },
            Key {
                label: "99 % of chance".to_owned(),
                colour: colour::BAND,
                mark: Mark::Area,
                trace: None,
            },
        ],
        figures: correlations.iter().map(figure).collect(),
        table: None,
        columns: 4,
        ..Section::default()
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
    let drawn = |&(lag, _): &(f64, f64)| input.is_some() || lag != 0.0;
    let points: Vec<(f64, f64)> = lag
        .iter()
        .copied()
        .zip(value.iter().copied())
        .filter(drawn)
        .collect();
    let (lags, values): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    let kept = thin::extremes(&values, POINTS);
    let at = |of: &[f64]| plotted(kept.iter().map(|&k| of[k]));
    let trace = Scatter::new(at(&lags), at(&values))
        .name("correlation")
        .mode(Mode::Lines)
        .line(line(colour::MODELS[0], 1.5));
    // The band must be seen as a band, however flat the line.
    let greatest = values
        .iter()
        .map(|v| v.abs())
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    let reach = escape::rounded((2.5 * band).max(1.15 * greatest), 3);
    let mut y = axis("correlation");
    if reach > 0.0 && reach.is_finite() {
        y = y.range(vec![-reach, reach]);
    }
    let mut layout = layout(axis("lag (s)"), y);
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
            .fill_color(colour::BAND)
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
