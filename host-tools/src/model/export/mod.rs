//! A model in the files that simulators read.
//!
//! [`urdf`] and [`mjcf`] write the identified bodies and effects into a file of the user's, in which nothing else changes by
//! a byte, or write a whole file. φ is about the joint frame's origin and counts the links fixed to a body; both formats
//! state a link alone, about its centre of mass. So the fixed links keep what the file gives them and the moving link gets
//! the rest, which must itself be physical. Of the links of a base the heaviest one gets it: the root of many files is empty.
//!
//! Files beside:
//!
//! - `edit`: changes to an XML text at the places of its elements; all else stays as it is, byte for byte
//! - `effects`: effects as attributes of joints and tendons, and what a format cannot say
//! - `mjcf_input`: what has to be known of a user's MJCF before inertias are written into it

mod edit;
mod effects;
mod mjcf;
mod mjcf_input;
mod urdf;
mod whole;

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use proprio_core::inertia::InertialParameters;
use proprio_core::spatial::Transform;

use super::{BASE, Model, RobotProblem, UnknownName, Unphysical, about_com, significant};
pub use effects::urdf_attribute;
pub use mjcf::mjcf;
pub use urdf::urdf;

/// Digits of a number in an exported file: enough for torques to 1e-11 of theirs, short where the number is.
const DIGITS: usize = 12;

/// How far (m, or entries of a rotation) a joint of the user's file may be from the model's: files round their numbers.
const PLACEMENT_ROUNDING: f64 = 1e-5;

/// A file for a simulator.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exported {
    /// The file's text.
    pub text: String,
    /// Bodies whose inertial parameters were written; `base` is one.
    pub bodies: Vec<String>,
    /// Joints whose origins were written as calibration corrects them.
    pub origins: Vec<String>,
    /// Effects that were written: `coulomb:FR_hip`.
    pub effects: Vec<String>,
    /// What the format cannot state, in words.
    pub notes: Vec<String>,
}

/// A file that cannot be written into.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {problem}", .path.display(), .line.map(|line| format!(", line {line}")).unwrap_or_default())]
pub struct ExportError {
    /// The user's file.
    pub path: PathBuf,
    /// The line of the element at fault.
    pub line: Option<u32>,
    /// What is wrong.
    pub problem: Box<ExportProblem>,
}

