//! Which joints hang on which link: a tree, or what keeps it from being one.

use std::collections::{HashMap, HashSet};

use proprio_core::inertia::InertialParameters;

use super::Fault;
use super::elements::{Elements, Joint};
use crate::model::{RobotProblem, UnknownName};

/// The links of a URDF as a tree.
pub(super) struct Links<'a> {
    pub(super) elements: &'a Elements<'a>,
    index: HashMap<&'a str, usize>,
    children: Vec<Vec<&'a Joint<'a>>>,
    /// The link that hangs on nothing.
    pub(super) base: usize,
}

impl<'a> Links<'a> {
    pub(super) fn new(elements: &'a Elements<'a>) -> Result<Self, Box<Fault>> {
        let index = index(elements)?;
        let mut children = vec![Vec::new(); elements.links.len()];
        let mut moved_by: Vec<Option<&Joint>> = vec![None; elements.links.len()];
        let mut names = HashSet::new();
        for joint in &elements.joints {
            if !names.insert(joint.name) {
                return Err(duplicate("joint", joint.name));
            }
            let find = |link: &str| {
                let found = index.get(link).copied();
                found.ok_or_else(|| unknown_link(elements, joint, link))
            };
            children[find(joint.parent)?].push(joint);
            if let Some(other) = moved_by[find(joint.child)?].replace(joint) {
                let joints = [other, joint].map(|joint| joint.name.to_owned());
                return Err(looped(joint.child, joints));
            }
        }
        let mut roots = (0..elements.links.len()).filter(|&n| moved_by[n].is_none());
        let Some(base) = roots.next() else {
            let problem = match elements.links.is_empty() {
                true => RobotProblem::NoLinks,
                false => RobotProblem::NoBase,
            };
            return Err(Fault::boxed("robot", "", problem));
        };
        if let Some(other) = roots.next() {
            let links = [base, other].map(|n| elements.links[n].name.to_owned());
            let problem = RobotProblem::TwoBases { links };
            return Err(Fault::boxed("link", elements.links[other].name, problem));
        }
        let links = Self {
            elements,
            index,
            children,
            base,
        };
        links.all_hang_on_the_base()?;
        Ok(links)
    }

    /// The joints that hang on a link, in the order of the file, and the links they lead to.
    pub(super) fn children(&self, link: usize) -> impl Iterator<Item = (&'a Joint<'a>, usize)> {
        let joints = self.children[link].iter();
        joints.map(|joint| (*joint, self.index[joint.child]))
    }

    /// Whether each link, or anything that hangs on it, has a mass or a moment of inertia.
    pub(super) fn weighty(&self) -> Vec<bool> {
        let links = self.elements.links.iter();
        let mut weighty: Vec<bool> = links
            .map(|link| link.inertia != InertialParameters::zero())
            .collect();
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
        let link = self.elements.links[lost].name;
        let leads = |joint: &&Joint| joint.child == link || joint.parent == link;
        let joints = self.elements.joints.iter().filter(leads);
        let mut names = joints.map(|joint| joint.name.to_owned());
        let mut name = || names.next().unwrap_or_default();
        Err(looped(link, [name(), name()]))
    }
}

fn index<'a>(elements: &Elements<'a>) -> Result<HashMap<&'a str, usize>, Box<Fault>> {
    let mut index = HashMap::new();
    for (n, link) in elements.links.iter().enumerate() {
        if index.insert(link.name, n).is_some() {
            return Err(duplicate("link", link.name));
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

fn unknown_link(elements: &Elements, joint: &Joint, link: &str) -> Box<Fault> {
    let known = elements.links.iter().map(|link| link.name);
    let problem = RobotProblem::UnknownLink {
        joint: joint.name.to_owned(),
        unknown: UnknownName::new("link", link, known),
    };
    Fault::boxed("joint", joint.name, problem)
}
