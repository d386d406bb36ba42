//! Which joints hang on which link: a tree, or what keeps it from being one.

use std::collections::{HashMap, HashSet};

use super::Fault;
use crate::model::{RobotProblem, UnknownName};

/// The links of a URDF as a tree.
pub(super) struct Links<'a> {
    pub(super) robot: &'a urdf_rs::Robot,
    index: HashMap<&'a str, usize>,
    children: Vec<Vec<&'a urdf_rs::Joint>>,
    /// The link that hangs on nothing.
    pub(super) base: usize,
}

impl<'a> Links<'a> {
    pub(super) fn new(robot: &'a urdf_rs::Robot) -> Result<Self, Box<Fault>> {
        let index = index(robot)?;
        let mut children = vec![Vec::new(); robot.links.len()];
        let mut moved_by: Vec<Option<&urdf_rs::Joint>> = vec![None; robot.links.len()];
        let mut names = HashSet::new();
        for joint in &robot.joints {
            if !names.insert(joint.name.as_str()) {
                return Err(duplicate("joint", &joint.name));
            }
            let find = |link: &str| {
                let found = index.get(link).copied();
                found.ok_or_else(|| unknown_link(robot, joint, link))
            };
            children[find(&joint.parent.link)?].push(joint);
            if let Some(other) = moved_by[find(&joint.child.link)?].replace(joint) {
                let joints = [other, joint].map(|joint| joint.name.clone());
                return Err(looped(&joint.child.link, joints));
            }
        }
        let mut roots = (0..robot.links.len()).filter(|&n| moved_by[n].is_none());
        let Some(base) = roots.next() else {
            let problem = match robot.links.is_empty() {
                true => RobotProblem::NoLinks,
                false => RobotProblem::NoBase,
            };
            return Err(Fault::boxed("robot", "", problem));
        };
        if let Some(other) = roots.next() {
            let links = [base, other].map(|n| robot.links[n].name.clone());
            let problem = RobotProblem::TwoBases { links };
            return Err(Fault::boxed("link", &robot.links[other].name, problem));
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

    /// The joints that hang on a link, in the order of the file, and the links they lead to.
    pub(super) fn children(
        &self,
        link: usize,
    ) -> impl Iterator<Item = (&'a urdf_rs::Joint, usize)> {
        let joints = self.children[link].iter();
        joints.map(|joint| (*joint, self.index[joint.child.link.as_str()]))
    }

    /// Whether each link, or anything that hangs on it, has a mass or a moment of inertia.
    pub(super) fn weighty(&self) -> Vec<bool> {
        let links = self.robot.links.iter();
        let mut weighty: Vec<bool> = links.map(|link| has_inertia(&link.inertial)).collect();
        // Links farther from the base first, each into the one it hangs on.
        let mut order = vec![self.base];
        let mut next = 0;
        while let Some(&link) = order.get(next) {
            order.extend(self.children(link).map(|(_, child)| child));
            next += 1;
        }
        for &link in order.iter().rev() {
            let carries = self.children(link).any(|(_, child)| weighty[child]);
            weighty[link] |= carries;
        }
        weighty
    }

    /// A circle of links beside the tree is reached from nowhere.
    fn all_hang_on_the_base(&self) -> Result<(), Box<Fault>> {
        let mut reached = vec![false; self.children.len()];
        let mut open = vec![self.base];
        while let Some(link) = open.pop() {
            reached[link] = true;
            open.extend(self.children(link).map(|(_, child)| child));
        }
        let Some(lost) = reached.iter().position(|&reached| !reached) else {
            return Ok(());
        };
        let link = &self.robot.links[lost].name;
        let leads =
            |joint: &&urdf_rs::Joint| joint.child.link == *link || joint.parent.link == *link;
        let joints = self.robot.joints.iter().filter(leads);
        let mut names = joints.map(|joint| joint.name.clone());
        let mut name = || names.next().unwrap_or_default();
        Err(looped(link, [name(), name()]))
    }
}

fn has_inertia(inertial: &urdf_rs::Inertial) -> bool {
    let i = &inertial.inertia;
    let numbers = [
        inertial.mass.value,
        i.ixx,
        i.ixy,
        i.ixz,
        i.iyy,
        i.iyz,
        i.izz,
    ];
    numbers.iter().any(|x| *x != 0.0)
}

fn index(robot: &urdf_rs::Robot) -> Result<HashMap<&str, usize>, Box<Fault>> {
    let mut index = HashMap::new();
    for (n, link) in robot.links.iter().enumerate() {
        if index.insert(link.name.as_str(), n).is_some() {
            return Err(duplicate("link", &link.name));
        }
    }
    Ok(index)
}

pub(super) fn duplicate(what: &'static str, name: &str) -> Box<Fault> {
    let problem = RobotProblem::Duplicate {
        what,
        name: name.to_owned(),
    };
    Fault::boxed(what, name, problem)
}

fn looped(link: &str, joints: [String; 2]) -> Box<Fault> {
    let problem = RobotProblem::Loop {
        link: link.to_owned(),
        joints,
    };
    Fault::boxed("link", link, problem)
}

fn unknown_link(robot: &urdf_rs::Robot, joint: &urdf_rs::Joint, link: &str) -> Box<Fault> {
    let known = robot.links.iter().map(|link| link.name.as_str());
    let problem = RobotProblem::UnknownLink {
        joint: joint.name.clone(),
        unknown: UnknownName::new("link", link, known),
    };
    Fault::boxed("joint", &joint.name, problem)
}
