//! A robot that hangs by its base: a tree of named joints and the bodies they move.
//!
//! Links on fixed joints are lumped into the body that carries them, as Pinocchio does when it reads a URDF, so that every
//! joint has one degree of freedom and one body of the same number. Joints are numbered depth first: a parent comes before
//! its children and a subtree is a contiguous range. A pinned base falls apart into *limbs*, the subtrees that hang on it:
//! no limb feels another, so that each is identified on its own.

use std::ops::Range;
use std::path::PathBuf;

use nalgebra::Vector3;
use proprio_core::effect::{EffectKind, Reach};
use proprio_core::go2::{self, ACTUATORS, Actuator, JOINT_NAMES, JOINTS_PER_LEG, Leg};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;
use proprio_core::tree::{self, Joint, Tree};

use super::BASE;
use crate::catalogue;
use crate::name::UnknownName;

/// Where a robot's description comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// The built-in Unitree Go2 ([`proprio_core::go2`]).
    Go2,
    /// A URDF file.
    Urdf(PathBuf),
}

/// How a joint moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// Rotation between stops.
    Revolute,
    /// Rotation without stops.
    Continuous,
    /// Translation.
    Prismatic,
}

/// A motor's rotor and its gear, which a URDF cannot state.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motor {
    /// Motor turns per joint turn (for a prismatic joint rad per m).
    pub gear: f64,
    /// Inertia of the rotor about its own axis, kg m².
    pub rotor_inertia: f64,
}

/// A moving body and the joint that moves it.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Name of joint and body in logs, model files and reports: `FR_hip`.
    pub name: String,
    /// The joint's name in URDF and MJCF: `FR_hip_joint`.
    pub joint_name: String,
    /// The body's name in URDF and MJCF: `FR_hip`.
    pub link_name: String,
    /// The body that carries this one; `None` is the base.
    pub parent: Option<usize>,
    /// Placement of the joint frame in the parent body's joint frame (in the base's frame) at zero position.
    pub placement: Transform<f64>,
    /// How the joint moves.
    pub kind: JointKind,
    /// Unit vector, in the joint frame.
    pub axis: Vector3<f64>,
    /// Lower and upper stop, rad or m; infinite without stops.
    pub limits: [f64; 2],
    /// Largest torque, N m, or force, N; infinite if not stated.
    pub effort: f64,
    /// Largest speed, rad/s or m/s; infinite if not stated.
    pub velocity: f64,
    /// Inertial parameters about the joint frame's origin, as the CAD has them.
    pub inertia: InertialParameters<f64>,
    /// What is known of the motor.
    pub motor: Option<Motor>,
    /// The foot, if the body is a limb's last and something is fixed to it: the origin, in the joint frame, of the fixed link
    /// that is farthest from the joint, m.
    pub foot: Option<Vector3<f64>>,
}

/// Where a link is.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// The link's name in URDF and MJCF.
    pub link: String,
    /// The body that it is, or is fixed to; `None` is the base.
    pub body: Option<usize>,
    /// Its frame in the body's joint frame, or the base's.
    pub placement: Transform<f64>,
    /// Centre (in its own frame) and radius, m, of the sphere that it touches others with, if that is its shape.
    pub sphere: Option<(Vector3<f64>, f64)>,
}

/// A subtree that hangs on the base.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Limb {
    /// What its joints' names have in common, `FR`; the first joint's name if nothing.
    pub name: String,
    /// Its joints and bodies.
    pub bodies: Range<usize>,
}

impl Limb {
    /// The same `effects` at every joint, in the order of the core's θ.
    pub fn with(&self, effects: &[EffectKind]) -> Vec<(usize, EffectKind)> {
        let joints = self.bodies.clone();
        joints
            .flat_map(|joint| effects.iter().map(move |&effect| (joint, effect)))
            .collect()
    }
}

