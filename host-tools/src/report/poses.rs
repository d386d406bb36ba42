//! Measured poses: error vectors on the robot's workspace, errors by pose and by joint, candidates, values.

use plotly::common::{Marker, Mode, Orientation};
use plotly::layout::BarMode;
use plotly::{Bar, Scatter};

use super::data_table::{Cell, Column, DataTable};
use super::figure::{Figure, axis, colour, layout, line, plotted};
use super::section::{Key, Mark, Section};
use super::{escape, thin};
use crate::kinematics::{Candidate, JointShare, PoseError, Value};

/// Error vectors drawn; the table has all.
const VECTORS: usize = 400;
/// The longest error vector, as a share of the space that the targets move in.
const LONGEST: f64 = 0.15;

fn mm(x: f64) -> Cell {
    Cell::number(format!("{x:.3}"), x)
}

/// Error vectors before and after at the places of the targets, from the side, from the front and from above.
pub fn vectors(errors: &[PoseError]) -> Section {
    let span = (0..3)
        .map(|k| {
            let (low, high) = errors.iter().fold((f64::MAX, f64::MIN), |(low, high), e| {
                (low.min(e.place[k]), high.max(e.place[k]))
            });
            high - low
        })
        .fold(0.0, f64::max);
    let longest = errors.iter().map(|e| e.before).fold(0.0, f64::max);
    // m on the page per mm of error.
    let scale = if longest > 0.0 {
        LONGEST * span.max(0.1) / longest
    } else {
        0.0
    };
    let views = [
        ("from the side", 0, 2),
        ("from the front", 1, 2),
        ("from above", 0, 1),
    ];
    let figures = views.map(|(name, a, b)| {
        let lines = |of: fn(&PoseError) -> [f64; 3]| {
            let shown = || thin::spread(errors.len(), VECTORS).map(|k| &errors[k]);
            let along = |k: usize| {
                shown().flat_map(move |e| [e.place[k], e.place[k] + scale * of(e)[k], f64::NAN])
            };
            (plotted(along(a)), plotted(along(b)))
        };
        let trace = |of: fn(&PoseError) -> [f64; 3], name: &str, colour: &'static str, width| {
            let (x, y) = lines(of);
            Scatter::new(x, y)
                .name(name)
                .mode(Mode::Lines)
                .line(line(colour, width))
        };
        const AXES: [&str; 3] = ["x (m)", "y (m)", "z (m)"];
        Figure {
            title: format!("Errors {name}"),
            traces: vec![
                trace(|e| e.before_vector, "before", colour::REMOVED, 1.5),
                trace(|e| e.after_vector, "after", colour::MODELS[0], 2.0),
            ],
            layout: layout(axis(AXES[a]), axis(AXES[b])),
            group: None,
            height: 320,
        }
    });
    Section {
        id: "vectors",
        title: "Error vectors",
        text: format!(
            "Held-out errors at the measured places, in the base's frame, {:.0} times their size. A pattern that is left after the calibration \
             is something that the model lacks; errors that point anywhere are measurement noise.",
            1e3 * scale
        ),
        legend: vec![
            Key::new("before", colour::REMOVED, Mark::Solid, Some(0)),
            Key::new("after", colour::MODELS[0], Mark::Solid, Some(1)),
        ],
        figures: if errors.is_empty() {
            Vec::new()
        } else {
            figures.into()
        },
        columns: 3,
        ..Section::default()
    }
}

/// Error of each pose before and after.
pub fn by_pose(errors: &[PoseError]) -> Section {
    let numbers = || (1..=errors.len()).map(|n| n as f64);
    let trace = |of: fn(&PoseError) -> f64, name: &str, colour: &'static str| {
        Scatter::new(plotted(numbers()), plotted(errors.iter().map(of)))
            .name(name)
            .mode(Mode::Markers)
            .marker(Marker::new().color(colour).size(6))
    };
    let figure = Figure {
        title: "Held-out error of each pose".to_owned(),
        traces: vec![
            trace(|e| e.before, "before", colour::REMOVED),
            trace(|e| e.after, "after", colour::MODELS[0]),
        ],
        layout: layout(axis("pose"), axis("error (mm)")),
        group: None,
        height: 240,
    };
    let row = |e: &PoseError| {
        vec![
            Cell::text(&e.pose),
            Cell::text(&e.target),
            mm(e.before),
            mm(e.after),
        ]
    };
    Section {
        id: "poses",
        title: "Error by pose",
        text: "The distance between measured and predicted place of a target, by a fit that has not used the pose.".to_owned(),
        legend: vec![
            Key::new("before", colour::REMOVED, Mark::Point, Some(0)),
            Key::new("after", colour::MODELS[0], Mark::Point, Some(1)),
        ],
        figures: vec![figure],
        table: Some(DataTable {
            columns: vec![
                Column::new("pose", false),
                Column::new("target", false),
                Column::new("before, mm", true),
                Column::new("after, mm", true),
            ],
            rows: errors.iter().map(row).collect(),
        }),
        columns: 1,
        ..Section::default()
    }
}

