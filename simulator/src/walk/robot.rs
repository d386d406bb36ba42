//! The robot that walks, as its mechanics, its gaits and its sensors need it; and what is known in units of its weight and of its legs' length.
//!
//! Ground, gains and gaits were chosen for a Go2. Those of another robot follow by dynamic similarity: forces grow with its weight, ways with the
//! length of its legs, torques with both, times with the root of the length, as a pendulum's.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DVector, Vector3};
use proprio_core::go2::{self, ACTUATORS, JOINTS_PER_LEG, JointId, LEGS, Leg};
use proprio_core::spatial::Transform;
use proprio_core::tree::{Body, Joint};

use super::WalkError;
use super::mechanics::{MOST_JOINTS, mechanics};
use super::stance::Stance;
use crate::hidden::{HiddenEffect, HiddenJoint, typical, typical_of};
use crate::motion;
use crate::sensors::JointSensors;

/// A Go2's hip, thigh and calf as it stands, where its centre of mass is given, rad.
const STANDING: [f64; JOINTS_PER_LEG] = [0.0, 0.8, -1.6];

/// A joint of a robot that walks.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkJoint {
    index: usize,
    name: Arc<str>,
    carrier: Option<Arc<str>>,
    bears_foot: bool,
}

impl WalkJoint {
    /// Its number, from 0.
    pub fn index(&self) -> usize {
        self.index
    }
}

impl fmt::Display for WalkJoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl HiddenJoint for WalkJoint {
    fn is_carried(&self) -> bool {
        self.carrier.is_some()
    }

    fn limb(&self) -> (Vec<Arc<str>>, usize) {
        let before = self.carrier.iter().cloned();
        let names: Vec<Arc<str>> = before.chain([self.name.clone()]).collect();
        let own = names.len() - 1;
        (names, own)
    }

    fn bears_foot(&self) -> bool {
        self.bears_foot
    }
}

/// A joint's motor and stops.
#[derive(Debug, Clone, PartialEq)]
pub struct JointFacts {
    /// As in logs.
    pub name: String,
    /// Stops, rad or m; infinite without stops.
    pub limits: [f64; 2],
    /// Largest torque, N m, or force, N; infinite if it is not known.
    pub effort: f64,
    /// Motor turns per joint turn.
    pub gear: f64,
    /// Where it is for the whole robot's centre of mass, rad or m.
    pub standing: f64,
}

/// What of a limb touches the ground.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkFoot {
    /// Its column in logs.
    pub name: String,
    /// The body that it is fixed to; the trunk is 0.
    pub body: usize,
    /// Centres of the spheres that touch the ground, in the body's frame, m: one, or the corners of a flat foot.
    pub points: Vec<Vector3<f64>>,
    /// Radius of the spheres, m.
    pub radius: f64,
    /// Whether it has a sensor.
    pub sensor: bool,
}

impl WalkFoot {
    /// The middle of its points in its body, m.
    pub(super) fn middle(&self) -> Vector3<f64> {
        self.points.iter().sum::<Vector3<f64>>() / self.points.len() as f64
    }

    /// Whether it stands on a surface and not on a point.
    pub(super) fn is_flat(&self) -> bool {
        self.points.len() > 2
    }
}

/// A robot of any kind with feet and an IMU.
#[derive(Debug, Clone)]
pub struct WalkRobot {
    /// The trunk first; a parent before its children, a subtree as one range.
    pub(super) bodies: Vec<Body<f64>>,
    joints: Vec<JointFacts>,
    pub(super) feet: Vec<WalkFoot>,
    /// In the trunk.
    pub(super) imu: Transform<f64>,
    /// How many times as heavy as a Go2 it is, and how many times as long its legs are.
    pub(super) heavier: f64,
    pub(super) longer: f64,
    /// How it stands; of a Go2 its gait knows.
    pub(super) stance: Option<Stance>,
    /// Sensors of its joints.
    pub(super) sensors: Vec<JointSensors>,
    /// Middles of the joints' motions.
    pub(super) centre: Vec<f64>,
}

impl WalkRobot {
    /// The Unitree Go2.
    pub fn go2() -> Self {
        let joint = |id: JointId| JointFacts {
            name: id.name().to_owned(),
            limits: go2::position_limits(id.leg())[id.place()],
            effort: ACTUATORS[id.place()].effort,
            gear: ACTUATORS[id.place()].gear,
            standing: STANDING[id.place()],
        };
        let (centre, radius) = go2::FOOT_SPHERE;
        let foot = |leg: Leg| WalkFoot {
            name: leg.name().to_owned(),
            body: JOINTS_PER_LEG * (leg.index() + 1),
            points: vec![Vector3::from(centre)],
            radius,
            sensor: true,
        };
        let joints: Vec<JointFacts> = JointId::all().map(joint).collect();
        Self {
            bodies: go2::free::<f64>().bodies().to_vec(),
            feet: Leg::ALL.into_iter().map(foot).collect(),
            imu: Transform::from_translation(Vector3::from(go2::IMU)),
            heavier: 1.0,
            longer: 1.0,
            stance: None,
            sensors: (0..joints.len()).map(JointSensors::go2).collect(),
            centre: Leg::ALL.into_iter().flat_map(motion::centre).collect(),
            joints,
        }
    }