/// What messages leave open: which motor is which, and on which side of the gear it is recorded.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LogConventions {
    /// The joint of each motor, by the motor's number in messages; if not stated, as the maker numbers them.
    pub motors: Option<Vec<usize>>,
    /// Whether messages tell position, velocity, torque of the motor and not of the joint.
    pub at_motor: [bool; 3],
    /// For each motor that a row is stated of: its turns per turn of each joint that it moves.
    pub transmission: Vec<(usize, Vec<(usize, f64)>)>,
}

impl LogConventions {
    /// A motor's turns per turn of joints, if stated.
    pub fn transmission_of(&self, motor: usize) -> Option<&[(usize, f64)]> {
        let found = self.transmission.iter().find(|(of, _)| *of == motor);
        found.map(|(_, ratios)| ratios.as_slice())
    }
}

/// A robot on a fixed base.
#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    name: String,
    source: Source,
    base_link: String,
    base_inertia: InertialParameters<f64>,
    bodies: Vec<Body>,
    subtree_ends: Vec<usize>,
    held: Vec<(String, f64)>,
    stated: Vec<(String, f64)>,
    notes: Vec<String>,
    conventions: LogConventions,
    frames: Vec<Frame>,
}

impl Robot {
    /// The Unitree Go2, joints in SDK order.
    pub fn go2() -> Self {
        let body = |leg: Leg, place: usize| {
            let tree = go2::leg::<f64>(leg);
            let body = &tree.bodies()[place];
            let name = leg.joint_names()[place];
            let axis = match body.joint {
                Joint::Revolute(axis) | Joint::Prismatic(axis) => axis,
                Joint::Free => Vector3::zeros(),
            };
            Body {
                name: name.to_owned(),
                joint_name: format!("{name}_joint"),
                link_name: name.to_owned(),
                parent: (place > 0).then(|| JOINTS_PER_LEG * leg.index() + place - 1),
                placement: body.placement,
                kind: JointKind::Revolute,
                axis,
                limits: go2::position_limits(leg)[place],
                effort: ACTUATORS[place].effort,
                velocity: ACTUATORS[place].velocity,
                inertia: body.inertia,
                motor: Some(go2_motor(place)),
                foot: (place + 1 == JOINTS_PER_LEG).then(|| Vector3::from(go2::FOOT)),
            }
        };
        let legs = Leg::ALL.into_iter();
        let bodies = legs
            .flat_map(|leg| (0..JOINTS_PER_LEG).map(move |place| body(leg, place)))
            .collect();
        let base_inertia = go2::free::<f64>().bodies()[0].inertia;
        Self::new("go2", Source::Go2, "base", base_inertia, bodies).with_frames(go2_frames())
    }

    /// A robot of bodies numbered depth first.
    pub(super) fn new(
        name: &str,
        source: Source,
        base_link: &str,
        base_inertia: InertialParameters<f64>,
        mut bodies: Vec<Body>,
    ) -> Self {
        let mut subtree_ends: Vec<usize> = (1..=bodies.len()).collect();
        for b in (0..bodies.len()).rev() {
            if let Some(parent) = bodies[b].parent {
                subtree_ends[parent] = subtree_ends[parent].max(subtree_ends[b]);
            }
        }
        if are_go2s(&bodies) {
            for body in &mut bodies {
                body.motor = place_on_go2(body).map(|(_, place)| go2_motor(place));
            }
        }
        Self {
            name: name.to_owned(),
            source,
            base_link: base_link.to_owned(),
            base_inertia,
            bodies,
            subtree_ends,
            held: Vec::new(),
            stated: Vec::new(),
            notes: Vec::new(),
            conventions: LogConventions::default(),
            frames: Vec::new(),
        }
    }

    /// The same with where its links are.
    pub(super) fn with_frames(self, frames: Vec<Frame>) -> Self {
        Self { frames, ..self }
    }

