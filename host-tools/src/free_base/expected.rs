//! What a motion is expected to tell before it is played: the windows and the prior of an identification, at a stated noise.

use std::path::Path;

use super::data::Data;
use super::error::FreeBaseError;
use super::stance::Stance;
use super::structure::ModelStructure;
use super::walk::{Played, Walk};
use super::walks::Walks;
use crate::estimate::bounded::inverse;
use crate::model::Model;

/// Standard deviations of all parameters, in the order of the columns.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Expected {
    /// Before any data.
    pub(crate) prior_std: Vec<f64>,
    /// After the motion, if residuals are independent and as large as a fit takes them to be before it knows them ([`FIRST_NOISE`](super::legged::FIRST_NOISE)).
    pub(crate) std: Vec<f64>,
}

/// What a motion on the feet tells.
///
/// # Errors
/// [`FreeBaseError::NoWindows`] for a motion that is too short, [`FreeBaseError::Unsolvable`] if numbers overflow.
pub(crate) fn expected(
    structure: &ModelStructure,
    played: Vec<Played>,
) -> Result<Expected, FreeBaseError> {
    let robot = structure.robot.clone();
    let walk = Walk::of_motion(&played, &robot);
    let stance = Stance::of(&walk, &robot);
    let walks = Walks {
        robot,
        walks: vec![(walk, stance)],
        warnings: Vec::new(),
    };
    of_walks(structure, &walks)
}

/// What the motion of a log tells, whatever the log's own noise.
///
/// # Errors
/// As of an identification.
pub(crate) fn expected_of_log(
    (model, structure): (&Model, &ModelStructure),
    log: &Path,
) -> Result<Expected, FreeBaseError> {
    of_walks(
        structure,
        &Walks::read(&[log.to_owned()], (model, &structure.robot), |_, _| ())?,
    )
}

fn of_walks(structure: &ModelStructure, walks: &Walks) -> Result<Expected, FreeBaseError> {
    let data = Data::unjudged(walks, structure)?;
    let problem = data.problem(structure, structure.robot.first_noise);
    let start = problem.start();
    let prior = problem.prior_root(&start);
    let solution = problem.solve().ok_or(FreeBaseError::Unsolvable)?;
    let norms = |root: nalgebra::DMatrix<f64>| -> Vec<f64> {
        (0..root.nrows()).map(|k| root.row(k).norm()).collect()
    };
    Ok(Expected {
        prior_std: norms(prior),
        std: norms(inverse(&solution.factor)),
    })
}
