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
    /// Lines that sampling does not resolve.
    #[error("lines up to {highest:.1} Hz are beyond 0.8 of the Nyquist frequency, {limit:.1} Hz")]
    BeyondNyquist {
        /// The highest that is asked for, Hz.
        highest: f64,
        /// 0.8 of half the sampling rate, Hz.
        limit: f64,
    },
    /// Too few lines to fit a response.
    #[error(
        "{lines} lines from {:.1} to {:.1} Hz with a period of {period} s; {needed} are needed", band[0], band[1]
    )]
    FewLines {
        /// How many.
        lines: usize,
        /// Needed.
        needed: usize,
        /// Lowest and highest, Hz.
        band: [f64; 2],
        /// s.
        period: f64,
    },
    /// Excitation that friction swallows where the joint turns back.
    #[error(
        "the excitation of {joint} is too small to break its friction: its peak is {peak:.2} N m, Coulomb friction {friction:.2} N m"
    )]
    BelowFriction {
        /// The joint.
        joint: String,
        /// N m.
        peak: f64,
        /// N m.
        friction: f64,
    },
    /// Limits that leave too few points.
    #[error(
        "the limits are too narrow: of {tried} points {found} keep them, {wanted} are needed; most exceed {what}"
    )]
    NoPoints {
        /// Within the limits.
        found: usize,
        /// Asked for.
        wanted: usize,
        /// Tried.
        tried: usize,
        /// What most of the others exceed.
        what: String,
    },
    /// Responses that cannot be computed.
    #[error("the model's responses cannot be computed: a joint has no inertia to move")]
    Singular,
    /// The model's dynamics cannot be computed.
    #[error(transparent)]
    Responses(#[from] crate::spectrum::FrfError),
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
