//! A robot from its URDF.
//!
//! `urdf-rs` reads the values; the XML itself is kept for the lines of errors and, in [`super::export`], for writing into.

mod complete;
mod holds;
mod links;
mod parts;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use proprio_core::inertia::InertialParameters;

use super::{Robot, RobotError, RobotProblem, Source, UnknownName, Unphysical};
use links::Links;
use parts::Parts;

/// The joint types of URDF.
const TYPES: [&str; 6] = [
    "revolute",
    "continuous",
    "prismatic",
    "fixed",
    "floating",
    "planar",
];

/// Elements and attributes whose numbers count, and how many they hold.
const NUMBERS: [(&str, &str, usize); 14] = [
    ("mass", "value", 1),
    ("inertia", "ixx", 1),
    ("inertia", "ixy", 1),
    ("inertia", "ixz", 1),
    ("inertia", "iyy", 1),
    ("inertia", "iyz", 1),
    ("inertia", "izz", 1),
    ("origin", "xyz", 3),
    ("origin", "rpy", 3),
    ("axis", "xyz", 3),
    ("limit", "lower", 1),
    ("limit", "upper", 1),
    ("limit", "effort", 1),
    ("limit", "velocity", 1),
];

/// A robot as its URDF has it, physical or not.
#[derive(Debug)]
pub(super) struct Description {
    /// The text itself.
    pub(super) text: String,
    /// The robot; its bodies may be unphysical.
    pub(super) robot: Robot,
    /// Per body, what the links fixed to the moving one contribute to it.
    pub(super) carried: Vec<InertialParameters<f64>>,
    /// Per body, whether it or what is fixed to it has a shape.
    shapes: Vec<bool>,
    path: PathBuf,
}

impl Description {
    /// Reads a file; the joints named are held at these positions, rad or m.
    pub(super) fn read(path: &Path, held: &[(String, f64)]) -> Result<Self, RobotError> {
        let text = std::fs::read_to_string(path).map_err(|error| RobotError {
            path: path.to_owned(),
            line: None,
            problem: Box::new(RobotProblem::Read(error)),
        })?;
        Self::parse(path, text, held)
    }

    /// The robot of a URDF's text; `path` is what errors call it.
    fn parse(path: &Path, text: String, held: &[(String, f64)]) -> Result<Self, RobotError> {
        let (name, parts) = match parts(&text, held) {
            Ok(parts) => parts,
            Err(fault) => {
                return Err(RobotError {
                    path: path.to_owned(),
                    line: fault.line(&text),
                    problem: Box::new(fault.problem),
                });
            }
        };
        let source = Source::Urdf(path.to_owned());
        let robot = Robot::new(
            &name,
            source,
            &parts.base_link,
            parts.base_inertia,
            parts.bodies,
        )
        .reading(parts.held, held, parts.notes);
        Ok(Self {
            robot,
            carried: parts.carried,
            shapes: parts.shapes,
            path: path.to_owned(),
            text,
        })
    }

