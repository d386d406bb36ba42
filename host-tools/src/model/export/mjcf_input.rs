//! What has to be known of a user's MJCF before inertias are written into it.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;
use roxmltree::{Document, Node};

use super::{ExportProblem, same_axis, same_place};
use crate::model::{Model, UnknownName};

/// An element and what is wrong with it.
pub(super) type Fault<'d> = (Node<'d, 'd>, ExportProblem);

/// A user's MJCF.
pub(super) struct Input<'d> {
    root: Node<'d, 'd>,
    joints: Vec<Node<'d, 'd>>,
}

impl<'d> Input<'d> {
    /// Refuses what is no MJCF, and options by which MuJoCo would not use the inertias as written.
    pub(super) fn new(document: &'d Document<'d>) -> Result<Self, Fault<'d>> {
        let root = document.root_element();
        if !root.has_tag_name("mujoco") {
            let problem = format!(
                "not an MJCF: the root element is `{}`",
                root.tag_name().name()
            );
            return Err((root, ExportProblem::Syntax(problem)));
        }
        for compiler in root.children().filter(|n| n.has_tag_name("compiler")) {
            let is = |name, value| {
                compiler
                    .attribute(name)
                    .is_some_and(|text| text.trim() == value)
            };
            let positive = |name| {
                let value = compiler
                    .attribute(name)
                    .and_then(|text| text.trim().parse::<f64>().ok());
                value.is_some_and(|x| x > 0.0)
            };
            let option = if is("inertiafromgeom", "true") {
                "inertiafromgeom"
            } else if is("balanceinertia", "true") {
                "balanceinertia"
            } else if positive("settotalmass") {
                "settotalmass"
            } else {
                continue;
            };
            return Err((compiler, ExportProblem::Compiler(option)));
        }
        let worlds = root.children().filter(|n| n.has_tag_name("worldbody"));
        let joints = worlds
            .flat_map(|world| world.descendants())
            .filter(|n| n.has_tag_name("joint"))
            .collect();
        Ok(Self { root, joints })
    }

    /// The root element.
    pub(super) fn root(&self) -> Node<'d, 'd> {
        self.root
    }

    /// A radian in the file's unit of angles, which is the degree unless it says otherwise.
    pub(super) fn radian(&self) -> f64 {
        let compilers = self.root.children().filter(|n| n.has_tag_name("compiler"));
        match compilers.filter_map(|n| n.attribute("angle")).next_back() {
            Some("radian") => 1.0,
            _ => 180.0 / std::f64::consts::PI,
        }
    }

    /// Whether it has a tendon of this name.
    pub(super) fn has_tendon(&self, name: &str) -> bool {
        let tendons = self.root.descendants().filter(|n| {
            let parent = n.parent();
            parent.is_some_and(|parent| parent.has_tag_name("tendon"))
        });
        let mut names = tendons.filter_map(|n| n.attribute("name"));
        names.any(|own| own == name)
    }

    /// The joint element of a joint of the model.
    pub(super) fn joint(&self, model: &Model, joint: usize) -> Result<Node<'d, 'd>, Fault<'d>> {
        let body = &model.robot().bodies()[joint];
        let called = |name: &str| {
            self.joints
                .iter()
                .find(|n| n.attribute("name") == Some(name))
                .copied()
        };
        called(&body.joint_name)
            .or_else(|| called(&body.name))
            .ok_or_else(|| {
                let known = self.joints.iter().filter_map(|n| n.attribute("name"));
                let unknown = UnknownName::new("joint", &body.joint_name, known);
                (self.root, ExportProblem::Missing(unknown))
            })
    }

    /// The body that a joint moves, which has no other joint.
    pub(super) fn body_of(&self, joint: Node<'d, 'd>) -> Result<Node<'d, 'd>, Fault<'d>> {
        let body = joint.parent().unwrap_or(joint);
        if body.children().filter(is_joint).count() > 1 {
            let name = body.attribute("name").unwrap_or_default().to_owned();
            return Err((body, ExportProblem::SeveralJoints(name)));
        }
        Ok(body)
    }

    /// Placement of the model's joint frame in the frame of the body that the joint moves.
    pub(super) fn joint_frame(&self, joint: Node<'d, 'd>) -> Result<Transform<f64>, Fault<'d>> {
        Ok(Transform::from_translation(
            vector(joint, "pos")?.unwrap_or_default(),
        ))
    }

    /// A joint, and those that carry it, stand where the model's do.
    ///
    /// The axis is compared where the joint states it; one that comes from a class of defaults is taken on trust.
    pub(super) fn check_place(
        &self,
        model: &Model,
        b: usize,
        joint: Node<'d, 'd>,
    ) -> Result<(), Fault<'d>> {
        let ours = &model.robot().bodies()[b];
        let mut body = self.body_of(joint)?;
        let top = match ours.parent {
            Some(parent) => {
                let parent = self.joint(model, parent)?;
                let frame = self.joint_frame(parent)?;
                Some((self.body_of(parent)?, frame))
            }
            None => base_of(body, model.robot().base_link()).map(|base| (base, identity())),
        };
        // A limb that hangs on the world itself stands where the user put it.
        if let Some((top, frame)) = top {
            let mut placement = self.joint_frame(joint)?;
            while body != top {
                placement = placement_of(body)?.compose(&placement);
                let Some(parent) = body.parent() else { break };
                body = parent;
            }
            let from_frame = Transform::from_translation(-frame.translation);
            same_place(&ours.name, &from_frame.compose(&placement), &ours.placement)
                .map_err(|problem| (joint, problem))?;
        }
        match vector(joint, "axis")? {
            Some(axis) if axis.norm() > 0.0 => same_axis(&ours.name, &axis.normalize(), &ours.axis)
                .map_err(|problem| (joint, problem)),
            _ => Ok(()),
        }
    }

    /// The body that all limbs hang on, as they do on the model's base; `None` where they hang on the world.
    pub(super) fn base(&self, model: &Model) -> Result<Option<Node<'d, 'd>>, Fault<'d>> {
        let robot = model.robot();
        let mut base = None;
        for b in (0..robot.bodies().len()).filter(|&b| robot.bodies()[b].parent.is_none()) {
            let joint = self.joint(model, b)?;
            self.check_place(model, b, joint)?;
            let own = base_of(self.body_of(joint)?, robot.base_link());
            if own.is_none() || base.is_some_and(|base| Some(base) != own) {
                return Ok(None);
            }
            base = own;
        }
        Ok(base)
    }

    /// Inertia, in the frame of `body`, of the bodies without joints that it carries.
    pub(super) fn carried(&self, body: Node<'d, 'd>) -> Result<InertialParameters<f64>, Fault<'d>> {
        let mut sum = InertialParameters::zero();
        for child in body
            .children()
            .filter(|n| n.has_tag_name("body") || n.has_tag_name("frame"))
        {
            if child.children().any(|n| is_joint(&n)) {
                continue;
            }
            let own = if child.has_tag_name("body") {
                inertia_of(child)?
            } else {
                InertialParameters::zero()
            };
            let there = own + self.carried(child)?;
            sum = sum + there.in_parent(&placement_of(child)?);
        }
        Ok(sum)
    }
}

