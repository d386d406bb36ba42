//! A robot from its URDF.
//!
//! `urdf-rs` reads the values; the XML itself is kept for the lines of errors and, in [`super::export`], for writing into.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Rotation3, Vector3};
use proprio_core::go2::JOINT_NAMES;
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;
use urdf_rs::{Inertial, JointType, Pose};

use super::name::UnknownName;
use super::physical::Unphysical;
use super::robot::{Body, JointKind, MAX_BODIES, Robot, RobotError, RobotProblem, Source};

/// The joint types of URDF.
const TYPES: [&str; 6] = [
    "revolute",
    "continuous",
    "prismatic",
    "fixed",
    "floating",
    "planar",
];

/// How far an axis' length may be from 1: files round their numbers.
const AXIS_ROUNDING: f64 = 1e-3;

/// A robot as its URDF has it, physical or not.
#[derive(Debug)]
pub(super) struct Description {
    /// The text itself.
    pub(super) text: String,
    /// The robot; its bodies may be unphysical.
    pub(super) robot: Robot,
    /// Per body, what the links fixed to the moving one contribute to it.
    pub(super) carried: Vec<InertialParameters<f64>>,
    path: PathBuf,
}

impl Description {
    /// Reads a file.
    pub(super) fn read(path: &Path) -> Result<Self, RobotError> {
        let text = std::fs::read_to_string(path).map_err(|error| RobotError {
            path: path.to_owned(),
            line: None,
            problem: RobotProblem::Read(error),
        })?;
        Self::parse(path, text)
    }

    /// The robot of a URDF's text; `path` is what errors call it.
    fn parse(path: &Path, text: String) -> Result<Self, RobotError> {
        let error = |element: Option<(&str, &str)>, problem| RobotError {
            path: path.to_owned(),
            line: element.and_then(|(tag, name)| line_of(&text, tag, name)),
            problem,
        };
        if let Err(problem) = roxmltree::Document::parse(&text) {
            return Err(RobotError {
                path: path.to_owned(),
                line: Some(problem.pos().row),
                problem: RobotProblem::Syntax(problem.to_string()),
            });
        }
        check_types(&text).map_err(|(joint, problem)| error(Some(("joint", &joint)), problem))?;
        let parsed = urdf_rs::read_from_string(&text)
            .map_err(|problem| error(None, RobotProblem::Syntax(problem.to_string())))?;
        let links = Links::new(&parsed)
            .map_err(|(tag, name, problem)| error(Some((tag, &name)), problem))?;
        let mut walk = Walk::new(&links);
        walk.visit(
            links.base,
            None,
            Transform::from_translation(Vector3::zeros()),
        )
        .map_err(|(joint, problem)| error(Some(("joint", &joint)), problem))?;
        if let Some(twin) = walk.twin() {
            let name = twin.to_owned();
            return Err(error(
                Some(("joint", twin)),
                RobotProblem::Duplicate {
                    what: "joint",
                    name,
                },
            ));
        }
        let source = Source::Urdf(path.to_owned());
        let Walk {
            bodies,
            carried,
            base_inertia,
            ..
        } = walk;
        let robot = Robot::new(
            &parsed.name,
            source,
            &parsed.links[links.base].name,
            base_inertia,
            bodies,
        );
        Ok(Self {
            robot,
            carried,
            path: path.to_owned(),
            text,
        })
    }

    /// The robot, if every body of it can exist.
    pub(super) fn checked(self) -> Result<Robot, RobotError> {
        let error = |element: Option<&str>, problem| RobotError {
            path: self.path.clone(),
            line: element.and_then(|link| line_of(&self.text, "link", link)),
            problem,
        };
        let bodies = self.robot.bodies();
        match bodies.len() {
            0 => return Err(error(None, RobotProblem::NothingMoves)),
            n if n > MAX_BODIES => return Err(error(None, RobotProblem::TooMany(n))),
            _ => {}
        }
        for body in bodies {
            let link = body.link_name.clone();
            let problem = match Unphysical::of(&body.inertia) {
                None => continue,
                Some(Unphysical::Mass(0.0)) => RobotProblem::NoMass {
                    link,
                    joint: body.joint_name.clone(),
                },
                Some(fault) => RobotProblem::Unphysical { link, fault },
            };
            return Err(error(Some(&body.link_name), problem));
        }
        Ok(self.robot)
    }
}

/// Line of the element `tag` called `name`.
fn line_of(text: &str, tag: &str, name: &str) -> Option<u32> {
    let document = roxmltree::Document::parse(text).ok()?;
    let mut elements = document.root_element().children();
    let element = elements.find(|e| e.has_tag_name(tag) && e.attribute("name") == Some(name))?;
    Some(document.text_pos_at(element.range().start).row)
}