    /// A robot of these bodies, the trunk first, with a joint for each of the others.
    ///
    /// # Errors
    /// [`WalkError::Robot`] if its bodies cannot be simulated, [`WalkError::Stance`] if it cannot stand.
    pub fn new(
        bodies: Vec<Body<f64>>,
        joints: Vec<JointFacts>,
        feet: Vec<WalkFoot>,
        imu: Transform<f64>,
    ) -> Result<Self, WalkError> {
        if joints.len() > MOST_JOINTS {
            let (joints, most) = (joints.len(), MOST_JOINTS);
            let why = format!("{joints} joints, and at most {most} can walk");
            return Err(WalkError::Robot(why));
        }
        let known = Self::go2();
        let mass = |bodies: &[Body<f64>]| bodies.iter().map(|b| b.inertia.mass()).sum::<f64>();
        let heavier = mass(&bodies) / mass(&known.bodies);
        let longer = reach(&bodies, &feet) / reach(&known.bodies, &known.feet);
        if !(heavier > 0.0 && longer > 0.0) {
            return Err(WalkError::Robot("no mass, or no feet".to_owned()));
        }
        // A motor of its size beside a Go2's hip's: its torque comes in steps that are so many times as large.
        let [q, dq, tau] = JointSensors::go2(0).quanta;
        let own = JointSensors {
            quanta: [q, dq, tau * heavier * longer],
            ..JointSensors::go2(0)
        };
        let mut robot = Self {
            sensors: vec![own; joints.len()],
            centre: Vec::new(),
            bodies,
            joints,
            feet,
            imu,
            heavier,
            longer,
            stance: None,
        };
        if mechanics(&robot.bodies).is_none() {
            let why = "its bodies are no tree of revolute and prismatic joints".to_owned();
            return Err(WalkError::Robot(why));
        }
        let stance = Stance::new(&robot)?;
        robot.centre = stance.q.iter().copied().collect();
        robot.stance = Some(stance);
        Ok(robot)
    }

    /// Its joints.
    pub fn joints(&self) -> Vec<WalkJoint> {
        let own = self.joints.iter().enumerate();
        own.map(|(index, facts)| WalkJoint {
            index,
            name: facts.name.as_str().into(),
            carrier: (self.carrier(index)).map(|carrier| self.joints[carrier].name.as_str().into()),
            bears_foot: self.feet.iter().any(|foot| foot.body == index + 1),
        })
        .collect()
    }

    /// Its feet.
    pub fn feet(&self) -> &[WalkFoot] {
        &self.feet
    }

    /// Friction, rotor inertia and bias of its motors: a Go2's in the middle of what recorded data show, or such as are in proportion.
    pub fn typical(&self) -> Vec<HiddenEffect<WalkJoint>> {
        let joints = self.joints();
        if self.stance.is_none() {
            let own = typical(&Leg::ALL).into_iter();
            return own
                .map(|e| e.moved(|joint| joints[joint.index()].clone()))
                .collect();
        }
        typical_of(&joints, self.heavier, self.longer)
    }

    pub(super) fn facts(&self) -> &[JointFacts] {
        &self.joints
    }

    /// Where its joints are for the whole robot's centre of mass, rad or m.
    pub(super) fn standing(&self) -> DVector<f64> {
        DVector::from_iterator(
            self.joints.len(),
            self.joints.iter().map(|joint| joint.standing),
        )
    }

    /// The joint that carries a joint, if none but the trunk does.
    pub(super) fn carrier(&self, joint: usize) -> Option<usize> {
        self.bodies[joint + 1].parent?.checked_sub(1)
    }

    /// The bodies from one to the trunk, which is not among them.
    pub(super) fn way(&self, body: usize) -> impl Iterator<Item = usize> {
        let above = |b: &usize| self.bodies[*b].parent;
        std::iter::successors(Some(body), above).take_while(|b| *b > 0)
    }

    /// The bodies of each limb, which hangs on the trunk.
    pub(super) fn limbs(&self) -> Vec<Range<usize>> {
        let first = |b: &usize| self.bodies[*b].parent == Some(0);
        let mut starts: Vec<usize> = (1..self.bodies.len()).filter(first).collect();
        starts.push(self.bodies.len());
        starts.windows(2).map(|w| w[0]..w[1]).collect()
    }

    /// A limb's number among its random numbers' streams: those of a Go2's trunk and sensors lie between.
    pub(super) fn stream_of_limb(limb: usize) -> u64 {
        (if limb < LEGS { limb } else { limb + 3 }) as u64
    }
}

/// How far the farthest foot is along its leg from the leg's first joint, m.
fn reach(bodies: &[Body<f64>], feet: &[WalkFoot]) -> f64 {
    let along = |foot: &WalkFoot| {
        let mut length = foot.middle().norm();
        let mut body = foot.body;
        // What hangs on the trunk is placed by the trunk's size, not by the leg's.
        while let Some(parent) = bodies[body].parent.filter(|parent| *parent > 0) {
            length += bodies[body].placement.translation.norm();
            body = parent;
        }
        length
    };
    feet.iter().map(along).fold(0.0, f64::max)
}

/// A body in its parent with its joint at `q`.
pub(super) fn placed(body: &Body<f64>, q: f64) -> Transform<f64> {
    let moved = match body.joint {
        Joint::Revolute(axis) => Transform {
            rotation: *nalgebra::Rotation3::new(axis * q).matrix(),
            translation: Vector3::zeros(),
        },
        Joint::Prismatic(axis) => Transform::from_translation(axis * q),
        Joint::Free => Transform::identity(),
    };
    body.placement.compose(&moved)
}
