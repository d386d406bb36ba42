//! Joints that do not move of themselves, and where they are held.
//!
//! A joint is held if the user says so; if it mimics another, as a gripper's second finger does (it moves, but with a motor of
//! the other's, and what it carries is light: its motion is left out); if nothing that it moves has mass, so that no torque
//! tells of it; and if it gives the base its freedom, since the base is pinned.

use super::Fault;
use super::elements::{Joint, JointType};
use super::links::Links;
use crate::model::{RobotProblem, UnknownName};

/// Chains of joints that mimic one another are no longer than this.
const MOST_MIMICS: usize = 8;

/// Which joints are held.
pub(super) struct Holds<'a> {
    joints: &'a [Joint<'a>],
    held: &'a [(String, f64)],
    /// Whether a link or anything that hangs on it has a mass or a moment of inertia.
    weighty: Vec<bool>,
}

impl<'a> Holds<'a> {
    pub(super) fn new(links: &Links<'a>, held: &'a [(String, f64)]) -> Result<Self, Box<Fault>> {
        let joints = &links.elements.joints;
        for (name, _) in held {
            if !joints.iter().any(|joint| is_called(joint, name)) {
                let names = joints.iter().map(|joint| joint.name);
                let unknown = UnknownName::new("joint", name, names);
                return Err(Fault::boxed(
                    "joint",
                    name,
                    RobotProblem::UnknownHeld(unknown),
                ));
            }
        }
        Ok(Self {
            joints,
            held,
            weighty: links.weighty(),
        })
    }

    /// Where a joint that leads to `child` is held, if it is, and what the user should know of it.
    pub(super) fn of(&self, joint: &Joint, child: usize) -> Option<(f64, Option<String>)> {
        let name = joint.name;
        if let Some(position) = self.stated(joint) {
            return Some((position, None));
        }
        if let Some(mimic) = &joint.mimic {
            let position = self.position(joint, MOST_MIMICS);
            let note = format!("{name} mimics {}: it is held at {position}", mimic.joint);
            return Some((position, Some(note)));
        }
        if matches!(joint.kind, JointType::Floating | JointType::Planar) {
            let note = format!("{name} gives the base its freedom: it is held, the base is fixed");
            return Some((0.0, Some(note)));
        }
        if !self.weighty[child] {
            let note = format!("{name} moves nothing that has mass: it is left out");
            return Some((0.0, Some(note)));
        }
        None
    }

    /// Where the user holds a joint.
    fn stated(&self, joint: &Joint) -> Option<f64> {
        let found = self.held.iter().find(|(name, _)| is_called(joint, name));
        found.map(|(_, position)| *position)
    }

    /// Where a joint is with all others at zero or where they are held.
    fn position(&self, joint: &Joint, depth: usize) -> f64 {
        if let Some(position) = self.stated(joint) {
            return position;
        }
        let Some(mimic) = &joint.mimic else {
            return 0.0;
        };
        let leader = self.joints.iter().find(|other| other.name == mimic.joint);
        let leader = match leader {
            Some(leader) if depth > 0 => self.position(leader, depth - 1),
            _ => 0.0,
        };
        mimic.multiplier * leader + mimic.offset
    }
}

/// Whether a user means this joint: by its name, or by its name without `_joint`.
fn is_called(joint: &Joint, name: &str) -> bool {
    joint.name == name || joint.name.strip_suffix("_joint") == Some(name)
}
