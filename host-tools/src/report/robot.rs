//! The robot as lines, from its URDF: each link with its joint's name and in the colour of its error, and where the front is.

use std::fmt::Write;

use nalgebra::{Rotation3, Unit, Vector3};
use proprio_core::spatial::Transform;

use super::escape;
use crate::model::{JointKind, Model};

/// Where the eye is: turned about the vertical from the robot's left, and above the ground, rad.
const EYE: [f64; 2] = [0.6, 0.35];
/// Width of the drawing in its own units.
const WIDTH: f64 = 400.0;
/// Room around the robot, in the same.
const MARGIN: f64 = 24.0;

/// Width of a letter of a name and height of a line, in the same.
const LETTER: f64 = 7.2;
const LINE: f64 = 14.0;
/// Length of the arrow ahead, as a share of the distance to the farthest point.
const ARROW: f64 = 0.3;

/// A joint of the drawing: where it is, its torque error, N m.
pub(super) struct DrawnJoint {
    pub(super) name: String,
    /// Position, rad or m.
    pub(super) q: f64,
    /// Root mean square of the error, N m.
    pub(super) rms: f64,
}

/// The robot at the joints' positions. What is not recorded is grey, and at zero.
pub(super) fn drawing(model: &Model, joints: &[DrawnJoint]) -> String {
    let bodies = model.robot().bodies();
    let mut frames: Vec<Transform<f64>> = Vec::new();
    let mut links: Vec<(usize, [Vector3<f64>; 2])> = Vec::new();
    for (b, body) in bodies.iter().enumerate() {
        let placement = model.placement(b);
        let parent = body.parent.map_or_else(Transform::identity, |p| frames[p]);
        let q = joints
            .iter()
            .find(|j| j.name == body.name)
            .map_or(0.0, |j| j.q);
        let mut frame = Transform {
            rotation: parent.rotation * placement.rotation,
            translation: parent.translation + parent.rotation * placement.translation,
        };
        match body.kind {
            JointKind::Prismatic => frame.translation += frame.rotation * body.axis * q,
            _ => {
                frame.rotation *=
                    Rotation3::from_axis_angle(&Unit::new_normalize(body.axis), q).matrix()
            }
        }
        frames.push(frame);
    }
    for (b, body) in bodies.iter().enumerate() {
        let at = |x: Vector3<f64>| frames[b].translation + frames[b].rotation * x;
        let children = bodies
            .iter()
            .enumerate()
            .filter(|(_, child)| child.parent == Some(b));
        let mut ends: Vec<Vector3<f64>> = children.map(|(c, _)| frames[c].translation).collect();
        if ends.is_empty() {
            // A last link is about twice as long as its centre of mass is far.
            let mass = body.inertia.0[0];
            let com = Vector3::new(body.inertia.0[1], body.inertia.0[2], body.inertia.0[3])
                / mass.max(1e-9);
            ends.push(at(body.foot.unwrap_or(2.0 * com)));
        }
        links.extend(
            ends.into_iter()
                .map(|end| (b, [frames[b].translation, end])),
        );
    }
    let roots: Vec<Vector3<f64>> = (bodies.iter().zip(&frames))
        .filter(|(body, _)| body.parent.is_none())
        .map(|(_, frame)| frame.translation)
        .collect();
    svg(model, joints, &links, &roots)
}

/// Right and down on the screen, and away from the eye.
fn seen(x: &Vector3<f64>) -> [f64; 3] {
    let [turn, above] = EYE;
    let right = x.x * turn.cos() - x.y * turn.sin();
    let away = x.x * turn.sin() + x.y * turn.cos();
    [right, -(x.z * above.cos() + away * above.sin()), away]
}

