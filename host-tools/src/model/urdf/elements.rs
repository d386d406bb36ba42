//! The links and joints of a URDF, as its elements state them.
//!
//! Shapes, and what other programs add, have no part in dynamics: their slips are not ours to judge.

use nalgebra::{Matrix3, Rotation3, Vector3};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;
use roxmltree::{Document, Node};

use super::Fault;
use crate::model::{RobotProblem, UnknownName};

/// What a joint lets its child do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum JointType {
    Revolute,
    Continuous,
    Prismatic,
    Fixed,
    Floating,
    Planar,
}

impl JointType {
    const NAMES: [(&str, JointType); 6] = [
        ("revolute", Self::Revolute),
        ("continuous", Self::Continuous),
        ("prismatic", Self::Prismatic),
        ("fixed", Self::Fixed),
        ("floating", Self::Floating),
        ("planar", Self::Planar),
    ];
}

/// A robot's elements, in the order of the file.
pub(super) struct Elements<'a> {
    pub(super) name: &'a str,
    pub(super) links: Vec<Link<'a>>,
    pub(super) joints: Vec<Joint<'a>>,
}

/// A link.
pub(super) struct Link<'a> {
    pub(super) name: &'a str,
    /// φ about its own frame; zero where it states none.
    pub(super) inertia: InertialParameters<f64>,
    /// Whether it has a shape.
    pub(super) has_shape: bool,
    /// Centre (m, in its own frame) and radius of the first sphere that it touches others with; none if what is stated of it cannot be read.
    pub(super) sphere: Option<(Vector3<f64>, f64)>,
}

/// A joint.
pub(super) struct Joint<'a> {
    pub(super) name: &'a str,
    pub(super) kind: JointType,
    /// Its frame, at zero, in the parent's.
    pub(super) origin: Transform<f64>,
    pub(super) parent: &'a str,
    pub(super) child: &'a str,
    /// As written; x where it is not.
    pub(super) axis: Vector3<f64>,
    /// Stops, rad or m; zeros where there are none.
    pub(super) limits: [f64; 2],
    /// What it can do, N m or N; zero where it is not stated.
    pub(super) effort: f64,
    /// How fast, rad/s or m/s; zero where it is not stated.
    pub(super) velocity: f64,
    pub(super) mimic: Option<Mimic<'a>>,
}

/// q = multiplier q of `joint` + offset.
pub(super) struct Mimic<'a> {
    pub(super) joint: &'a str,
    pub(super) multiplier: f64,
    pub(super) offset: f64,
}

impl<'a> Elements<'a> {
    /// Those of a document, if it is a URDF and all that it states of dynamics can be read.
    pub(super) fn of(document: &'a Document) -> Result<Self, Box<Fault>> {
        let robot = document.root_element();
        let root = robot.tag_name().name();
        if root != "robot" {
            let message = format!("the root element is `{root}`, not `robot`");
            return Err(Fault::boxed("robot", "", RobotProblem::Syntax(message)));
        }
        let of = |tag: &'static str| {
            let own = robot.children().filter(move |node| node.has_tag_name(tag));
            own.map(move |node| Element::of(tag, node))
        };
        Ok(Self {
            name: robot.attribute("name").unwrap_or_default(),
            links: of("link").map(Link::of).collect::<Result<_, _>>()?,
            joints: of("joint").map(Joint::of).collect::<Result<_, _>>()?,
        })
    }
}

impl Elements<'_> {
    /// Whether joints move, and no link has a mass or a moment of inertia.
    pub(super) fn lack_masses(&self) -> bool {
        let moves = |joint: &Joint| joint.kind != JointType::Fixed;
        let weightless = |link: &Link| link.inertia == InertialParameters::zero();
        self.joints.iter().any(moves) && self.links.iter().all(weightless)
    }
}

impl<'a> Link<'a> {
    fn of(link: Element<'a>) -> Result<Self, Box<Fault>> {
        let inertia = match link.child("inertial") {
            None => InertialParameters::zero(),
            Some(inertial) => link.within(inertial).inertia()?,
        };
        Ok(Self {
            name: link.name,
            inertia,
            has_shape: link.child("visual").or(link.child("collision")).is_some(),
            sphere: link.sphere(),
        })
    }
}

impl<'a> Joint<'a> {
    fn of(joint: Element<'a>) -> Result<Self, Box<Fault>> {
        let limit = |attribute| {
            let limit = joint.child("limit");
            let stated = limit
                .map(|limit| joint.number(limit, attribute))
                .transpose();
            stated.map(|stated| stated.flatten().unwrap_or(0.0))
        };
        let axis = joint.child("axis");
        let axis = axis.map(|axis| joint.vector(axis, "xyz")).transpose()?;
        Ok(Self {
            name: joint.name,
            kind: joint.kind()?,
            origin: joint.origin()?,
            parent: joint.stated_in("parent", "link")?,
            child: joint.stated_in("child", "link")?,
            axis: axis.flatten().unwrap_or_else(Vector3::x),
            limits: [limit("lower")?, limit("upper")?],
            effort: limit("effort")?,
            velocity: limit("velocity")?,
            mimic: joint.child("mimic").map(|_| joint.mimic()).transpose()?,
        })
    }
}

/// A link or a joint, or a part of one.
#[derive(Clone, Copy)]
struct Element<'a> {
    /// The link's or joint's tag and name, for errors.
    tag: &'static str,
    name: &'a str,
    node: Node<'a, 'a>,
}

impl<'a> Element<'a> {
    fn of(tag: &'static str, node: Node<'a, 'a>) -> Self {
        let name = node.attribute("name").unwrap_or_default();
        Self { tag, name, node }
    }

