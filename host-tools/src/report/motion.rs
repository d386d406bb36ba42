//! A designed motion: what each joint does and how the search went; and the feedback that models leave.

use plotly::Scatter;
use plotly::common::Mode;

use super::figure::{Figure, axis, colour, dash, layout, line, plotted};
use super::section::{Key, Mark, Section};
use super::{escape, thin};
use crate::validate::Feedback;

/// Points of a line.
const POINTS: usize = 6000;

/// One quantity of one joint over time, with its limits.
#[derive(Debug, Clone)]
pub struct JointCurve {
    /// Name of the joint.
    pub joint: String,
    /// Time, s.
    pub t: Vec<f64>,
    /// Values.
    pub values: Vec<f64>,
    /// Least and greatest value allowed; not finite where there is none.
    pub limits: [f64; 2],
}

/// What a set of curves shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// rad.
    Position,
    /// rad/s.
    Velocity,
    /// rad/s².
    Acceleration,
    /// N m.
    Torque,
}

impl Quantity {
    fn words(self) -> (&'static str, &'static str, &'static str, &'static str) {
        match self {
            Self::Position => (
                "position",
                "Position",
                "q (rad)",
                "Each joint's reference. It begins and ends at rest in one pose.",
            ),
            Self::Velocity => ("velocity", "Velocity", "dq (rad/s)", "Its rate."),
            Self::Acceleration => (
                "acceleration",
                "Acceleration",
                "ddq (rad/s²)",
                "The rate of the velocity: a series of waves, integrated twice to the position.",
            ),
            Self::Torque => (
                "torque",
                "Feed-forward torque",
                "τ (N m)",
                "What the model foresees for this motion, with friction. The limits hold for parameters off by the stated uncertainty.",
            ),
        }
    }
}

/// A plot for each joint.
pub fn section(quantity: Quantity, curves: &[JointCurve]) -> Section {
    let (id, title, y, text) = quantity.words();
    let figure = |curve: &JointCurve| {
        let reference = Scatter::new(
            plotted(curve.t.iter().copied()),
            plotted(curve.values.iter().copied()),
        )
        .name("reference")
        .mode(Mode::Lines)
        .line(line(colour::MODELS[0], 1.5));
        let ends = [curve.t.first(), curve.t.last()].map(|t| t.copied().unwrap_or(0.0));
        let mut traces: Vec<Box<dyn plotly::Trace>> = vec![reference];
        for limit in curve.limits.iter().filter(|limit| limit.is_finite()) {
            traces.push(
                Scatter::new(ends.to_vec(), plotted([*limit; 2]))
                    .name("limit")
                    .mode(Mode::Lines)
                    .line(line(colour::LIMIT, 1.0)),
            );
        }
        Figure {
            title: curve.joint.clone(),
            traces,
            layout: layout(axis("t (s)"), axis(y)),
            group: Some("motion"),
            height: 200,
        }
    };
    let key = |label: &str, colour| Key {
        label: label.to_owned(),
        colour,
        mark: Mark::Solid,
        trace: None,
    };
    Section {
        id,
        title,
        text: text.to_owned(),
        legend: vec![
            key("reference", colour::MODELS[0]),
            key("limit", colour::LIMIT),
        ],
        figures: curves.iter().map(figure).collect(),
        table: None,
        columns: 3,
        ..Section::default()
    }
}

/// The best cost over the time of a limb's search.
pub fn search(curves: &[(String, Vec<[f64; 2]>)]) -> Section {
    let figure = |(limb, points): &(String, Vec<[f64; 2]>)| Figure {
        title: limb.clone(),
        traces: vec![
            Scatter::new(
                plotted(points.iter().map(|p| p[0])),
                plotted(points.iter().map(|p| p[1])),
            )
            .name("best cost")
            .mode(Mode::LinesMarkers)
            .line(line(colour::MODELS[0], 1.5)),
        ],
        layout: layout(axis("time of the search (s)"), axis("cost")),
        group: None,
        height: 200,
    };
    Section {
        id: "search",
        title: "The search",
        text: "The cost of the best motion within the limits that was known at a time; of the condition number its logarithm.".to_owned(),
        legend: Vec::new(),
        figures: curves.iter().map(figure).collect(),
        table: None,
        columns: 3,
        ..Section::default()
    }
}

/// Feedback torque over time, model beside model, a plot for each joint.
pub fn feedback(models: &[&Feedback]) -> Section {
    let joints = models.first().map_or(0, |model| model.joints.len());
    let figure = |j: usize| {
        let trace = |(n, model): (usize, &&Feedback)| {
            let values: Vec<f64> = model.series[j].iter().map(|point| point[1]).collect();
            let kept = thin::extremes(&values, POINTS);
            let t = plotted(kept.iter().map(|&k| model.series[j][k][0]));
            Scatter::new(t, plotted(kept.iter().map(|&k| values[k])))
                .name(escape::plot(&model.model))
                .mode(Mode::Lines)
                .line(line(colour::MODELS[n % colour::MODELS.len()], 1.0).dash(dash(n)))
                as Box<dyn plotly::Trace>
        };
        Figure {
            title: models[0].joints[j].joint.clone(),
            traces: models.iter().enumerate().map(trace).collect(),
            layout: layout(axis("t (s)"), axis("feedback (N m)")),
            group: Some("feedback"),
            height: 220,
        }
    };
    let key = |(n, model): (usize, &&Feedback)| Key {
        label: model.model.clone(),
        colour: colour::MODELS[n % colour::MODELS.len()],
        mark: [Mark::Solid, Mark::Dashed, Mark::Dotted][n % 3],
        trace: Some(n),
    };
    Section {
        id: "feedback",
        title: "Feedback torque",
        text: "The feedback torque with each model's feed-forward: smaller is better.".to_owned(),
        legend: models.iter().enumerate().map(key).collect(),
        figures: (0..joints).map(figure).collect(),
        table: None,
        columns: 3,
        ..Section::default()
    }
}
