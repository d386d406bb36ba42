//! Which robot a recording is of: a model file, a URDF, or the Go2.

use std::path::PathBuf;

use clap::Args;

use super::{Error, model_or_default};
use crate::model::Robot;

/// The robot whose joints a log names.
#[derive(Debug, Args)]
pub(super) struct RobotArguments {
    /// The robot's model file, by which joints are found [default: the Go2]
    #[arg(short, long, value_name = "MODEL", conflicts_with = "urdf")]
    model: Option<PathBuf>,
    /// The robot's URDF, in place of a model file
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
}

impl RobotArguments {
    /// The robot.
    ///
    /// # Errors
    /// Those of the file.
    pub(super) fn robot(&self) -> Result<Robot, Error> {
        Ok(match &self.urdf {
            Some(urdf) => Robot::from_urdf(urdf)?,
            None => model_or_default(self.model.as_deref(), false)?
                .robot()
                .clone(),
        })
    }
}
