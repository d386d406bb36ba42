//! The moving bodies of a URDF, what is fixed lumped into what carries it.

use nalgebra::{Rotation3, Vector3};
use proprio_core::go2::JOINT_NAMES;
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;

use super::Fault;
use super::elements::{Joint, JointType};
use super::holds::Holds;
use super::links::{Links, duplicate};
use crate::model::robot::Frame;
use crate::model::{Body, JointKind, RobotProblem};

/// How far an axis' length may be from 1: files round their numbers.
const AXIS_ROUNDING: f64 = 1e-3;

/// A link of the base.
#[derive(Debug)]
pub(in crate::model) struct BaseLink {
    pub(in crate::model) name: String,
    /// Its inertia about the origin of the base's frame.
    pub(in crate::model) inertia: InertialParameters<f64>,
    /// Its frame in the base's.
    pub(in crate::model) placement: Transform<f64>,
}

/// What a robot consists of.
pub(super) struct Parts {
    pub(super) base_link: String,
    pub(super) base_inertia: InertialParameters<f64>,
    /// The base's link and those fixed to it.
    pub(super) base_links: Vec<BaseLink>,
    /// The moving bodies, depth first.
    pub(super) bodies: Vec<Body>,
    /// Per body, what the links fixed to the moving one contribute.
    pub(super) carried: Vec<InertialParameters<f64>>,
    /// Per body, whether it or what is fixed to it has a shape.
    pub(super) shapes: Vec<bool>,
    /// All links, and where they are.
    pub(super) frames: Vec<Frame>,
    /// Joints that do not move, and where they are held, rad or m.
    pub(super) held: Vec<(String, f64)>,
    /// What was taken otherwise than the file has it.
    pub(super) notes: Vec<String>,
}

impl Parts {
    /// Those of a URDF's links, some of its joints held as the user says.
    pub(super) fn of(links: &Links, held: &[(String, f64)]) -> Result<Self, Box<Fault>> {
        let base = own_base(links);
        let mut parts = Self {
            base_link: links.elements.links[base].name.to_owned(),
            base_inertia: InertialParameters::zero(),
            base_links: Vec::new(),
            bodies: Vec::new(),
            carried: Vec::new(),
            shapes: Vec::new(),
            frames: Vec::new(),
            held: Vec::new(),
            notes: Vec::new(),
        };
        let holds = Holds::new(links, held)?;
        parts.visit(links, &holds, base, None, identity())?;
        for parent in (0..parts.bodies.len())
            .filter_map(|b| parts.bodies[b].parent)
            .collect::<Vec<_>>()
        {
            parts.bodies[parent].foot = None;
        }
        // A short name may be another joint's whole name.
        let mut names: Vec<&str> = parts.bodies.iter().map(|body| body.name.as_str()).collect();
        names.sort_unstable();
        match names.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(duplicate("joint", pair[0])),
            None => Ok(parts),
        }
    }

    /// Adds a link that is, or is fixed to, a body (`None`: the base) at `placement`, and all that hangs on it.
    fn visit(
        &mut self,
        links: &Links,
        holds: &Holds,
        link: usize,
        body: Option<usize>,
        placement: Transform<f64>,
    ) -> Result<(), Box<Fault>> {
        let own = &links.elements.links[link];
        self.frames.push(Frame {
            link: own.name.to_owned(),
            body,
            placement,
            sphere: own.sphere,
        });
        let phi = own.inertia.in_parent(&placement);
        match body {
            None => {
                self.base_inertia = self.base_inertia + phi;
                self.base_links.push(BaseLink {
                    name: own.name.to_owned(),
                    inertia: phi,
                    placement,
                });
            }
            Some(b) => {
                self.bodies[b].inertia = self.bodies[b].inertia + phi;
                self.shapes[b] |= own.has_shape;
                if self.bodies[b].link_name != own.name {
                    self.carried[b] = self.carried[b] + phi;
                    let (there, foot) = (placement.translation, &mut self.bodies[b].foot);
                    if foot.is_none_or(|foot| foot.norm() < there.norm()) {
                        *foot = Some(there);
                    }
                }
            }
        }
        for (joint, child) in links.children(link) {
            let there = placement.compose(&joint.origin);
            if joint.kind == JointType::Fixed {
                self.visit(links, holds, child, body, there)?;
            } else if let Some((position, note)) = holds.of(joint, child) {
                self.held.push((short_name(joint), position));
                self.notes.extend(note);
                let there = there.compose(&motion(joint, position));
                self.visit(links, holds, child, body, there)?;
            } else {
                let moved = moved(joint, body, there)
                    .map_err(|problem| Fault::boxed("joint", joint.name, problem))?;
                self.bodies.push(moved);
                self.carried.push(InertialParameters::zero());
                self.shapes.push(false);
                let body = Some(self.bodies.len() - 1);
                self.visit(links, holds, child, body, identity())?;
            }
        }
        Ok(())
    }
}

