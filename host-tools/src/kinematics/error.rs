//! Why poses are refused: what is wrong, where, the cause that was tested, and what to do.

use std::path::PathBuf;

use crate::log::{LogError, Place};
use crate::model::{Impossible, UnknownName};

/// Poses that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError {
    /// The file cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// A joint, link or key that does not exist.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// A value that the model file cannot hold.
    #[error("the result cannot be written: {0}")]
    Value(#[from] Impossible),
    /// Columns are missing or contradict each other.
    #[error("{}: {what}", .path.display())]
    Columns {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        what: String,
    },
    /// A row is wrong.
    #[error("{}{}: {what}", .path.display(), .place.map(|p| format!(", {p}")).unwrap_or_default())]
    Row {
        /// The file.
        path: PathBuf,
        /// The row.
        place: Option<Place>,
        /// What is wrong.
        what: String,
    },
    /// Places are in another unit: the mount's fit says so.
    #[error(
        "places are in {unit}, not m: the error of the best mount falls from {before:.3e} to {after:.3e} m if they are multiplied by {factor}"
    )]
    LengthUnit {
        /// The unit.
        unit: &'static str,
        /// What to multiply by.
        factor: f64,
        /// Error of the best mount and targets as the file is, m.
        before: f64,
        /// The same with the factor, m.
        after: f64,
    },
    /// Joint positions are in degrees: the mount's fit says so.
    #[error(
        "joint positions are in degrees, not rad: the error of the best mount falls from {before:.1} to {after:.1} mm in rad"
    )]
    Degrees {
        /// Error as the file is, mm.
        before: f64,
        /// In rad, mm.
        after: f64,
    },
    /// Joints are in another order, or turn the other way: the best of all that were tried.
    #[error(
        "joint columns do not fit the model: {what}; the error of the best mount falls from {before:.1} to {after:.1} mm"
    )]
    JointOrder {
        /// Which column is which joint.
        what: String,
        /// Error as the file is, mm.
        before: f64,
        /// With these columns, mm.
        after: f64,
    },
    /// Places are in a left-handed frame: the fit of their mirror image says so.
    #[error(
        "places are in a left-handed frame: two of x/, y/ and z/ are exchanged, or one has the opposite sign; mirrored, the error of the best mount falls from {before:.1} to {after:.1} mm{alike}"
    )]
    Mirrored {
        /// What explains the poses as well: a clause, or nothing.
        alike: String,
        /// Error as the file is, mm.
        before: f64,
        /// Of the mirrored places, mm.
        after: f64,
    },
    /// Nothing that was tried makes model and poses fit.
    #[error(
        "model and poses do not belong together: with the best mount the error is {error:.1} mm where the targets move by {spread:.1} mm; units, left-handed frames, order and signs of joints were tried"
    )]
    Unrelated {
        /// Error with the best mount, mm.
        error: f64,
        /// Root mean square of the places about their mean, mm.
        spread: f64,
    },
    /// Two targets are the same numbers.
    #[error("targets {first} and {second} have the same numbers in all {poses} poses")]
    SameTargets {
        /// One.
        first: String,
        /// The other.
        second: String,
        /// How many poses both have.
        poses: usize,
    },
    /// Places that the robot cannot reach from where the others are.
    #[error(
        "{pose}: target {target} is {distance:.3e} m from the middle of the places; half of them are within {half:.3} m, and the robot's links add up to {reach:.3} m{more}"
    )]
    FarPlace {
        /// The first such pose.
        pose: String,
        /// Its target.
        target: String,
        /// How far, m.
        distance: f64,
        /// Median of all distances, m.
        half: f64,
        /// Sum of the links' lengths, m.
        reach: f64,
        /// How many other places are so: a clause, or nothing.
        more: String,
    },
    /// A target stands still while the joints that carry it move.
    #[error(
        "target {target} is at the same place in all {poses} poses, but the joints that carry it move"
    )]
    StillTarget {
        /// The target.
        target: String,
        /// In how many poses.
        poses: usize,
    },
    /// A joint's column that does not change, and poses that do not fit.
    #[error(
        "`q/{joint}` is {q:.4} in all poses; with the best mount the error is {error:.1} mm where the targets move by {spread:.1} mm"
    )]
    ConstantJoint {
        /// The joint.
        joint: String,
        /// Its position, rad or m.
        q: f64,
        /// Error with the best mount, mm.
        error: f64,
        /// Root mean square of the places about their mean, mm.
        spread: f64,
    },
    /// The robot stood at too few positions.
    #[error("{poses} poses are at {different} different joint positions; {needed} are needed")]
    SamePoses {
        /// Rows read.
        poses: usize,
        /// Different ones.
        different: usize,
        /// Needed.
        needed: usize,
    },
    /// A target or the measuring system moved between two poses.
    #[error(
        "{what} moved by {by:.2} mm between {before} and {after}: the held-out error is {error:.3} mm, {split:.3} mm with the move"
    )]
    Moved {
        /// Target or measuring system.
        what: String,
        /// How far, mm.
        by: f64,
        /// The last pose before.
        before: String,
        /// The first after.
        after: String,
        /// Held-out error without the move, mm.
        error: f64,
        /// With it.
        split: f64,
    },
    /// Too few poses for what is asked.
    #[error("{poses} poses give {rows} numbers; {needed} parameters are to be found{open}")]
    TooFew {
        /// Usable poses.
        poses: usize,
        /// Numbers measured.
        rows: usize,
        /// Parameters.
        needed: usize,
        /// Which would stay open: a sentence that begins with a colon, or nothing.
        open: String,
    },
    /// More poses are outliers than errors of measurement explain.
    #[error("{count} of {poses} poses do not fit the others: {which}")]
    Outliers {
        /// How many.
        count: usize,
        /// Of how many.
        poses: usize,
        /// Which, and by how much.
        which: String,
    },
    /// What is asked cannot be designed.
    #[error("{0}")]
    Design(String),
}

