//! Spectrum: what periodic excitation says of springs and dampers between motors and links.
//!
//! [`frf`] is `diagnose` for frequency responses: from the motor side alone, in closed loop, at one point or several. Nonparametric responses
//! come first, with their scatter; then the flexible joint model, linearised about each point, is fitted to their logarithms; links that bend extend
//! it. Values go into the model file as `elasticity` and `link_elasticity`, where motion logs and poses put theirs.
//!
//! Terms: a *line* is a multiple of the inverse period; a *point* is where the robot stands; an *experiment* is some periods of one excitation;
//! a *block* has as many experiments as joints.
//!
//! Files beside:
//!
//! - `bends`: which links or bearings bend, by what is held out
//! - `csv`: responses as a table
//! - `elastic`: whether logs are of an elastic robot beyond its antiresonances
//! - `error`: why logs are refused
//! - `experiments`: spectra of periods, transients left out; what is excited
//! - `fit`: the weighted fit of logarithms, its errors and what is held out
//! - `flexible`: the flexible joint model's response and derivatives
//! - `foreseen`: responses and errors that an experiment will have
//! - `friction`: dry friction out of the torque
//! - `held_out`: errors of what a fit has not used
//! - `layout`: the unknowns of a fit
//! - `linear`: the linear algebra of a fit
//! - `periods`: the period of a log and its periodic stretches
//! - `record`: logs of periodic experiments
//! - `response`: responses by point and block, with noise and scatter
//! - `result`: what `frf` reports
//! - `rigid`: the links behind the springs, by the model
//! - `springs`: springs of a bench and of a model's joints
//! - `start`: where a fit begins
//! - `text`: the first screen

mod bends;
mod csv;
mod elastic;
mod error;
mod experiments;
mod fit;
mod flexible;
mod foreseen;
mod friction;
mod held_out;
mod layout;
mod linear;
mod periods;
mod record;
mod response;
mod result;
mod rigid;
mod springs;
mod start;
mod text;

pub use elastic::mismatches;
pub use error::FrfError;
pub(crate) use experiments::{HIGHEST, LEAST_LINES};
pub(crate) use foreseen::{ExpectedSpring, Foreseen};
pub(crate) use record::even;
pub use result::{
    BendCandidate, Curve, Estimated, Frf, FrfValue, LinkCheck, MeasuredPoint, Mode, frf,
};
pub use text::Did;
