//! The robot as lines, from its URDF: each link in the colour of its joint's error.

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

/// A joint of the drawing: where it is, its torque error before and after, N m.
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
    for body in bodies {
        let parent = body.parent.map_or_else(Transform::identity, |p| frames[p]);
        let q = joints
            .iter()
            .find(|j| j.name == body.name)
            .map_or(0.0, |j| j.q);
        let mut frame = Transform {
            rotation: parent.rotation * body.placement.rotation,
            translation: parent.translation + parent.rotation * body.placement.translation,
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
    let points: Vec<[f64; 3]> = (links.iter().flat_map(|(_, ends)| ends))
        .chain(roots)
        .chain(&[Vector3::zeros()])
        .map(seen)
        .collect();
    let range = |n: usize| {
        points
            .iter()
            .fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p[n]), b.max(p[n])))
    };
    let ([left, right], [top, bottom]) = ([range(0).0, range(0).1], [range(1).0, range(1).1]);
    let scale = (WIDTH - 2.0 * MARGIN) / (right - left).max(bottom - top).max(1e-9);
    let place = |x: &Vector3<f64>| {
        let [x, y, _] = seen(x);
        [MARGIN + scale * (x - left), MARGIN + scale * (y - top)]
    };
    let (width, height) = (
        2.0 * MARGIN + scale * (right - left),
        2.0 * MARGIN + scale * (bottom - top),
    );
    let worst = joints.iter().max_by(|a, b| a.rms.total_cmp(&b.rms));
    let words = worst.map_or_else(String::new, |worst| {
        format!(
            "The robot; each link has the colour of its joint's torque error. The largest is {:.3} N m at {}.",
            worst.rms, worst.name
        )
    });
    let mut text = format!(
        "<figure class=\"robot\"><svg id=\"robot\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {width:.0} {height:.0}\">\n",
        escape::html(&words)
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
    for (b, ends) in order {
        let name = &model.robot().bodies()[*b].name;
        let rms = joints.iter().find(|j| j.name == *name).map(|j| j.rms);
        let [[x1, y1], [x2, y2]] = [place(&ends[0]), place(&ends[1])];
        let told = rms.map_or_else(|| "not recorded".to_owned(), |rms| format!("{rms:.3} N m"));
        let name = escape::html(name);
        let _ = writeln!(
            text,
            "<g data-joint=\"{name}\" data-rms=\"{}\"><title>{name}: {told}</title>\
             <line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\"/><circle cx=\"{x1:.1}\" cy=\"{y1:.1}\" r=\"5\"/></g>",
            rms.map_or_else(String::new, |rms| rms.to_string()),
        );
    }
    text += "</svg><figcaption class=\"scale\"><span>0</span><i></i><span id=\"scale-end\"></span> N m, rms</figcaption></figure>\n";
    text
}

/// Points in the order in which one goes around them, seen from above.
fn around(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let centre = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let mut points = points.to_vec();
    let angle = |x: &Vector3<f64>| (x.y - centre.y).atan2(x.x - centre.x);
    points.sort_by(|a, b| angle(a).total_cmp(&angle(b)));
    points
}
