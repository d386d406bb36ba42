//! Why there is no design.

use crate::model::UnknownName;

/// Why no motion can be designed.
#[derive(Debug, thiserror::Error)]
pub enum ExciteError {
    /// A number that cannot be: a duration of zero, a limit that is not a number.
    #[error("{what} must be {must}, not {value}")]
    Setting {
        /// Which number.
        what: String,
        /// What it must be.
        must: &'static str,
        /// What it is.
        value: f64,
    },
    /// The pose to begin and end in is beyond a limit already.
    #[error("the pose {pose} is infeasible: {what} is beyond its limit by {percent:.1} %")]
    Pose {
        /// The pose, joint by joint.
        pose: String,
        /// What is limited, with the joint.
        what: String,
        /// By how much, of the limit.
        percent: f64,
    },
    /// A joint that may not move.
    #[error("{joint} cannot move: its {what} limits leave nothing")]
    NoRoom {
        /// Its name.
        joint: String,
        /// Which limits.
        what: &'static str,
    },
    /// No start led within the limits.
    #[error(
        "no motion of {limb} within the limits was found; {what} is what small motions exceed first"
    )]
    NoMotion {
        /// The limb.
        limb: String,
        /// What is limited.
        what: String,
        /// Its joint in the model, if it is one's.
        joint: Option<usize>,
    },
    /// More joints than a design takes.
    #[error("limb {0} has {1} joints; at most {max} can be designed for", max = super::limb::MAX_JOINTS)]
    TooLarge(String, usize),
    /// The trunk's motions are a Go2's.
    #[error("--standing knows a Go2 alone, and the model is another robot's")]
    NotAGo2,
    /// A shape that cannot be.
    #[error("shape {name}: {problem}")]
    Shape {
        /// Its name.
        name: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// No such joint, limb or parameter.
    #[error(transparent)]
    Unknown(#[from] UnknownName),
    /// An effect that a design cannot foresee.
    #[error("no motion can be designed for {0}: its torque is not known before it is measured")]
    NotDesignable(&'static str),
    /// A prior without a body that could have it.
    #[error("the bodies of limb {0} are not physical: no prior can be made of them")]
    Unphysical(String),
}
