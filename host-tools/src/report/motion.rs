//! A designed motion: what each joint does, a moving figure of the limbs, how the search went.

use std::fmt::Write;

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
    }
}

/// A limb's joints and foot as points of the base's frame, m, frame by frame.
#[derive(Debug, Clone)]
pub struct Skeleton {
    /// The limb's name.
    pub limb: String,
    /// `frames[k][n]`: point n at frame k.
    pub frames: Vec<Vec<[f64; 3]>>,
}

/// Frames a second of the moving figure.
pub const FRAMES: f64 = 30.0;

/// The limbs as they move, from the side and from the front.
pub fn figure_of(skeletons: &[Skeleton]) -> Section {
    let points = || skeletons.iter().flat_map(|s| s.frames.iter().flatten());
    let span = |n: usize| {
        let (low, high) = points().fold((0.0f64, 0.0f64), |(low, high), p| {
            (low.min(p[n]), high.max(p[n]))
        });
        (low - 0.05, high + 0.05)
    };
    let spans = [span(0), span(1), span(2)];
    let mut text = "The limbs as the motion moves them, from the side and from the front, over one period in true time; the cross is the base. ".to_owned();
    let _ = write!(
        text,
        "<button type=\"button\" id=\"play\">Pause</button><br>"
    );
    for (name, across) in [("side", 0), ("front", 1)] {
        let ((left, right), (low, high)) = (spans[across], spans[2]);
        let _ = write!(
            text,
            "<svg class=\"stick\" data-across=\"{across}\" role=\"img\" aria-label=\"the limbs from the {name}\" \
             viewBox=\"{left:.3} {:.3} {:.3} {:.3}\" style=\"width:min(48%,26rem);height:22rem\">\
             <path d=\"M-.03 0H.03M0-.03V.03\" stroke=\"currentColor\" stroke-width=\".006\"/>",
            -high,
            right - left,
            high - low,
        );
        for skeleton in skeletons {
            let _ = write!(
                text,
                "<polyline fill=\"none\" stroke=\"var(--model-1)\" stroke-width=\".012\" stroke-linejoin=\"round\" \
                 stroke-linecap=\"round\"><title>{}</title></polyline>",
                escape::html(&skeleton.limb)
            );
        }
        text.push_str("</svg>");
    }
    let frames: Vec<String> = skeletons.iter().map(frames_of).collect();
    let _ = write!(
        text,
        "<script>{}</script>",
        SCRIPT.replace("@frames", &format!("[{}]", frames.join(",")))
    );
    Section {
        id: "figure",
        title: "The motion",
        text,
        legend: Vec::new(),
        figures: Vec::new(),
        table: None,
        columns: 1,
    }
}

/// Numbers alone, in millimetres' digits: nothing from outside gets into the script.
fn frames_of(skeleton: &Skeleton) -> String {
    let point = |p: &[f64; 3]| format!("[{:.3},{:.3},{:.3}]", p[0], p[1], p[2]);
    let frame = |points: &Vec<[f64; 3]>| {
        let points: Vec<String> = points.iter().map(point).collect();
        format!("[{}]", points.join(","))
    };
    let frames: Vec<String> = skeleton.frames.iter().map(frame).collect();
    format!("[{}]", frames.join(","))
}

/// Draws the frame of the moment into every figure; stands still where the reader asks for little motion.
const SCRIPT: &str = "(()=>{const limbs=@frames,rate=30;const button=document.getElementById('play');\
let moving=!matchMedia('(prefers-reduced-motion: reduce)').matches,begun=performance.now(),stood=0;\
const draw=(k)=>{for(const svg of document.querySelectorAll('svg.stick')){const across=+svg.dataset.across;\
svg.querySelectorAll('polyline').forEach((line,n)=>{const points=limbs[n][k%limbs[n].length];\
line.setAttribute('points',points.map((p)=>`${p[across]},${-p[2]}`).join(' '));});}};\
const step=(now)=>{if(!moving)return;draw(Math.floor((now-begun)/1000*rate));requestAnimationFrame(step);};\
const label=()=>{button.textContent=moving?'Pause':'Play';};\
button.onclick=()=>{moving=!moving;label();if(moving){begun=performance.now()-stood;requestAnimationFrame(step);}\
else{stood=performance.now()-begun;}};draw(0);label();if(moving)requestAnimationFrame(step);})();";

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
    }
}

/// Feedback torque over time, model beside model, a plot for each joint.
pub fn feedback(models: &[Feedback]) -> Section {
    let joints = models.first().map_or(0, |model| model.joints.len());
    let figure = |j: usize| {
        let trace = |(n, model): (usize, &Feedback)| {
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
    let key = |(n, model): (usize, &Feedback)| Key {
        label: model.model.clone(),
        colour: colour::MODELS[n % colour::MODELS.len()],
        mark: [Mark::Solid, Mark::Dashed, Mark::Dotted][n % 3],
        trace: Some(n),
    };
    Section {
        id: "feedback",
        title: "Feedback torque",
        text: "The torque that is left for feedback when a model feeds forward: the smaller, the better the model.".to_owned(),
        legend: models.iter().enumerate().map(key).collect(),
        figures: (0..joints).map(figure).collect(),
        table: None,
        columns: 3,
    }
}