    /// Whether its legs are a Go2's, by their joints' names and places to 5 mm.
    pub fn is_go2(&self) -> bool {
        are_go2s(&self.bodies)
    }

    /// Where all links are, those too that are fixed to others.
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }

    /// The same with joints that are held, and what else a user should know of how the description was read.
    pub(super) fn reading(
        self,
        held: Vec<(String, f64)>,
        stated: &[(String, f64)],
        notes: Vec<String>,
    ) -> Self {
        Self {
            held,
            stated: stated.to_vec(),
            notes,
            ..self
        }
    }

    /// Those of the held joints of which the user said so, by the user's names.
    pub(super) fn stated(&self) -> &[(String, f64)] {
        &self.stated
    }

    /// The same with some bodies' inertias completed, and what to tell of it.
    pub(super) fn completed(
        mut self,
        inertias: Vec<(usize, InertialParameters<f64>)>,
        notes: Vec<String>,
    ) -> Self {
        for (body, inertia) in inertias {
            self.bodies[body].inertia = inertia;
        }
        self.notes.extend(notes);
        self
    }

    /// Joints that are held, and where, rad or m: they are no joints of this robot.
    pub fn held(&self) -> &[(String, f64)] {
        &self.held
    }

    /// What was taken otherwise than the description has it, a sentence each: mimic joints, bodies without mass.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// How the robot's logs speak of its joints.
    pub fn conventions(&self) -> &LogConventions {
        &self.conventions
    }

    /// States how the robot's logs speak of its joints.
    pub(super) fn set_conventions(&mut self, conventions: LogConventions) {
        self.conventions = conventions;
    }

    /// The robot's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Where the description comes from.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Name of the link that is fixed to the world.
    pub fn base_link(&self) -> &str {
        &self.base_link
    }

    /// Inertial parameters of the base in its own frame, with the links fixed to it; all zero if it has none.
    pub fn base_inertia(&self) -> &InertialParameters<f64> {
        &self.base_inertia
    }

    /// The moving bodies, each with its joint, depth first.
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }

    /// The bodies that a joint moves: its own and all it carries.
    pub fn subtree(&self, joint: usize) -> Range<usize> {
        joint..self.subtree_ends[joint]
    }

    /// States a joint's motor, or that it is not known.
    pub(super) fn set_motor(&mut self, joint: usize, motor: Option<Motor>) {
        self.bodies[joint].motor = motor;
    }

    /// The index of a joint.
    ///
    /// # Errors
    /// If no joint has this name.
    pub fn joint(&self, name: &str) -> Result<usize, UnknownName> {
        let found = self.bodies.iter().position(|body| body.name == name);
        found.ok_or_else(|| {
            UnknownName::new("joint", name, self.bodies.iter().map(|b| b.name.as_str()))
        })
    }

    /// The effect and joints of `EFFECT[:JOINT[,JOINT…]]`, as users write them.
    ///
    /// # Errors
    /// If no effect has this name, or as [`place`](Self::place) has it.
    pub fn places(&self, text: &str) -> Result<(EffectKind, Vec<usize>), UnknownName> {
        let (effect, joints) = match text.split_once(':') {
            Some((effect, joints)) => (effect, Some(joints)),
            None => (text, None),
        };
        let effect = catalogue::effect_named(effect)
            .ok_or_else(|| UnknownName::new("effect", effect, catalogue::names()))?;
        let places = match joints {
            Some(joints) => {
                let own = joints
                    .split(',')
                    .map(|joint| self.place(effect, Some(joint)));
                own.collect::<Result<Vec<_>, _>>()?.concat()
            }
            None => self.place(effect, None)?,
        };
        Ok((effect, places))
    }

    /// Where an effect can be: the joint called `name`, or all where no name is given; the base for an effect of gravity; only a joint
    /// that another one carries for an effect that couples the two.
    ///
    /// # Errors
    /// If no joint has this name, the effect is the base's and the name is not `base`, or it needs another joint.
    pub fn place(&self, effect: EffectKind, name: Option<&str>) -> Result<Vec<usize>, UnknownName> {
        let description = effect.description();
        let of_base = description.reach == Reach::Robot;
        match name {
            None if of_base => Ok(vec![BASE]),
            Some("base") if description.may_be_shared() => Ok(vec![BASE]),
            Some(name) if of_base => Err(UnknownName::new("joint", name, ["base"])),
            Some(name) => {
                let joint = self.joint(name)?;
                if self.can_have(effect, joint) {
                    return Ok(vec![joint]);
                }
                let carried = (self.bodies.iter()).filter(|body| body.parent.is_some());
                let names = carried.map(|body| body.name.as_str());
                Err(UnknownName::new("joint that another carries", name, names))
            }
            None => Ok((0..self.bodies.len())
                .filter(|&joint| self.can_have(effect, joint))
                .collect()),
        }
    }

    /// Whether a joint can have an effect: what couples it with the joint that carries it needs one, and what sees other joints those.
    fn can_have(&self, effect: EffectKind, joint: usize) -> bool {
        let limb = self.limb_of(joint);
        let sees = |after: &isize| {
            joint
                .checked_add_signed(*after)
                .is_some_and(|n| limb.contains(&n))
        };
        (!effect.couples_with_parent() || self.bodies[joint].parent.is_some())
            && effect.others().iter().all(sees)
    }

    /// The limbs of these names; all of them if none is named, or `all`.
    ///
    /// # Errors
    /// [`UnknownName`].
    pub fn limbs_named(&self, names: &[String]) -> Result<Vec<Limb>, UnknownName> {
        let all = self.limbs();
        if names.is_empty() || (names.len() == 1 && names[0] == "all") {
            return Ok(all);
        }
        for name in names {
            if !all.iter().any(|limb| limb.name == *name) {
                let known = all.iter().map(|limb| limb.name.as_str());
                return Err(UnknownName::new("leg", name, known));
            }
        }
        let asked = |limb: &Limb| names.contains(&limb.name);
        Ok(all.into_iter().filter(asked).collect())
    }

    /// The subtrees that hang on the base.
    pub fn limbs(&self) -> Vec<Limb> {
        let roots = (0..self.bodies.len()).filter(|&b| self.bodies[b].parent.is_none());
        roots
            .map(|root| {
                let bodies = self.subtree(root);
                let name = common_name(&self.bodies[bodies.clone()]);
                Limb { name, bodies }
            })
            .collect()
    }

    /// A limb as the core's tree, with the given joint frames and inertial parameters of the robot's bodies.
    ///
    /// `None` if the limb does not have `B` bodies.
    pub(super) fn limb_tree<const B: usize>(
        &self,
        limb: &Limb,
        own: impl Fn(usize) -> (Transform<f64>, InertialParameters<f64>),
    ) -> Option<Tree<f64, B, B>> {
        let bodies = self.limb_bodies(limb, own);
        Tree::new(bodies.collect::<Vec<_>>().try_into().ok()?).ok()
    }

    /// The same, filled up to `B` bodies by some without mass that hang on the last one; `None` for a limb of more.
    pub(super) fn filled_limb_tree<const B: usize>(
        &self,
        limb: &Limb,
        own: impl Fn(usize) -> (Transform<f64>, InertialParameters<f64>),
    ) -> Option<Tree<f64, B, B>> {
        let mut bodies: Vec<tree::Body<f64>> = self.limb_bodies(limb, own).collect();
        while bodies.len() < B {
            bodies.push(tree::Body {
                parent: bodies.len().checked_sub(1),
                placement: Transform::from_translation(Vector3::zeros()),
                joint: Joint::Revolute(Vector3::z()),
                inertia: InertialParameters::zero(),
            });
        }
        Tree::new(bodies.try_into().ok()?).ok()
    }

    /// A limb's bodies, its first one's parent the base.
    fn limb_bodies(
        &self,
        limb: &Limb,
        own: impl Fn(usize) -> (Transform<f64>, InertialParameters<f64>),
    ) -> impl Iterator<Item = tree::Body<f64>> {
        let first = limb.bodies.start;
        limb.bodies.clone().map(move |b| {
            let body = &self.bodies[b];
            let joint = match body.kind {
                JointKind::Revolute | JointKind::Continuous => Joint::Revolute(body.axis),
                JointKind::Prismatic => Joint::Prismatic(body.axis),
            };
            let (placement, inertia) = own(b);
            tree::Body {
                parent: body.parent.map(|parent| parent - first),
                placement,
                joint,
                inertia,
            }
        })
    }
}

