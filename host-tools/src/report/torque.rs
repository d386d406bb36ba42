//! Measured and predicted torque against time.

use plotly::Scatter;
use plotly::common::Mode;

use super::figure::{Figure, axis, colour, dash, layout, line, plotted};
use super::section::{Key, Mark, Section};
use super::{escape, thin};

/// Points of a line: several for every pixel of a wide screen, so that there is something to zoom into.
const POINTS: usize = 6000;

/// A joint's torque over time. The vectors have one length; what is not finite leaves a hole in the line.
#[derive(Debug, Clone)]
pub struct TorqueSeries {
    /// Name of the joint.
    pub joint: String,
    /// Time, s.
    pub t: Vec<f64>,
    /// Measured torque, N m.
    pub measured: Vec<f64>,
    /// What models say, N m, by the models' names; the same models in the same order for every joint, the later drawn over
    /// the earlier.
    pub predicted: Vec<(String, Vec<f64>)>,
}

/// A plot for each joint; zooming one zooms all.
pub fn section(series: &[TorqueSeries]) -> Section {
    Section {
        id: "torque",
        title: "Torque against time",
        text: "Each plot is a joint: its measured torque and what each model predicts for the same motion. Where the lines \
               part, the model lacks something. Drag over a stretch of time to zoom into it in every plot; double-click \
               to see all of it again. Long logs are thinned so that every peak stays."
            .to_owned(),
        legend: series.first().map_or_else(Vec::new, legend),
        figures: series.iter().map(figure).collect(),
        table: None,
        columns: 3,
    }
}

fn legend(series: &TorqueSeries) -> Vec<Key> {
    let models = series
        .predicted
        .iter()
        .enumerate()
        .map(|(n, (model, _))| Key {
            label: model.clone(),
            colour: model_colour(n),
            mark: [Mark::Solid, Mark::Dashed, Mark::Dotted][n % 3],
            trace: Some(n + 1),
        });
    let measured = Key {
        label: "measured".to_owned(),
        colour: colour::MEASURED,
        mark: Mark::Solid,
        trace: Some(0),
    };
    std::iter::once(measured).chain(models).collect()
}

fn figure(series: &TorqueSeries) -> Figure {
    let trace = |name: &str, values: &[f64]| {
        let kept = thin::extremes(values, POINTS);
        // A sampling time needs more digits than a pixel: 0.1 ms.
        let t = kept.iter().filter_map(|&k| series.t.get(k));
        let t = t.map(|t| (t * 1e4).round() / 1e4).collect();
        Scatter::new(t, plotted(kept.iter().map(|&k| values[k])))
            .name(escape::plot(name))
            .mode(Mode::Lines)
    };
    let measured = trace("measured", &series.measured).line(line(colour::MEASURED, 2.5));
    let models = series
        .predicted
        .iter()
        .enumerate()
        .map(|(n, (model, values))| {
            trace(model, values).line(line(model_colour(n), 1.25).dash(dash(n))) as _
        });
    Figure {
        title: series.joint.clone(),
        traces: std::iter::once(measured as _).chain(models).collect(),
        layout: layout(axis("time (s)"), axis("torque (N m)")),
        group: Some("time"),
        height: 240,
    }
}

fn model_colour(index: usize) -> &'static str {
    colour::MODELS[index % colour::MODELS.len()]
}