/// Every joint has a type that exists; `urdf-rs` would not say which has not.
fn check_types(text: &str) -> Result<(), (String, RobotProblem)> {
    let Ok(document) = roxmltree::Document::parse(text) else {
        return Ok(());
    };
    let joints = document
        .root_element()
        .children()
        .filter(|e| e.has_tag_name("joint"));
    for joint in joints {
        let name = joint.attribute("name").unwrap_or_default().to_owned();
        let kind = joint.attribute("type").unwrap_or_default();
        if !TYPES.contains(&kind) {
            let unknown = UnknownName::new("joint type", kind, TYPES);
            return Err((
                name.clone(),
                RobotProblem::UnknownType {
                    joint: name,
                    unknown,
                },
            ));
        }
    }
    Ok(())
}

/// Which joints hang on which link.
struct Links<'a> {
    robot: &'a urdf_rs::Robot,
    index: HashMap<&'a str, usize>,
    children: Vec<Vec<&'a urdf_rs::Joint>>,
    base: usize,
}

/// Tag and name of the element at fault, and the fault.
type Fault = (&'static str, String, RobotProblem);

impl<'a> Links<'a> {
    fn new(robot: &'a urdf_rs::Robot) -> Result<Self, Fault> {
        let mut index = HashMap::new();
        for (n, link) in robot.links.iter().enumerate() {
            if index.insert(link.name.as_str(), n).is_some() {
                let name = link.name.clone();
                return Err((
                    "link",
                    name.clone(),
                    RobotProblem::Duplicate { what: "link", name },
                ));
            }
        }
        let find = |joint: &urdf_rs::Joint, link: &str| {
            index.get(link).copied().ok_or_else(|| {
                let unknown =
                    UnknownName::new("link", link, robot.links.iter().map(|l| l.name.as_str()));
                let joint = joint.name.clone();
                (
                    "joint",
                    joint.clone(),
                    RobotProblem::UnknownLink { joint, unknown },
                )
            })
        };
        let mut children = vec![Vec::new(); robot.links.len()];
        let mut moved_by: Vec<Option<&urdf_rs::Joint>> = vec![None; robot.links.len()];
        let mut names = HashMap::new();
        for joint in &robot.joints {
            if names.insert(joint.name.as_str(), ()).is_some() {
                let name = joint.name.clone();
                return Err((
                    "joint",
                    name.clone(),
                    RobotProblem::Duplicate {
                        what: "joint",
                        name,
                    },
                ));
            }
            let child = find(joint, &joint.child.link)?;
            children[find(joint, &joint.parent.link)?].push(joint);
            if let Some(other) = moved_by[child].replace(joint) {
                let joints = [other.name.clone(), joint.name.clone()];
                let link = joint.child.link.clone();
                return Err((
                    "joint",
                    joint.name.clone(),
                    RobotProblem::Loop { link, joints },
                ));
            }
        }
        let mut roots = (0..robot.links.len()).filter(|&n| moved_by[n].is_none());
        let Some(base) = roots.next() else {
            return Err(("robot", String::new(), RobotProblem::NoBase));
        };
        if let Some(other) = roots.next() {
            let links = [base, other].map(|n| robot.links[n].name.clone());
            return Err(("link", links[1].clone(), RobotProblem::TwoBases { links }));
        }
        let links = Self {
            robot,
            index,
            children,
            base,
        };
        links.all_hang_on_the_base()?;
        Ok(links)
    }

    /// A circle of links beside the tree is reached from nowhere.
    fn all_hang_on_the_base(&self) -> Result<(), Fault> {
        let mut reached = vec![false; self.children.len()];
        let mut open = vec![self.base];
        while let Some(link) = open.pop() {
            reached[link] = true;
            open.extend(
                self.children[link]
                    .iter()
                    .map(|joint| self.index[joint.child.link.as_str()]),
            );
        }
        match reached.iter().position(|&reached| !reached) {
            None => Ok(()),
            Some(link) => {
                let link = self.robot.links[link].name.clone();
                let leads =
                    |joint: &&urdf_rs::Joint| joint.child.link == link || joint.parent.link == link;
                let mut joints = self
                    .robot
                    .joints
                    .iter()
                    .filter(leads)
                    .map(|joint| joint.name.clone());
                let joints = [
                    joints.next().unwrap_or_default(),
                    joints.next().unwrap_or_default(),
                ];
                Err(("link", link.clone(), RobotProblem::Loop { link, joints }))
            }
        }
    }
}

/// The depth-first walk that lumps what is fixed.
struct Walk<'a> {
    links: &'a Links<'a>,
    bodies: Vec<Body>,
    carried: Vec<InertialParameters<f64>>,
    base_inertia: InertialParameters<f64>,
}