/// Why a file cannot be written into.
#[derive(Debug, thiserror::Error)]
pub enum ExportProblem {
    /// It cannot be read.
    #[error("cannot read the file: {0}")]
    Read(std::io::Error),
    /// It is no XML, or not of the kind asked for.
    #[error("{0}")]
    Syntax(String),
    /// Its robot is bad.
    #[error(transparent)]
    Robot(RobotProblem),
    /// It has no such joint.
    #[error(transparent)]
    Missing(UnknownName),
    /// Its joint stands elsewhere than the model's, so that φ is about another frame.
    #[error("joint `{joint}` has another {what} than the model's: {theirs}, not {ours}")]
    Elsewhere {
        /// The joint.
        joint: String,
        /// "origin", "orientation" or "axis".
        what: &'static str,
        /// What the file has.
        theirs: String,
        /// What the model has.
        ours: String,
    },
    /// Without the links fixed to it, a moving link would not be physical.
    #[error("`{link}` without the links fixed to it is not physical: {fault}")]
    Carried {
        /// The moving link.
        link: String,
        /// Why not.
        fault: Unphysical,
    },
    /// MJCF: the inertia of a body follows from its shapes and is not stated.
    #[error("the inertia of body `{0}`, fixed to a moving one, follows from its geoms")]
    FromShapes(String),
    /// MJCF: a compiler option overrides or changes what would be written.
    #[error("the compiler option `{0}` changes the inertias of the file")]
    Compiler(&'static str),
    /// MJCF: an orientation in another notation than a quaternion.
    #[error("the orientation is given as `{0}`, which is not read")]
    Orientation(&'static str),
    /// MJCF: a body with several joints.
    #[error("body `{0}` has several joints: the model has one body for each")]
    SeveralJoints(String),
}

/// A link's inertia about its centre of mass, in the axes of its frame.
struct Inertial {
    mass: f64,
    com: Vector3<f64>,
    inertia: Matrix3<f64>,
}

impl Inertial {
    fn of(phi: &InertialParameters<f64>) -> Self {
        let (mass, com, inertia) = about_com(phi);
        Self { mass, com, inertia }
    }

    /// xx, xy, xz, yy, yz, zz.
    fn six(&self) -> [f64; 6] {
        let i = &self.inertia;
        [
            i[(0, 0)],
            i[(0, 1)],
            i[(0, 2)],
            i[(1, 1)],
            i[(1, 2)],
            i[(2, 2)],
        ]
    }

    /// As MJCF's `fullinertia` orders them: xx, yy, zz, xy, xz, yz.
    fn full(&self) -> [f64; 6] {
        let [xx, xy, xz, yy, yz, zz] = self.six();
        [xx, yy, zz, xy, xz, yz]
    }
}

/// A number as it stands in a file.
fn number(value: f64) -> String {
    // Not "-0".
    let text = format!("{:?}", significant(value, DIGITS) + 0.0);
    text.strip_suffix(".0").unwrap_or(&text).to_owned()
}

/// Numbers with spaces between them.
fn numbers(values: impl IntoIterator<Item = f64>) -> String {
    let texts: Vec<String> = values.into_iter().map(number).collect();
    texts.join(" ")
}

/// Text as it stands in an attribute.
fn escaped(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;");
    text.replace('"', "&quot;")
}

/// Bodies of a model, the base among them, that `has` picks, by their names.
fn bodies(model: &Model, has: impl Fn(usize) -> bool) -> Vec<String> {
    let all = std::iter::once(BASE).chain(0..model.robot().bodies().len());
    all.filter(|&b| has(b))
        .map(|b| model.joint_name(b).to_owned())
        .collect()
}

/// Bodies that a whole file has: those with a mass, which a base may lack.
fn with_mass(model: &Model) -> Vec<String> {
    bodies(model, |b| model.inertia(b).mass() > 0.0)
}

/// What is left of `whole` without what it carries.
fn without(
    whole: &InertialParameters<f64>,
    carried: &InertialParameters<f64>,
) -> Result<InertialParameters<f64>, Unphysical> {
    let own = InertialParameters(whole.0 - carried.0);
    match Unphysical::of(&own) {
        None => Ok(own),
        Some(fault) => Err(fault),
    }
}

/// Whether a joint of the user's file stands where the model's does.
fn same_place(
    joint: &str,
    theirs: &Transform<f64>,
    ours: &Transform<f64>,
) -> Result<(), ExportProblem> {
    let elsewhere = |what, theirs, ours| {
        Err(ExportProblem::Elsewhere {
            joint: joint.to_owned(),
            what,
            theirs,
            ours,
        })
    };
    if (theirs.translation - ours.translation).amax() > PLACEMENT_ROUNDING {
        let text = |t: &Transform<f64>| numbers(t.translation.iter().map(|x| significant(*x, 6)));
        return elsewhere("origin", text(theirs), text(ours));
    }
    if (theirs.rotation - ours.rotation).amax() > PLACEMENT_ROUNDING {
        let text = |t: &Transform<f64>| {
            let (r, p, y) = nalgebra::Rotation3::from_matrix_unchecked(t.rotation).euler_angles();
            format!("rpy {}", numbers([r, p, y].map(|x| significant(x, 6))))
        };
        return elsewhere("orientation", text(theirs), text(ours));
    }
    Ok(())
}

/// Whether a joint's axis is the model's.
fn same_axis(joint: &str, theirs: &Vector3<f64>, ours: &Vector3<f64>) -> Result<(), ExportProblem> {
    if (theirs - ours).amax() <= PLACEMENT_ROUNDING {
        return Ok(());
    }
    let text = |axis: &Vector3<f64>| numbers(axis.iter().map(|x| significant(*x, 6)));
    let (theirs, ours) = (text(theirs), text(ours));
    Err(ExportProblem::Elsewhere {
        joint: joint.to_owned(),
        what: "axis",
        theirs,
        ours,
    })
}

/// An error without a line.
fn error(path: &Path, problem: ExportProblem) -> ExportError {
    ExportError {
        path: path.to_owned(),
        line: None,
        problem: Box::new(problem),
    }
}