fn svg(
    model: &Model,
    joints: &[DrawnJoint],
    links: &[(usize, [Vector3<f64>; 2])],
    roots: &[Vector3<f64>],
) -> String {
    let ahead = arrow(links, roots);
    let points: Vec<[f64; 3]> = (links.iter().flat_map(|(_, ends)| ends))
        .chain(roots)
        .chain(&ahead)
        .map(seen)
        .collect();
    let range = |n: usize| {
        points
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p[n]), b.max(p[n])))
    };
    let ([left, right], [top, bottom]) = ([range(0).0, range(0).1], [range(1).0, range(1).1]);
    let scale = (WIDTH - 2.0 * MARGIN) / (right - left).max(bottom - top).max(1e-9);
    // A robot that is narrow stands in the middle: its names have room on both sides.
    let aside = 0.5 * (WIDTH - scale * (right - left));
    let place = |x: &Vector3<f64>| {
        let [x, y, _] = seen(x);
        [aside + scale * (x - left), MARGIN + scale * (y - top)]
    };
    let height = 2.0 * MARGIN + scale * (bottom - top);
    let mut text = format!(
        "<figure class=\"robot\"><svg id=\"robot\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {WIDTH:.0} {height:.0}\">\n",
        escape::html(&in_words(joints))
    );
    let base: Vec<String> = around(roots)
        .iter()
        .map(|x| place(x).map(|x| format!("{x:.1}")).join(","))
        .collect();
    let _ = writeln!(
        text,
        "<polygon class=\"base\" points=\"{}\"/>",
        base.join(" ")
    );
    let mut order: Vec<&(usize, [Vector3<f64>; 2])> = links.iter().collect();
    let depth = |link: &(usize, [Vector3<f64>; 2])| seen(&link.1[0])[2] + seen(&link.1[1])[2];
    order.sort_by(|a, b| depth(b).total_cmp(&depth(a)));
    let mut labels = Labels::new([WIDTH, height]);
    for (b, ends) in &order {
        let name = &model.robot().bodies()[*b].name;
        let rms = joints.iter().find(|j| j.name == *name).map(|j| j.rms);
        let [from, to] = [place(&ends[0]), place(&ends[1])];
        labels.keep_clear_of(name, from, to);
        let ([x1, y1], [x2, y2]) = (from, to);
        let told = rms.map_or_else(|| "not recorded".to_owned(), |rms| format!("{rms:.3} N m"));
        let name = escape::html(name);
        let _ = writeln!(
            text,
            "<g data-joint=\"{name}\" data-rms=\"{}\"><title>{name}: {told}</title>\
             <line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/><circle cx=\"{x1:.1}\" cy=\"{y1:.1}\" r=\"5\"/></g>",
            rms.map_or_else(String::new, |rms| rms.to_string()),
        );
    }
    let [from, to] = ahead.map(|x| place(&x));
    labels.keep_clear_of("", from, to);
    text += &arrow_of(from, to);
    let towards = if model.feet().is_empty() {
        "x of the base"
    } else {
        "front"
    };
    let mut names = vec![(towards, [to, to])];
    for (b, ends) in order.iter().rev() {
        let name = model.robot().bodies()[*b].name.as_str();
        if names.iter().all(|(known, _)| *known != name) {
            names.push((name, [place(&ends[0]), place(&ends[1])]));
        }
    }
    for (name, at) in names {
        let [x, y] = labels.place(name, at);
        let name = escape::html(name);
        let _ = writeln!(text, "<text x=\"{x:.1}\" y=\"{y:.1}\">{name}</text>");
    }
    text += "</svg><figcaption class=\"scale\"><span id=\"scale-start\"></span><i></i><span id=\"scale-end\"></span></figcaption></figure>\n";
    text
}

/// What the colours show.
fn in_words(joints: &[DrawnJoint]) -> String {
    let by_error = |a: &&DrawnJoint, b: &&DrawnJoint| a.rms.total_cmp(&b.rms);
    match (
        joints.iter().min_by(by_error),
        joints.iter().max_by(by_error),
    ) {
        (Some(least), Some(most)) => format!(
            "The robot; each link has the colour of its joint's torque error, from {:.3} N m at {} to {:.3} N m at {}.",
            least.rms, least.name, most.rms, most.name
        ),
        _ => "The robot.".to_owned(),
    }
}

/// An arrow along the base's x axis, from the foremost joint of the base on.
fn arrow(links: &[(usize, [Vector3<f64>; 2])], roots: &[Vector3<f64>]) -> [Vector3<f64>; 2] {
    let ends = || links.iter().flat_map(|(_, ends)| ends);
    let size = ends().map(|x| x.norm()).fold(0.0, f64::max);
    let foremost = roots.iter().map(|x| x.x).fold(0.0, f64::max);
    [foremost, foremost + ARROW * size].map(|x| Vector3::new(x, 0.0, 0.0))
}

