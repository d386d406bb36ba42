//! A robot and what is known of it.

use std::path::Path;

use proprio_host::identify;
use proprio_host::model::{self as room, Robot};

use crate::error::{self, Error};
use crate::recording::Recording;

/// A robot: its bodies, its effects (friction, springs, delays, …) with their values, and how sure these are. A value: every step that
/// changes one gives a new one.
#[derive(Debug, Clone, PartialEq)]
pub struct Model(pub(crate) room::Model);

impl Model {
    /// A Unitree Go2 that hangs or is held, level: the bodies of its URDF, and no effect.
    pub fn go2() -> Self {
        Self(room::Model::default())
    }

    /// Any robot on a fixed base: the bodies of its URDF, and no effect.
    ///
    /// # Errors
    /// [`Error::Model`] if the file cannot be read or states no robot.
    pub fn from_urdf(path: impl AsRef<Path>) -> Result<Self, Error> {
        let robot = Robot::from_urdf(path.as_ref()).map_err(error::robot)?;
        Ok(Self(room::Model::new(robot)))
    }

    /// Reads a model file, as the commands write it.
    ///
    /// # Errors
    /// [`Error::Model`] with file, line and what is wrong, in this file or in the URDF that it names.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let model = room::Model::load(path.as_ref()).map_err(error::model)?;
        Ok(Self(model))
    }

    /// Writes the model file, whole or not at all. The same model gives the same bytes.
    ///
    /// # Errors
    /// [`Error::Write`] if it cannot be written; then what was there stays.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        self.0.save(path.as_ref()).map_err(error::write)
    }

    /// The joints' names, in the model's order.
    pub fn joints(&self) -> impl Iterator<Item = &str> {
        let bodies = self.0.robot().bodies().iter();
        bodies.map(|body| body.name.as_str())
    }

    /// The effects, in the order in which they were added, as [`add`] takes them: `coulomb:FR_hip`.
    pub fn effects(&self) -> impl Iterator<Item = String> {
        let effects = self.0.effects().iter();
        effects.map(|e| format!("{}:{}", e.effect.name(), self.0.joint_name(e.joint)))
    }
}

/// A Go2 with what every drive has at each joint of the legs that were recorded: viscous and Coulomb friction, armature, torque offset. What
/// `proprio identify` fits without a model file.
pub fn plain(recording: &Recording) -> Model {
    Model(identify::plain(&recording.room))
}

/// The model with an effect more: `coulomb:FR_hip`, or `coulomb` at every joint that can have it; `proprio effects` prints the catalogue; or a
/// torque of your own, `FR_calf: c*sin(3*q)*sign(dq)`. It has no value until [`identify`](crate::identify()) gives it one. What the model has
/// already stays as it is.
///
/// # Errors
/// [`Error::UnknownName`] with the nearest name, if there is no such effect or joint; [`Error::Effect`] for a formula that cannot be read.
pub fn add(model: &Model, effect: &str) -> Result<Model, Error> {
    let places = model.0.asked(effect).map_err(error::asked)?;
    let mut model = model.clone();
    model.0.add_last(&places);
    Ok(model)
}