fn is_joint(node: &Node) -> bool {
    node.has_tag_name("joint") || node.has_tag_name("freejoint")
}

fn identity() -> Transform<f64> {
    Transform::from_translation(Vector3::zeros())
}

/// The body that a limb hangs on: the ancestor of that name, else the outermost one.
fn base_of<'d>(body: Node<'d, 'd>, name: &str) -> Option<Node<'d, 'd>> {
    let above = || body.ancestors().skip(1).filter(|n| n.has_tag_name("body"));
    above()
        .find(|n| n.attribute("name") == Some(name))
        .or_else(|| above().last())
}

/// φ of a body without a joint about its own frame.
fn inertia_of<'d>(body: Node<'d, 'd>) -> Result<InertialParameters<f64>, Fault<'d>> {
    let Some(inertial) = body.children().find(|n| n.has_tag_name("inertial")) else {
        if body.children().any(|n| n.has_tag_name("geom")) {
            let name = body.attribute("name").unwrap_or_default().to_owned();
            return Err((body, ExportProblem::FromShapes(name)));
        }
        return Ok(InertialParameters::zero());
    };
    let mass = values::<1>(inertial, "mass")?.map_or(0.0, |[mass]| mass);
    let about_com = match values::<6>(inertial, "fullinertia")? {
        Some([xx, yy, zz, xy, xz, yz]) => Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        None => Matrix3::from_diagonal(&vector(inertial, "diaginertia")?.unwrap_or_default()),
    };
    let at_com = InertialParameters::from_com(mass, Vector3::zeros(), about_com);
    Ok(at_com.in_parent(&placement_of(inertial)?))
}

/// `pos` and `quat` of an element.
fn placement_of<'d>(node: Node<'d, 'd>) -> Result<Transform<f64>, Fault<'d>> {
    for notation in ["axisangle", "xyaxes", "zaxis", "euler"] {
        if node.has_attribute(notation) {
            return Err((node, ExportProblem::Orientation(notation)));
        }
    }
    let rotation = match values::<4>(node, "quat")? {
        Some([w, x, y, z]) => {
            let q = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.0);
            let bad = || {
                (
                    node,
                    ExportProblem::Syntax("`quat` has no length".to_owned()),
                )
            };
            *q.ok_or_else(bad)?.to_rotation_matrix().matrix()
        }
        None => Matrix3::identity(),
    };
    let translation = vector(node, "pos")?.unwrap_or_default();
    Ok(Transform {
        rotation,
        translation,
    })
}

fn vector<'d>(node: Node<'d, 'd>, name: &str) -> Result<Option<Vector3<f64>>, Fault<'d>> {
    Ok(values::<3>(node, name)?.map(Vector3::from))
}

/// An attribute of `N` numbers.
fn values<'d, const N: usize>(
    node: Node<'d, 'd>,
    name: &str,
) -> Result<Option<[f64; N]>, Fault<'d>> {
    let Some(text) = node.attribute(name) else {
        return Ok(None);
    };
    let parsed: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    match parsed.ok().and_then(|list| <[f64; N]>::try_from(list).ok()) {
        Some(list) => Ok(Some(list)),
        None => {
            let problem = format!(
                "`{name}=\"{text}\"` is not {N} number{}",
                if N == 1 { "" } else { "s" }
            );
            Err((node, ExportProblem::Syntax(problem)))
        }
    }
}
