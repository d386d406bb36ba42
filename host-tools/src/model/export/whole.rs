//! Whole files, for a robot that has none of its own, and the elements that they are made of.

use std::fmt::Write;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;

use super::effects::{JointAttribute, LIMIT, Stated, Tendon};
use super::{Inertial, escaped, number, numbers};
use crate::model::{BASE, Body, JointKind, Model};

/// Attributes of URDF's `<inertia>`, in the order of [`Inertial::six`].
pub(super) const INERTIA: [&str; 6] = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"];

/// The robot as URDF.
pub(super) fn urdf(model: &Model, effects: &[JointAttribute]) -> String {
    let robot = model.robot();
    let mut out = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n",
        escaped(robot.name())
    );
    push_link(&mut out, robot.base_link(), model.inertia(BASE));
    for (b, body) in robot.bodies().iter().enumerate() {
        push_link(&mut out, &body.link_name, model.inertia(b));
    }
    for (b, body) in robot.bodies().iter().enumerate() {
        let parent = body
            .parent
            .map_or(robot.base_link(), |p| &robot.bodies()[p].link_name);
        let effects: Vec<_> = effects.iter().filter(|e| e.joint == b).collect();
        let placement = model.placement(b);
        push_joint(&mut out, (body, &placement), parent, &effects);
    }
    out + "</robot>\n"
}

fn push_link(out: &mut String, name: &str, phi: &InertialParameters<f64>) {
    let name = escaped(name);
    if phi.mass() > 0.0 {
        let inertial = inertial_element(&Inertial::of(phi)).replace("><", ">\n      <");
        let inertial = inertial.replace("      </inertial>", "    </inertial>");
        *out += &format!("  <link name=\"{name}\">\n    {inertial}\n  </link>\n");
    } else {
        *out += &format!("  <link name=\"{name}\"/>\n");
    }
}

fn push_joint(
    out: &mut String,
    (body, placement): (&Body, &Transform<f64>),
    parent: &str,
    effects: &[&JointAttribute],
) {
    let kind = match body.kind {
        JointKind::Revolute => "revolute",
        JointKind::Continuous => "continuous",
        JointKind::Prismatic => "prismatic",
    };
    let Transform {
        rotation,
        translation,
    } = *placement;
    let (r, p, y) = Rotation3::from_matrix_unchecked(rotation).euler_angles();
    let rpy = if rotation == Matrix3::identity() {
        String::new()
    } else {
        format!(" rpy=\"{}\"", numbers([r, p, y]))
    };
    let (limits, dynamics): (Vec<&JointAttribute>, Vec<_>) =
        effects.iter().partition(|e| e.element == LIMIT);
    let mut limit = String::new();
    let entries = [
        ("lower", body.limits[0]),
        ("upper", body.limits[1]),
        ("effort", body.effort),
        ("velocity", body.velocity),
    ];
    for (name, value) in entries {
        let found = limits.iter().find(|e| e.attribute == name);
        let value = found.map_or(value, |e| e.values[0]);
        if value.is_finite() {
            limit += &format!(" {name}=\"{}\"", number(value));
        }
    }
    *out += &format!(
        "  <joint name=\"{}\" type=\"{kind}\">\n    <origin xyz=\"{}\"{rpy}/>\n    <parent link=\"{}\"/>\n    <child \
         link=\"{}\"/>\n    <axis xyz=\"{}\"/>\n",
        escaped(&body.joint_name),
        numbers(translation.iter().copied()),
        escaped(parent),
        escaped(&body.link_name),
        numbers(body.axis.iter().copied()),
    );
    if !limit.is_empty() {
        *out += &format!("    <limit{limit}/>\n");
    }
    if !dynamics.is_empty() {
        *out += &format!("    {}\n", dynamics_element(&dynamics));
    }
    *out += "  </joint>\n";
}

pub(super) fn dynamics_element(effects: &[&JointAttribute]) -> String {
    let attributes: String = effects
        .iter()
        .map(|e| format!(" {}=\"{}\"", e.attribute, numbers(e.values.iter().copied())))
        .collect();
    format!("<dynamics{attributes}/>")
}

pub(super) fn origin_element(inertial: &Inertial) -> String {
    format!(
        "<origin xyz=\"{}\"/>",
        numbers(inertial.com.iter().copied())
    )
}

pub(super) fn inertial_element(inertial: &Inertial) -> String {
    let inertia: String = INERTIA
        .iter()
        .zip(inertial.six())
        .map(|(name, value)| format!(" {name}=\"{}\"", number(value)))
        .collect();
    format!(
        "<inertial>{}<mass value=\"{}\"/><inertia{inertia}/></inertial>",
        origin_element(inertial),
        number(inertial.mass)
    )
}

/// Stiff dry friction, of joints. MuJoCo's default builds up over 20 ms, so that fast reversals get too little of it. 4 ms are two of MuJoCo's default
/// steps of 2 ms, the least that it takes; the impedance is that of `tests/oracle/mujoco_logs.py`.
pub(super) const STIFF_FRICTION: &str =
    "<default><joint solreffriction=\"0.004 1\" solimpfriction=\"0.999 0.9999 0.001\"/></default>";

