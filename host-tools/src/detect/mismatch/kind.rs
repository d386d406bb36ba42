//! What can be wrong between a log and the model, and what follows from it.

use std::path::PathBuf;

use proprio_core::effect::EffectKind;

use super::{CATALOGUE_LATE, KNOWN_UNIT};

/// So far, rad, a base's tilt is the catalogue's to tell: its columns are those of small angles.
const CATALOGUE_TILT: f64 = 0.35;

/// What is wrong between logs and the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Mismatch {
    /// The log of which it is true; all that are given, if none.
    pub log: Option<PathBuf>,
    /// What it is.
    pub kind: MismatchKind,
}

/// What can be wrong between a log and the model.
#[derive(Debug, Clone, PartialEq)]
pub enum MismatchKind {
    /// The torque is zero, or next to nothing beside the model's: of these joints, of all if there are none.
    NoTorque(Vec<String>),
    /// The torque of these joints is the same, N m, whenever they move.
    ConstantTorque(Vec<(String, f64)>),
    /// The velocity of these joints (of all if none) is so many times that of their positions.
    Velocity {
        /// Which joints.
        joints: Vec<String>,
        /// How many times.
        times: f64,
    },
    /// The torque has the other sign at these joints, at all if there are none.
    Sign(Vec<String>),
    /// The torque is so many times the model's at all joints.
    Unit(f64),
    /// The torque is so many times the model's at each joint, where that is known.
    Units(Vec<(String, Option<f64>)>),
    /// The model's torque is so many times the log's at these joints; bodies whose inertia is no body's.
    ModelUnits {
        /// How many times.
        times: f64,
        /// Which joints; all if none.
        joints: Vec<String>,
        /// Each body's mass, kg, and radius of gyration, m.
        bodies: Vec<(String, [f64; 2])>,
    },
    /// The torque lacks gravity at these joints (at all if none), and Coriolis forces too.
    NoGravity {
        /// Which joints.
        joints: Vec<String>,
        /// Whether Coriolis and centrifugal forces are missing as well.
        coriolis: bool,
    },
    /// The base is mounted otherwise.
    Orientation {
        /// The angle between gravity and the model's, rad.
        angle: f64,
        /// Roll, pitch and yaw of the base, as a model file states them, rad.
        rpy: [f64; 3],
    },
    /// A body is so many times as heavy as the model has it.
    Body {
        /// Its link.
        link: String,
        /// Its mass by the model, kg.
        mass: f64,
        /// How many times that it is by the log.
        times: f64,
    },
    /// Position, velocity and torque of these joints count the other way.
    OtherWay(Vec<String>),
    /// The columns of these pairs of joints are exchanged.
    Exchanged(Vec<[String; 2]>),
    /// The columns of these limbs are those of others: recorded as, is.
    Limbs(Vec<[String; 2]>),
    /// The columns of joints are exchanged within each limb: recorded as, is.
    Joints(Vec<[String; 2]>),
    /// The torque is so many seconds late at all joints, or early if negative.
    Late(f64),
    /// What the model gives, with whatever friction, leaves this share of the torque's square at half of the joints, or more.
    NoBetterThanNothing(f64),
    /// Joints on springs that are excited beyond their antiresonances, Hz: no rigid robot.
    Elastic(Vec<(String, f64)>),
    /// The torque of this log is what was commanded.
    Commanded(String),
    /// These two logs hold the same numbers.
    Twice([String; 2]),
}

impl MismatchKind {
    /// Whether nothing can be said of the model before it is mended; else the catalogue has it as an effect, or it is true of some joints.
    pub fn refuses(&self) -> bool {
        match self {
            Self::Late(seconds) => seconds.abs() > CATALOGUE_LATE,
            Self::Orientation { angle, .. } => *angle > CATALOGUE_TILT,
            Self::NoGravity { joints, .. } => joints.is_empty(),
            Self::Body { .. } => false,
            Self::Unit(factor) => !(1.0 / KNOWN_UNIT..=KNOWN_UNIT).contains(factor),
            _ => true,
        }
    }

    /// Whether one body explains it.
    pub(crate) fn is_a_body(&self) -> bool {
        matches!(self, Self::Body { .. })
    }

    /// The effect of the catalogue that all joints share and that does this, if one does.
    pub(crate) fn cause(&self) -> Option<EffectKind> {
        match self {
            Self::Late(_) if !self.refuses() => Some(EffectKind::Delay),
            Self::Orientation { .. } if !self.refuses() => Some(EffectKind::BaseTilt),
            _ => None,
        }
    }
}