/// How much each joint's corrections move the targets.
pub fn by_joint(shares: &[JointShare]) -> Section {
    let names: Vec<String> = shares
        .iter()
        .rev()
        .map(|s| escape::plot(&s.joint).into_owned())
        .collect();
    let bar = Bar::new(plotted(shares.iter().rev().map(|s| s.moves)), names)
        .name("moves the targets by")
        .orientation(Orientation::Horizontal)
        .marker(Marker::new().color(colour::BAR));
    let figure = Figure {
        title: "What each joint's corrections move the targets by".to_owned(),
        traces: vec![bar],
        layout: layout(axis("rms over poses (mm)"), axis("")).bar_mode(BarMode::Stack),
        group: None,
        height: 80 + 24 * shares.len(),
    };
    Section {
        id: "joints",
        title: "Error by joint",
        text: "The targets' displacement if the joint's frame, zero and elasticity were the description's again. Corrections of several joints \
               may cancel: the sum need not be the error before."
            .to_owned(),
        figures: if shares.is_empty() { Vec::new() } else { vec![figure] },
        table: Some(DataTable {
            columns: vec![Column::new("joint", false), Column::new("moves by, mm", true)],
            rows: shares.iter().map(|s| vec![Cell::text(&s.joint), mm(s.moves)]).collect(),
        }),
        columns: 1,
        ..Section::default()
    }
}

/// All candidates.
pub fn candidates(candidates: &[Candidate]) -> Section {
    let row = |c: &Candidate| {
        let alike = c
            .alternatives
            .iter()
            .map(|a| format!("{} {}", a.effect, a.joints.join(", ")));
        vec![
            Cell::text(c.effect),
            Cell::text(c.joints.join(", ")),
            mm(c.held_out_gain),
            Cell::number(format!("{:.1}", c.z), c.z),
            Cell::text(if c.taken { "added" } else { "" }),
            Cell::text(alike.collect::<Vec<_>>().join("; ")),
        ]
    };
    Section {
        id: "candidates",
        title: "Candidates",
        text: "What was tried beyond joint frames: how much smaller the held-out error is with it, the gain in its standard errors over poses \
               (3 are needed), and what these poses cannot separate from it."
            .to_owned(),
        table: Some(DataTable {
            columns: vec![
                Column::new("effect", false),
                Column::new("joints", false),
                Column::new("gain, mm", true),
                Column::new("z", true),
                Column::new("in the model", false),
                Column::new("confounded with", false),
            ],
            rows: candidates.iter().map(row).collect(),
        }),
        columns: 1,
        ..Section::default()
    }
}

/// All values.
pub fn values(values: &[Value]) -> Section {
    let number = |x: f64| Cell::number(format!("{x:.3e}"), x);
    let row = |v: &Value| {
        vec![
            Cell::text(&v.name),
            number(v.value),
            number(v.std),
            number(v.prior_std),
            Cell::text(v.unit),
            Cell::text(v.status),
        ]
    };
    Section {
        id: "values",
        title: "Values",
        text: "Corrections of joint frames in the frames themselves, and effects, ± one standard deviation by the scatter over poses.".to_owned(),
        table: Some(DataTable {
            columns: vec![
                Column::new("value", false),
                Column::new("estimate", true),
                Column::new("±", true),
                Column::new("before the data ±", true),
                Column::new("unit", false),
                Column::new("status", false),
            ],
            rows: values.iter().map(row).collect(),
        }),
        columns: 1,
        ..Section::default()
    }
}