/// The robot as MJCF, its base fixed, a motor at every joint.
pub(super) fn mjcf(model: &Model, stated: &Stated) -> String {
    let effects = &stated.attributes;
    let robot = model.robot();
    let mut out = format!(
        "<mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\"/>\n  <option gravity=\"0 0 -9.81\"/>\n\
         \x20 {STIFF_FRICTION}\n  <worldbody>\n",
        escaped(robot.name())
    );
    let turn = orientation(&model.base().rotation);
    let _ = writeln!(
        out,
        "    <body name=\"{}\"{turn}>",
        escaped(robot.base_link())
    );
    out += "      <!-- pinned; put a <freejoint/> here to let it go -->\n";
    if model.inertia(BASE).mass() > 0.0 {
        let _ = writeln!(
            out,
            "      {}",
            mjcf_inertial(&Inertial::of(model.inertia(BASE)))
        );
    }
    // Bodies are numbered depth first: a body closes those it does not hang on.
    let mut open: Vec<usize> = Vec::new();
    for (b, body) in robot.bodies().iter().enumerate() {
        while open.last().copied() != body.parent && open.pop().is_some() {
            let _ = writeln!(out, "{}</body>", "  ".repeat(open.len() + 3));
        }
        let indent = "  ".repeat(open.len() + 3);
        let placement = model.placement(b);
        let _ = writeln!(
            out,
            "{indent}<body name=\"{}\" pos=\"{}\"{}>",
            escaped(&body.link_name),
            numbers(placement.translation.iter().copied()),
            orientation(&placement.rotation)
        );
        let _ = writeln!(
            out,
            "{indent}  {}",
            mjcf_inertial(&Inertial::of(model.inertia(b)))
        );
        let effects = effects.iter().filter(|e| e.joint == b);
        let _ = writeln!(out, "{indent}  {}", mjcf_joint(body, effects));
        open.push(b);
    }
    while open.pop().is_some() {
        let _ = writeln!(out, "{}</body>", "  ".repeat(open.len() + 3));
    }
    out += "    </body>\n  </worldbody>\n";
    if !stated.tendons.is_empty() {
        out += "  <tendon>\n";
        for tendon in &stated.tendons {
            let joint = |joint: usize| model.robot().bodies()[joint].joint_name.as_str();
            let _ = writeln!(out, "    {}", fixed_tendon(tendon, joint));
        }
        out += "  </tendon>\n";
    }
    out += "  <actuator>\n";
    for body in robot.bodies() {
        let (name, joint) = (escaped(&body.name), escaped(&body.joint_name));
        let range = if body.effort.is_finite() {
            format!(" ctrlrange=\"{}\"", numbers([-body.effort, body.effort]))
        } else {
            String::new()
        };
        let _ = writeln!(out, "    <motor name=\"{name}\" joint=\"{joint}\"{range}/>");
    }
    out + "  </actuator>\n</mujoco>\n"
}

/// A tendon's element; `joint` is what the file calls a joint.
pub(super) fn fixed_tendon<'a>(tendon: &Tendon, joint: impl Fn(usize) -> &'a str) -> String {
    let coefficient = |(own, times): (usize, f64)| {
        let (name, times) = (escaped(joint(own)), number(times));
        format!("<joint joint=\"{name}\" coef=\"{times}\"/>")
    };
    let (name, attribute, value) = (&tendon.name, tendon.attribute, number(tendon.value));
    let joints = tendon.joints.map(coefficient).concat();
    format!(
        "<fixed name=\"{}\" {attribute}=\"{value}\">{joints}</fixed>",
        escaped(name)
    )
}

pub(super) fn mjcf_inertial(inertial: &Inertial) -> String {
    format!(
        "<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
        numbers(inertial.com.iter().copied()),
        number(inertial.mass),
        numbers(inertial.full())
    )
}

fn mjcf_joint<'a>(body: &Body, effects: impl Iterator<Item = &'a JointAttribute>) -> String {
    let kind = match body.kind {
        JointKind::Revolute | JointKind::Continuous => "hinge",
        JointKind::Prismatic => "slide",
    };
    let mut attributes = String::new();
    if body.limits.iter().all(|x| x.is_finite()) {
        attributes += &format!(" range=\"{}\"", numbers(body.limits));
    }
    for effect in effects {
        attributes += &format!(
            " {}=\"{}\"",
            effect.attribute,
            numbers(effect.values.iter().copied())
        );
    }
    let axis = numbers(body.axis.iter().copied());
    let name = escaped(&body.joint_name);
    format!("<joint name=\"{name}\" type=\"{kind}\" axis=\"{axis}\"{attributes}/>")
}

/// A rotation as an attribute; nothing for none.
fn orientation(rotation: &Matrix3<f64>) -> String {
    if *rotation == Matrix3::identity() {
        return String::new();
    }
    let q = UnitQuaternion::from_matrix(rotation);
    format!(" quat=\"{}\"", numbers([q.w, q.i, q.j, q.k]))
}