    /// The robot, if every body of it can exist, or could with what its links leave out.
    pub(super) fn checked(mut self) -> Result<Robot, RobotError> {
        self.robot = complete::robot(self.robot, &self.shapes);
        let error = |element: Option<&str>, problem| RobotError {
            path: self.path.clone(),
            line: element.and_then(|link| line_of(&self.text, "link", link)),
            problem: Box::new(problem),
        };
        let bodies = self.robot.bodies();
        if bodies.is_empty() {
            return Err(error(None, RobotProblem::NothingMoves));
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

/// What is wrong, and with which element.
struct Fault {
    tag: &'static str,
    name: String,
    problem: RobotProblem,
}

impl Fault {
    fn boxed(tag: &'static str, name: &str, problem: RobotProblem) -> Box<Self> {
        let name = name.to_owned();
        Box::new(Self { tag, name, problem })
    }

    fn line(&self, text: &str) -> Option<u32> {
        match roxmltree::Document::parse(text) {
            Ok(_) => line_of(text, self.tag, &self.name),
            Err(error) => Some(error.pos().row),
        }
    }
}

/// Line of the element `tag` called `name`.
fn line_of(text: &str, tag: &str, name: &str) -> Option<u32> {
    let document = roxmltree::Document::parse(text).ok()?;
    let mut elements = document.root_element().children();
    let element = elements.find(|e| e.has_tag_name(tag) && e.attribute("name") == Some(name))?;
    Some(document.text_pos_at(element.range().start).row)
}

/// The robot's name and what it consists of.
fn parts(text: &str, held: &[(String, f64)]) -> Result<(String, Parts), Box<Fault>> {
    let syntax = |message| Fault::boxed("robot", "", RobotProblem::Syntax(message));
    let document = roxmltree::Document::parse(text).map_err(|e| syntax(e.to_string()))?;
    check_root(&document)?;
    check_types(&document)?;
    check_numbers(&document)?;
    let (skeleton, shapes) = skeleton(&document, text);
    let robot = urdf_rs::read_from_string(&skeleton).map_err(|e| syntax(e.to_string()))?;
    let parts = Parts::of(&Links::new(&robot)?, held, &shapes)?;
    Ok((robot.name, parts))
}

/// The text with links and joints only, without their shapes, every byte in its place; and the links that have shapes.
///
/// What is left out has no part in dynamics, and other programs' extensions and slips in it are not ours to judge.
fn skeleton<'a>(document: &'a roxmltree::Document<'a>, text: &str) -> (String, HashSet<&'a str>) {
    let mut kept = text.as_bytes().to_vec();
    let mut blank = |range: std::ops::Range<usize>| {
        let breaks = |byte: &u8| [b'\n', b'\r'].contains(byte);
        kept[range]
            .iter_mut()
            .filter(|byte| !breaks(byte))
            .for_each(|byte| *byte = b' ');
    };
    let mut shapes = HashSet::new();
    for element in document
        .root_element()
        .children()
        .filter(roxmltree::Node::is_element)
    {
        if !["link", "joint"]
            .iter()
            .any(|tag| element.has_tag_name(*tag))
        {
            blank(element.range());
            continue;
        }
        let is_shape =
            |n: &roxmltree::Node| n.has_tag_name("visual") || n.has_tag_name("collision");
        for shape in element.children().filter(is_shape) {
            blank(shape.range());
            shapes.extend(element.attribute("name"));
        }
    }
    // Whole elements have become blanks, which are text.
    (String::from_utf8_lossy(&kept).into_owned(), shapes)
}

/// The text is a URDF; `urdf-rs` takes any root for a robot without links.
fn check_root(document: &roxmltree::Document) -> Result<(), Box<Fault>> {
    let root = document.root_element().tag_name().name();
    if root == "robot" {
        return Ok(());
    }
    let message = format!("the root element is `{root}`, not `robot`");
    Err(Fault::boxed("robot", "", RobotProblem::Syntax(message)))
}

/// Every number that counts is one; `urdf-rs` would not say which is not, or skip it.
fn check_numbers(document: &roxmltree::Document) -> Result<(), Box<Fault>> {
    for element in document.root_element().children() {
        let what = match element.tag_name().name() {
            "link" => "link",
            "joint" => "joint",
            _ => continue,
        };
        let parts = element
            .children()
            .filter(|n| !n.has_tag_name("visual") && !n.has_tag_name("collision"));
        for part in parts.flat_map(|part| part.descendants()) {
            let numbers = NUMBERS.iter().filter(|(tag, _, _)| part.has_tag_name(*tag));
            for &(tag, attribute, count) in numbers {
                let Some(value) = part.attribute(attribute) else {
                    continue;
                };
                let words: Vec<&str> = value.split_whitespace().collect();
                // No limit may be written as an infinite one.
                let counts = |x: f64| x.is_finite() || (tag == "limit" && !x.is_nan());
                let counts = |word: &&str| word.parse().is_ok_and(counts);
                if words.len() != count || !words.iter().all(counts) {
                    let name = element.attribute("name").unwrap_or_default();
                    let problem = RobotProblem::Numbers {
                        what,
                        name: name.to_owned(),
                        attribute,
                        value: value.to_owned(),
                        count,
                    };
                    return Err(Fault::boxed(what, name, problem));
                }
            }
        }
    }
    Ok(())
}

/// Every joint has a type that exists; `urdf-rs` would not say which has not.
fn check_types(document: &roxmltree::Document) -> Result<(), Box<Fault>> {
    let elements = document.root_element().children();
    for joint in elements.filter(|e| e.has_tag_name("joint")) {
        let name = joint.attribute("name").unwrap_or_default();
        let kind = joint.attribute("type").unwrap_or_default();
        if !TYPES.contains(&kind) {
            let unknown = UnknownName::new("joint type", kind, TYPES);
            let joint = name.to_owned();
            let problem = RobotProblem::UnknownType { joint, unknown };
            return Err(Fault::boxed("joint", name, problem));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GO2: &str = include_str!("../../../tests/oracle/go2.urdf");

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, cases: 200, ..ProptestConfig::default() })]

        /// Words of the file lost, doubled or exchanged: an error or a robot, never a panic.
        #[test]
        fn no_text_makes_it_panic(from in 0..1200usize, to in 0..1200usize, lost in 0..3usize) {
            let mut words: Vec<&str> = GO2.split_inclusive([' ', '"', '\n']).collect();
            let (from, to) = (from % words.len(), to % words.len());
            let word = words[from];
            words.drain(from..(from + lost).min(words.len()));
            words.insert(to.min(words.len()), word);
            let parsed = Description::parse(Path::new("go2.urdf"), words.concat(), &[]);
            if let Ok(robot) = parsed.and_then(Description::checked) {
                prop_assert!(robot.bodies().iter().all(|body| body.inertia.is_physical()));
            }
        }
    }
}