impl CalibrateError {
    /// What the user can do.
    pub fn hint(&self) -> Option<String> {
        let hint = match self {
            Self::Log(_) | Self::Name(_) | Self::Value(_) => return None,
            Self::Columns { .. } => {
                "a file of poses has `q/<joint>` (rad) and of each target `x/<name>`, `y/<name>`, `z/<name>` (m); `proprio simulate --poses 30 -m MODEL` makes one"
            }
            Self::Row { .. } => "correct the line, or delete it",
            Self::LengthUnit { factor, .. } => {
                return Some(format!("multiply the x/, y/ and z/ columns by {factor}"));
            }
            Self::Degrees { .. } => "multiply the q/ columns by π/180 = 0.0174533",
            Self::JointOrder { .. } => {
                "rename the columns accordingly, or correct signs in the file or axes in the URDF"
            }
            Self::Mirrored { .. } => {
                "correct the x/, y/ and z/ columns to a right-handed frame; if they are right, correct the joints' signs or axes"
            }
            Self::Unrelated { .. } => {
                "check that the URDF is this robot's, and in which frame the targets were measured"
            }
            Self::SameTargets { .. } => {
                "delete the columns of one of them: the same numbers twice are no further measurement"
            }
            Self::FarPlace { .. } => {
                "correct the line, or delete it; a target that was not seen has empty cells"
            }
            Self::StillTarget { .. } => {
                "check that the tracker follows the target and that each row has its own place"
            }
            Self::ConstantJoint { .. } => {
                "record the joint's position at each pose; if it is locked, check where"
            }
            Self::SamePoses { .. } => {
                "measure at different joint positions (`proprio excite --poses 30 -m MODEL` chooses them)"
            }
            Self::Moved { .. } => {
                "calibrate the poses before and after separately, or name the target differently from there on"
            }
            Self::TooFew { .. } => {
                "measure more poses (`proprio excite --poses 30 -m MODEL` chooses them), or ask for less: `--only offsets`"
            }
            Self::Outliers { .. } => {
                "measure these poses again, or delete their lines if you know why they are wrong"
            }
            Self::Design(_) => "widen the joint limits, or ask for fewer poses",
        };
        Some(hint.to_owned())
    }
}