fn arrow_of([x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) -> String {
    let long = (x2 - x1).hypot(y2 - y1).max(1e-9);
    let (along, across) = ((x2 - x1) / long, (y2 - y1) / long);
    let wing = |side: f64| {
        let [x, y] = [
            x2 - 9.0 * along - side * across,
            y2 - 9.0 * across + side * along,
        ];
        format!("{x:.1},{y:.1}")
    };
    format!(
        "<path class=\"ahead\" d=\"M{x1:.1},{y1:.1}L{x2:.1},{y2:.1}M{}L{x2:.1},{y2:.1}L{}\"/>\n",
        wing(5.0),
        wing(-5.0)
    )
}

/// Places along a link, as shares of it, and distances from there, at which its name is tried.
const ALONG: [f64; 3] = [0.5, 0.3, 0.7];
const REACH: [f64; 4] = [8.0, 16.0, 26.0, 38.0];
/// A name is nearer to its own link than to any other by so much, half a line.
const CLEARLY: f64 = 0.5 * LINE;

/// Where names stand: each beside its link, where it covers least of what is there already.
struct Labels {
    size: [f64; 2],
    /// Points of links, and whose each is.
    points: Vec<([f64; 2], String)>,
    /// Names that are placed: left, right, top, bottom.
    taken: Vec<[f64; 4]>,
}

impl Labels {
    fn new(size: [f64; 2]) -> Self {
        Self {
            size,
            points: Vec::new(),
            taken: Vec::new(),
        }
    }

    fn keep_clear_of(&mut self, name: &str, [x1, y1]: [f64; 2], [x2, y2]: [f64; 2]) {
        let steps = (((x2 - x1).hypot(y2 - y1) / 4.0) as usize).max(1);
        let share = |k: usize| k as f64 / steps as f64;
        let points = (0..=steps).map(|k| [x1 + share(k) * (x2 - x1), y1 + share(k) * (y2 - y1)]);
        self.points
            .extend(points.map(|point| (point, name.to_owned())));
    }

    /// Where the text of a name of what reaches from `from` to `to` begins, its foot line.
    fn place(&mut self, name: &str, [from, to]: [[f64; 2]; 2]) -> [f64; 2] {
        let (width, height) = (LETTER * name.chars().count() as f64, LINE);
        let mut best = (f64::INFINITY, [0.0; 4]);
        // Beside the middle first: on a tie the first stays.
        for (along, reach) in ALONG
            .iter()
            .flat_map(|along| REACH.map(|reach| (along, reach)))
        {
            let [x, y] = [0, 1].map(|k| from[k] + along * (to[k] - from[k]));
            for turn in 0..12 {
                let angle = f64::from(turn) * std::f64::consts::TAU / 12.0;
                let [dx, dy] = [angle.cos(), angle.sin()];
                // The text's middle, as far that its edge clears the link.
                let [cx, cy] = [
                    x + dx * (reach + 0.5 * width),
                    y + dy * (reach + 0.5 * height),
                ];
                let area = [
                    cx - 0.5 * width,
                    cx + 0.5 * width,
                    cy - 0.5 * height,
                    cy + 0.5 * height,
                ];
                let cost = self.covered(&area) + 0.05 * reach + self.astray(name, [cx, cy]);
                if cost < best.0 {
                    best = (cost, area);
                }
            }
        }
        let (_, area) = best;
        self.taken.push(area);
        [area[0], area[3] - 3.0]
    }

    /// By how much another link is nearer to a name's middle than its own: who reads takes it for that one's.
    fn astray(&self, name: &str, [x, y]: [f64; 2]) -> f64 {
        let nearest = |own: bool| {
            let points = self.points.iter().filter(|(_, of)| (of == name) == own);
            points
                .map(|([px, py], _)| (px - x).hypot(py - y))
                .fold(f64::INFINITY, f64::min)
        };
        let (own, other) = (nearest(true), nearest(false));
        match own.is_finite() && own + CLEARLY > other {
            true => own + CLEARLY - other,
            false => 0.0,
        }
    }

    /// How much an area covers.
    fn covered(&self, [left, right, top, bottom]: &[f64; 4]) -> f64 {
        let beyond = (-left).max(0.0)
            + (right - self.size[0]).max(0.0)
            + (-top).max(0.0)
            + (bottom - self.size[1]).max(0.0);
        let inside = |(p, _): &&([f64; 2], String)| {
            p[0] > left - 3.0 && p[0] < right + 3.0 && p[1] > top - 3.0 && p[1] < bottom + 3.0
        };
        let overlap = |other: &[f64; 4]| {
            let wide = right.min(other[1]) - left.max(other[0]);
            let high = bottom.min(other[3]) - top.max(other[2]);
            wide.max(0.0) * high.max(0.0)
        };
        let names: f64 = self.taken.iter().map(overlap).sum();
        10.0 * beyond + self.points.iter().filter(inside).count() as f64 + names
    }
}

/// Points in the order in which one goes around them, seen from above.
fn around(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let centre = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let mut points = points.to_vec();
    let angle = |x: &Vector3<f64>| (x.y - centre.y).atan2(x.x - centre.x);
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    points
}
