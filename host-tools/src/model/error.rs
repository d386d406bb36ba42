//! Why a model file, or a robot's description, is refused.

use std::path::PathBuf;

use super::{Impossible, UnknownName, Unphysical};

/// A model file is bad.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {problem}", .path.display(), .line.map(|line| format!(", line {line}")).unwrap_or_default())]
pub struct ModelError {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1.
    pub line: Option<usize>,
    /// What is wrong.
    pub problem: Box<ModelProblem>,
}

/// What is wrong with a model file.
#[derive(Debug, thiserror::Error)]
pub enum ModelProblem {
    /// It cannot be read.
    #[error("cannot read the file: {0}")]
    Read(std::io::Error),
    /// It is no TOML, or a value has the wrong type.
    #[error("{0}")]
    Syntax(String),
    /// A key that does not exist.
    #[error(transparent)]
    UnknownKey(UnknownName),
    /// It does not say which version of the format it has.
    #[error("no `format`: this is not a model file")]
    NoFormat,
    /// A newer proprio wrote it.
    #[error("the file has format {found}; this proprio reads up to format {newest}")]
    Newer {
        /// Its format.
        found: i64,
        /// The newest that this version reads.
        newest: i64,
    },
    /// A joint, body or effect that does not exist.
    #[error(transparent)]
    UnknownName(UnknownName),
    /// The robot's description is bad.
    #[error(transparent)]
    Robot(RobotError),
    /// `[robot]` names no robot, or two.
    #[error("[robot] needs either `builtin` or `urdf`")]
    WhichRobot,
    /// `[held]` with a robot that is built in.
    #[error("[held] needs a robot with a `urdf`")]
    HeldWithoutUrdf,
    /// An effect or a value of a joint that `[held]` keeps still.
    #[error(
        "`{joint}` is held ([held]): what does not move has no effects and no values of its own"
    )]
    IsHeld {
        /// The joint.
        joint: String,
    },
    /// `[base]` states two orientations, or one that is none.
    #[error("[base] needs either `rpy` in rad or a `quaternion` w, x, y, z of length 1")]
    Orientation,
    /// An effect is listed twice.
    #[error("{effect}:{joint} is listed twice")]
    Twice {
        /// The effect.
        effect: &'static str,
        /// The joint.
        joint: String,
    },
    /// A standard deviation without a value.
    #[error("{effect}:{joint} has a standard deviation but no value")]
    StdAlone {
        /// The effect.
        effect: &'static str,
        /// The joint.
        joint: String,
    },
    /// A formula that cannot be.
    #[error("{0}")]
    Asked(super::AskedError),
    /// A value that nothing physical has.
    #[error("{what}: {fault}")]
    Impossible {
        /// What has it: "body FR_hip", "the prior of coulomb:FR_hip".
        what: String,
        /// What is wrong with it.
        fault: Impossible,
    },
}

/// A robot's description is bad.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {problem}", .path.display(), .line.map(|line| format!(", line {line}")).unwrap_or_default())]
pub struct RobotError {
    /// The file.
    pub path: PathBuf,
    /// The line of the element at fault.
    pub line: Option<u32>,
    /// What is wrong.
    pub problem: Box<RobotProblem>,
}

/// What is wrong with a robot's description.
#[derive(Debug, thiserror::Error)]
pub enum RobotProblem {
    /// The file cannot be read.
    #[error("cannot read the file: {0}")]
    Read(std::io::Error),
    /// The text is no XML, or no URDF.
    #[error("not a URDF: {0}")]
    Syntax(String),
    /// A link or a joint does not state what it must.
    #[error("{what} `{name}`: its <{part}> has no `{attribute}`, or is missing")]
    Missing {
        /// `link` or `joint`.
        what: &'static str,
        /// Its name.
        name: String,
        /// The element that must state it.
        part: &'static str,
        /// What it must state.
        attribute: &'static str,
    },
    /// A joint's type does not exist.
    #[error("joint `{joint}`: {unknown}")]
    UnknownType {
        /// The joint.
        joint: String,
        /// The type.
        unknown: UnknownName,
    },
    /// A joint's type exists but not here.
    #[error(
        "joint `{joint}` is {kind}: only joints with one degree of freedom of their own are identified"
    )]
    UnsupportedType {
        /// The joint.
        joint: String,
        /// Its type.
        kind: &'static str,
    },
    /// A joint names a link that does not exist.
    #[error("joint `{joint}`: {unknown}")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// The link.
        unknown: UnknownName,
    },
    /// Two joints move one link, or the links go in a circle.
    #[error("the links form a loop through joints `{}` and `{}` at link `{link}`", .joints[0], .joints[1])]
    Loop {
        /// The link.
        link: String,
        /// The two joints.
        joints: [String; 2],
    },
    /// There is nothing in it.
    #[error("the robot has no links")]
    NoLinks,
    /// Every link hangs on another one.
    #[error("the links form a loop: each is the child of another, and none is the base")]
    NoBase,
    /// Links that no joint connects.
    #[error("links `{}` and `{}` both hang on nothing", .links[0], .links[1])]
    TwoBases {
        /// Two of them.
        links: [String; 2],
    },
    /// Two joints or links have one name.
    #[error("two {what}s are called `{name}`")]
    Duplicate {
        /// "joint" or "link".
        what: &'static str,
        /// The name.
        name: String,
    },
    /// An attribute that does not hold the numbers it should.
    #[error("{what} `{name}`: `{attribute}=\"{value}\"` is not {count} finite number{}", if *.count == 1 { "" } else { "s" })]
    Numbers {
        /// "joint" or "link".
        what: &'static str,
        /// Its name.
        name: String,
        /// The attribute.
        attribute: &'static str,
        /// What it holds.
        value: String,
        /// How many numbers it should hold.
        count: usize,
    },
    /// An axis that is not a unit vector.
    #[error("joint `{joint}`: the axis has length {length:.4}, not 1")]
    Axis {
        /// The joint.
        joint: String,
        /// Its length.
        length: f64,
    },
    /// A moving link, with the links fixed to it, has no mass.
    #[error("link `{link}`, moved by joint `{joint}`, has no mass, nor has any link fixed to it")]
    NoMass {
        /// The link.
        link: String,
        /// The joint.
        joint: String,
    },
    /// A moving link, with the links fixed to it, cannot exist.
    #[error("link `{link}` with the links fixed to it is not physical: {fault}")]
    Unphysical {
        /// The link.
        link: String,
        /// Why.
        fault: Unphysical,
    },
    /// A joint that is to be held does not exist.
    #[error(transparent)]
    UnknownHeld(UnknownName),
    /// Xacro has not been run.
    #[error("`{what}` on line {line} is for xacro to replace: this is no finished URDF")]
    Xacro {
        /// What is left of it.
        what: String,
        /// Where.
        line: u32,
    },
    /// Links have shapes, and none a mass.
    #[error(
        "no link has a mass: without <inertial> elements nothing is known of the robot's dynamics"
    )]
    NoMasses,
    /// Nothing moves.
    #[error("no joint moves")]
    NothingMoves,
}