    /// A part of the same link or joint.
    fn within(self, node: Node<'a, 'a>) -> Self {
        Self { node, ..self }
    }

    fn child(self, tag: &str) -> Option<Node<'a, 'a>> {
        self.node.children().find(|node| node.has_tag_name(tag))
    }

    fn fault(self, problem: RobotProblem) -> Box<Fault> {
        Fault::boxed(self.tag, self.name, problem)
    }

    /// Finite numbers of an attribute; a limit may be infinite, which is none.
    fn numbers<const N: usize>(
        self,
        part: Node<'a, 'a>,
        attribute: &'static str,
    ) -> Result<Option<[f64; N]>, Box<Fault>> {
        let Some(value) = part.attribute(attribute) else {
            return Ok(None);
        };
        let may_be = |x: &f64| x.is_finite() || (part.has_tag_name("limit") && !x.is_nan());
        let words = value.split_whitespace();
        let numbers: Option<Vec<f64>> = words.map(|x| x.parse().ok().filter(may_be)).collect();
        let numbers = numbers.and_then(|numbers| numbers.try_into().ok());
        let wrong = || {
            self.fault(RobotProblem::Numbers {
                what: self.tag,
                name: self.name.to_owned(),
                attribute,
                value: value.to_owned(),
                count: N,
            })
        };
        numbers.ok_or_else(wrong).map(Some)
    }

    fn number(
        self,
        part: Node<'a, 'a>,
        attribute: &'static str,
    ) -> Result<Option<f64>, Box<Fault>> {
        Ok(self.numbers(part, attribute)?.map(|[x]| x))
    }

    fn vector(
        self,
        part: Node<'a, 'a>,
        attribute: &'static str,
    ) -> Result<Option<Vector3<f64>>, Box<Fault>> {
        Ok(self.numbers(part, attribute)?.map(Vector3::from))
    }

    /// What a part must state.
    fn missing(self, part: &'static str, attribute: &'static str) -> Box<Fault> {
        self.fault(RobotProblem::Missing {
            what: self.tag,
            name: self.name.to_owned(),
            part,
            attribute,
        })
    }

    fn stated_in(self, part: &'static str, attribute: &'static str) -> Result<&'a str, Box<Fault>> {
        let stated = self.child(part).and_then(|node| node.attribute(attribute));
        stated.ok_or_else(|| self.missing(part, attribute))
    }

    fn number_in(self, part: &'static str, attribute: &'static str) -> Result<f64, Box<Fault>> {
        let node = self
            .child(part)
            .ok_or_else(|| self.missing(part, attribute))?;
        let stated = self.number(node, attribute)?;
        stated.ok_or_else(|| self.missing(part, attribute))
    }

    /// Where its frame is in the one it hangs in: rotated about the fixed axes x, y and z in turn.
    fn origin(self) -> Result<Transform<f64>, Box<Fault>> {
        let origin = self.child("origin");
        let vector = |attribute| -> Result<Vector3<f64>, Box<Fault>> {
            let stated = origin
                .map(|origin| self.vector(origin, attribute))
                .transpose()?;
            Ok(stated.flatten().unwrap_or_else(Vector3::zeros))
        };
        let (there, turned) = (vector("xyz")?, vector("rpy")?);
        Ok(Transform {
            rotation: *Rotation3::from_euler_angles(turned.x, turned.y, turned.z).matrix(),
            translation: there,
        })
    }

    /// The first sphere among what a link touches others with.
    fn sphere(self) -> Option<(Vector3<f64>, f64)> {
        let shapes = self.node.children();
        let mut shapes = shapes.filter(|node| node.has_tag_name("collision"));
        shapes.find_map(|shape| {
            let geometry = self.within(shape).child("geometry")?;
            let sphere = self.within(geometry).child("sphere")?;
            let radius = self.number(sphere, "radius").ok()??;
            let there = self.within(shape).origin().ok()?;
            Some((there.translation, radius)).filter(|(_, radius)| *radius > 0.0)
        })
    }

    /// φ of an `inertial` about the link's own frame.
    fn inertia(self) -> Result<InertialParameters<f64>, Box<Fault>> {
        let of = |attribute| self.number_in("inertia", attribute);
        let mass = self.number_in("mass", "value")?;
        let [ixx, ixy, ixz] = [of("ixx")?, of("ixy")?, of("ixz")?];
        let [iyy, iyz, izz] = [of("iyy")?, of("iyz")?, of("izz")?];
        let about_com = Matrix3::new(ixx, ixy, ixz, ixy, iyy, iyz, ixz, iyz, izz);
        let at_com = InertialParameters::from_com(mass, Vector3::zeros(), about_com);
        Ok(at_com.in_parent(&self.origin()?))
    }

    fn kind(self) -> Result<JointType, Box<Fault>> {
        let kind = self.node.attribute("type").unwrap_or_default();
        let known = JointType::NAMES.iter().find(|(name, _)| *name == kind);
        known.map(|(_, kind)| *kind).ok_or_else(|| {
            let names = JointType::NAMES.map(|(name, _)| name);
            self.fault(RobotProblem::UnknownType {
                joint: self.name.to_owned(),
                unknown: UnknownName::new("joint type", kind, names),
            })
        })
    }

    fn mimic(self) -> Result<Mimic<'a>, Box<Fault>> {
        let of = |attribute| match self.child("mimic") {
            Some(mimic) => self.number(mimic, attribute),
            None => Ok(None),
        };
        Ok(Mimic {
            joint: self.stated_in("mimic", "joint")?,
            multiplier: of("multiplier")?.unwrap_or(1.0),
            offset: of("offset")?.unwrap_or(0.0),
        })
    }
}