/// The robot's base: the root, or what floats in it, where the root is nothing but the world.
fn own_base(links: &Links) -> usize {
    let mut children = links.children(links.base);
    let nothing = links.elements.links[links.base].inertia == InertialParameters::zero();
    match (children.next(), children.next()) {
        (Some((joint, child)), None) if nothing && joint.kind == JointType::Floating => child,
        _ => links.base,
    }
}

fn identity() -> Transform<f64> {
    Transform::from_translation(Vector3::zeros())
}

/// The body that a joint moves, without inertia.
fn moved(
    joint: &Joint,
    parent: Option<usize>,
    placement: Transform<f64>,
) -> Result<Body, RobotProblem> {
    let unsupported = |kind| RobotProblem::UnsupportedType {
        joint: joint.name.to_owned(),
        kind,
    };
    let kind = match joint.kind {
        JointType::Revolute => JointKind::Revolute,
        JointType::Continuous => JointKind::Continuous,
        JointType::Prismatic => JointKind::Prismatic,
        JointType::Floating => return Err(unsupported("floating")),
        JointType::Planar => return Err(unsupported("planar")),
        JointType::Fixed => return Err(unsupported("fixed")),
    };
    let axis = joint.axis;
    let length = axis.norm();
    if length.is_nan() || (length - 1.0).abs() > AXIS_ROUNDING {
        return Err(RobotProblem::Axis {
            joint: joint.name.to_owned(),
            length,
        });
    }
    let stated = |value: f64| if value > 0.0 { value } else { f64::INFINITY };
    let stops = kind != JointKind::Continuous && joint.limits != [0.0, 0.0];
    Ok(Body {
        name: short_name(joint),
        joint_name: joint.name.to_owned(),
        link_name: joint.child.to_owned(),
        parent,
        placement,
        kind,
        axis: if length == 1.0 { axis } else { axis / length },
        limits: if stops {
            joint.limits
        } else {
            [f64::NEG_INFINITY, f64::INFINITY]
        },
        effort: stated(joint.effort),
        velocity: stated(joint.velocity),
        inertia: InertialParameters::zero(),
        motor: None,
        foot: None,
    })
}

/// What logs call a joint.
fn short_name(joint: &Joint) -> String {
    let short = joint.name.strip_suffix("_joint");
    let short = short.filter(|name| JOINT_NAMES.contains(name));
    short.unwrap_or(joint.name).to_owned()
}

/// Displacement of a joint from its zero.
fn motion(joint: &Joint, position: f64) -> Transform<f64> {
    let axis = joint.axis;
    let axis = axis
        .try_normalize(f64::MIN_POSITIVE)
        .unwrap_or_else(Vector3::zeros);
    match joint.kind {
        JointType::Revolute | JointType::Continuous => Transform {
            rotation: *Rotation3::new(axis * position).matrix(),
            translation: Vector3::zeros(),
        },
        JointType::Prismatic => Transform::from_translation(axis * position),
        _ => identity(),
    }
}
