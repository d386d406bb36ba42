//! A robot from its URDF.
//!
//! [`elements`] reads links and joints out of the XML, [`links`] makes a tree of them, [`holds`] says which joints stay where they are, [`parts`]
//! lumps what is fixed into what moves, [`complete`] gives bodies what their links leave out. The text itself is kept for the lines of errors
//! and, in [`super::export`], for writing into; [`text`] reads it in whatever encoding it is.

mod complete;
mod elements;
mod holds;
mod links;
mod parts;
mod text;

use std::path::{Path, PathBuf};

use proprio_core::inertia::InertialParameters;

use super::{Robot, RobotError, RobotProblem, Source, Unphysical};
use elements::Elements;
use links::Links;
use parts::{BaseLink, Parts};

/// A robot as its URDF has it, physical or not.
#[derive(Debug)]
pub(super) struct Description {
    /// The text itself.
    pub(super) text: String,
    /// The robot; its bodies may be unphysical.
    pub(super) robot: Robot,
    /// Per body, what the links fixed to the moving one contribute to it.
    pub(super) carried: Vec<InertialParameters<f64>>,
    /// The base's link and those fixed to it.
    pub(super) base_links: Vec<BaseLink>,
    /// Per body, whether it or what is fixed to it has a shape.
    shapes: Vec<bool>,
    path: PathBuf,
}

impl Robot {
    /// The robot of a URDF file, its root link fixed to the world.
    ///
    /// A joint's name is the URDF's, but `FR_hip_joint` and its eleven siblings are called what the Go2's logs call them:
    /// `FR_hip`. A robot that has all twelve where a Go2 has them, to 5 mm, is taken for a Go2 and gets its motors.
    ///
    /// # Errors
    /// [`RobotError`] with file, line and what is wrong.
    pub fn from_urdf(path: &Path) -> Result<Self, RobotError> {
        Self::from_urdf_held(path, &[])
    }

    /// [`from_urdf`](Self::from_urdf), with joints that do not move: held at these positions, rad or m, what they carry is part
    /// of the body that carries them.
    ///
    /// # Errors
    /// [`RobotError`] with file, line and what is wrong.
    pub fn from_urdf_held(path: &Path, held: &[(String, f64)]) -> Result<Self, RobotError> {
        Description::read(path, held)?.checked()
    }
}

impl Description {
    /// Reads a file; the joints named are held at these positions, rad or m.
    pub(super) fn read(path: &Path, held: &[(String, f64)]) -> Result<Self, RobotError> {
        let text = text::read(path).map_err(|error| RobotError {
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
        .reading(parts.held, held, parts.notes)
        .with_frames(parts.frames);
        Ok(Self {
            robot,
            carried: parts.carried,
            base_links: parts.base_links,
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
    if let Some(fault) = unexpanded(&document) {
        return Err(fault);
    }
    let elements = Elements::of(&document)?;
    if elements.lack_masses() {
        return Err(Fault::boxed("robot", "", RobotProblem::NoMasses));
    }
    let parts = Parts::of(&Links::new(&elements)?, held)?;
    Ok((elements.name.to_owned(), parts))
}

/// What xacro would have replaced: an element of its own, or an expression in what a link or a joint states of dynamics.
fn unexpanded(document: &roxmltree::Document) -> Option<Box<Fault>> {
    let robot = document.root_element();
    let is_call = |node: &roxmltree::Node| {
        let space = node.tag_name().namespace();
        space.is_some_and(|space| space.trim_end_matches('/').ends_with("/xacro"))
    };
    if let Some(call) = robot.descendants().find(is_call) {
        let what = format!("xacro:{}", call.tag_name().name());
        let line = document.text_pos_at(call.range().start).row;
        return Some(Fault::boxed(
            "robot",
            "",
            RobotProblem::Xacro { what, line },
        ));
    }
    let own = |node: &roxmltree::Node| node.has_tag_name("link") || node.has_tag_name("joint");
    let shapes =
        |node: &roxmltree::Node| node.has_tag_name("visual") || node.has_tag_name("collision");
    let elements = robot
        .children()
        .filter(own)
        .flat_map(|node| node.descendants());
    let stated = elements.filter(|node| !node.ancestors().any(|above| shapes(&above)));
    let mut all = stated.flat_map(|node| node.attributes().map(move |attribute| (node, attribute)));
    let (node, attribute) = all.find(|(_, attribute)| attribute.value().contains("${"))?;
    let what = attribute.value().to_owned();
    let line = document.text_pos_at(node.range().start).row;
    Some(Fault::boxed(
        "robot",
        "",
        RobotProblem::Xacro { what, line },
    ))
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