impl<'a> Walk<'a> {
    fn new(links: &'a Links<'a>) -> Self {
        Self {
            links,
            bodies: Vec::new(),
            carried: Vec::new(),
            base_inertia: InertialParameters::zero(),
        }
    }

    /// A short name that is also another joint's whole name.
    fn twin(&self) -> Option<&str> {
        let mut names: Vec<&str> = self.bodies.iter().map(|body| body.name.as_str()).collect();
        names.sort_unstable();
        names
            .windows(2)
            .find(|pair| pair[0] == pair[1])
            .map(|pair| pair[0])
    }

    /// Adds a link that is fixed to, or is, `body` (`None`: the base) at `placement`, and all that hangs on it.
    fn visit(
        &mut self,
        link: usize,
        body: Option<usize>,
        placement: Transform<f64>,
    ) -> Result<(), (String, RobotProblem)> {
        let phi = inertia(&self.links.robot.links[link].inertial).in_parent(&placement);
        match body {
            None => self.base_inertia = self.base_inertia + phi,
            Some(b) => {
                self.bodies[b].inertia = self.bodies[b].inertia + phi;
                if self.bodies[b].link_name != self.links.robot.links[link].name {
                    self.carried[b] = self.carried[b] + phi;
                }
            }
        }
        for joint in &self.links.children[link] {
            let child = self.links.index[joint.child.link.as_str()];
            let there = placement.compose(&transform(&joint.origin));
            if joint.joint_type == JointType::Fixed {
                self.visit(child, body, there)?;
            } else {
                let moved =
                    moved(joint, body, there).map_err(|problem| (joint.name.clone(), problem))?;
                self.bodies.push(moved);
                self.carried.push(InertialParameters::zero());
                let own = Transform::from_translation(Vector3::zeros());
                self.visit(child, Some(self.bodies.len() - 1), own)?;
            }
        }
        Ok(())
    }
}

/// The body that a joint moves, without inertia.
fn moved(
    joint: &urdf_rs::Joint,
    parent: Option<usize>,
    placement: Transform<f64>,
) -> Result<Body, RobotProblem> {
    let unsupported = |kind| RobotProblem::UnsupportedType {
        joint: joint.name.clone(),
        kind,
    };
    let kind = match joint.joint_type {
        _ if joint.mimic.is_some() => return Err(unsupported("a mimic of another")),
        JointType::Revolute => JointKind::Revolute,
        JointType::Continuous => JointKind::Continuous,
        JointType::Prismatic => JointKind::Prismatic,
        JointType::Floating => return Err(unsupported("floating")),
        JointType::Planar => return Err(unsupported("planar")),
        JointType::Spherical | JointType::Fixed => return Err(unsupported("spherical")),
    };
    let axis = Vector3::from(*joint.axis.xyz);
    let length = axis.norm();
    if !((length - 1.0).abs() <= AXIS_ROUNDING) {
        return Err(RobotProblem::Axis {
            joint: joint.name.clone(),
            length,
        });
    }
    let stated = |value: f64| if value > 0.0 { value } else { f64::INFINITY };
    let limits = [joint.limit.lower, joint.limit.upper];
    let stops = kind != JointKind::Continuous && limits != [0.0, 0.0];
    let short = joint
        .name
        .strip_suffix("_joint")
        .filter(|name| JOINT_NAMES.contains(name));
    Ok(Body {
        name: short.unwrap_or(&joint.name).to_owned(),
        joint_name: joint.name.clone(),
        link_name: joint.child.link.clone(),
        parent,
        placement,
        kind,
        axis: if length == 1.0 { axis } else { axis / length },
        limits: if stops {
            limits
        } else {
            [f64::NEG_INFINITY, f64::INFINITY]
        },
        effort: stated(joint.limit.effort),
        velocity: stated(joint.limit.velocity),
        inertia: InertialParameters::zero(),
        motor: None,
    })
}

fn transform(pose: &Pose) -> Transform<f64> {
    let [roll, pitch, yaw] = *pose.rpy;
    Transform {
        rotation: *Rotation3::from_euler_angles(roll, pitch, yaw).matrix(),
        translation: Vector3::from(*pose.xyz),
    }
}

/// φ of a link about its own frame.
fn inertia(inertial: &Inertial) -> InertialParameters<f64> {
    let i = &inertial.inertia;
    let about_com = Matrix3::new(
        i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz,
    );
    let at_com = InertialParameters::from_com(inertial.mass.value, Vector3::zeros(), about_com);
    at_com.in_parent(&transform(&inertial.origin))
}