/// The leg of a Go2 that has a joint of this name, and the joint's place in it.
fn place_on_go2(body: &Body) -> Option<(Leg, usize)> {
    let n = JOINT_NAMES.iter().position(|name| *name == body.name)?;
    Some((*Leg::ALL.get(n / JOINTS_PER_LEG)?, n % JOINTS_PER_LEG))
}

/// Whether joints are a Go2's, by name and place: an A1's and a B1's have the same names, and are 10 mm and more elsewhere.
fn are_go2s(bodies: &[Body]) -> bool {
    const NEAR: f64 = 5e-3;
    let is_there = |body: &Body| {
        place_on_go2(body).is_some_and(|(leg, place)| {
            let known = go2::leg::<f64>(leg).bodies()[place].placement.translation;
            (known - body.placement.translation).norm() < NEAR
        })
    };
    let named = |name: &&str| bodies.iter().any(|body| body.name == **name);
    JOINT_NAMES.iter().all(named)
        && bodies.iter().all(|body| {
            // What a Go2 carries has joints of its own.
            place_on_go2(body).is_none() || is_there(body)
        })
}

/// A Go2's links beside those that its joints move: feet, and the IMU.
fn go2_frames() -> Vec<Frame> {
    let frame = |link: &str, body: Option<usize>, place: [f64; 3]| Frame {
        link: link.to_owned(),
        body,
        placement: Transform::from_translation(Vector3::from(place)),
        sphere: None,
    };
    let mut frames = vec![frame("base", None, [0.0; 3]), frame("imu", None, go2::IMU)];
    let (centre, radius) = go2::FOOT_SPHERE;
    for leg in Leg::ALL {
        for (place, name) in leg.joint_names().into_iter().enumerate() {
            let body = JOINTS_PER_LEG * leg.index() + place;
            frames.push(frame(name, Some(body), [0.0; 3]));
        }
        let calf = JOINTS_PER_LEG * leg.index() + JOINTS_PER_LEG - 1;
        let centre = Vector3::from(centre) - Vector3::from(go2::FOOT);
        frames.push(Frame {
            sphere: Some((centre, radius)),
            ..frame(&format!("{}_foot", leg.name()), Some(calf), go2::FOOT)
        });
    }
    frames
}

pub(super) fn go2_motor(place: usize) -> Motor {
    let Actuator {
        gear,
        rotor_inertia,
        ..
    } = ACTUATORS[place];
    Motor {
        gear,
        rotor_inertia,
    }
}

/// The common start of all names without a separator at its end; the first name if there is none.
fn common_name(bodies: &[Body]) -> String {
    let mut names = bodies.iter().map(|body| body.name.as_str());
    let first = names.next().unwrap_or_default();
    let common = names.fold(first, |common, name| {
        let same = common.char_indices().zip(name.chars());
        let end = same.take_while(|((_, a), b)| a == b).last();
        end.map_or("", |((at, c), _)| &common[..at + c.len_utf8()])
    });
    let common = common.trim_end_matches(['_', '-', '.', '/']);
    if common.is_empty() { first } else { common }.to_owned()
}

#[cfg(test)]
mod tests;
