//! Kinematics: what poses measured by a tracker, a camera or contacts say of joint frames, zeros, gears and elasticity.
//!
//! A file of poses ([`Poses`]) is a log of another kind, and [`calibrate`] is `diagnose` for kinematics: the same factor, the same held-out rule
//! (by pose), the same words. Values go into the model file ([`crate::model::Kinematics`]).
//!
//! Files beside:
//!
//! - `applied`: what a calibration makes of the model
//! - `chain`: forward kinematics with corrected frames, and what gravity does at each joint
//! - `columns`: residuals of poses and their derivatives
//! - `compare`: poses against a model as it is
//! - `design`: which poses to measure
//! - `error`: why poses are refused
//! - `facts`: what can be wrong with kinematics: the list of candidates and their priors from manufacture
//! - `fit`: a fit of chosen parameters
//! - `gates`: units, order and signs of joints, targets twice: causes tested before a model is blamed
//! - `held_out`: the error of each pose by a fit without it, from one factor
//! - `identifiable`: which combinations of parameters poses can determine at all, and which stay open
//! - `moved`: whether a target moved between two poses
//! - `outliers`: poses that do not fit the others
//! - `poses`: files of poses
//! - `reported`: what a search has found, as data
//! - `result`: `calibrate`, from poses to its report
//! - `search`: the ladder, rung by rung
//! - `start`: where the measuring system and the targets are, from nothing
//! - `text`: the first screen
//! - `witnesses`: springs and gaps that other witnesses have measured too

mod applied;
mod chain;
mod columns;
mod compare;
mod design;
mod error;
mod facts;
mod fit;
mod gates;
mod held_out;
mod identifiable;
mod moved;
mod outliers;
mod poses;
mod reported;
mod result;
mod search;
mod start;
mod text;
mod witnesses;

pub use compare::{ComparedPose, ComparedTarget, PoseComparison, compare_poses};
pub use design::{Expected, PoseDesign, design_poses};
pub use error::CalibrateError;
pub use poses::{Poses, is_pose_file, joint_positions};
pub use result::{
    Alternative, Calibration, Candidate, JointShare, Outlier, PoseError, Step, Value, calibrate,
};
