//! The rigid body over many samples.

use proprio_host::dynamics as room;

use crate::error::{self, Error};
use crate::model::Model;

/// Rigid-body dynamics of a model's robot, or of one limb, on its fixed base: τ = H q̈ + C q̇ + g, with the bodies and payloads that the model
/// has. Friction, armature and whatever else drives do is no part of it: [`predict`](crate::predict()) has all of a model.
///
/// Samples lie one after the other, a number per joint in the order of [`joints`](Self::joints): n numbers a sample.
pub struct Dynamics(room::Dynamics);

impl Dynamics {
    /// Of all limbs, or of the one of this name (`FR`).
    ///
    /// # Errors
    /// [`Error::UnknownName`]; [`Error::Dynamics`] if a limb has too many joints.
    pub fn new(model: &Model, limb: Option<&str>) -> Result<Self, Error> {
        let own = room::Dynamics::new(&model.0, limb).map_err(error::dynamics)?;
        Ok(Self(own))
    }

    /// The joints' names: n of them.
    pub fn joints(&self) -> &[String] {
        self.0.joints()
    }

    /// What a regressor's 10 n columns multiply: `m:FR_hip` (kg), `hx`, `hy`, `hz` (kg m), `Ixx` … `Izz` (kg m²), about the joint frame's origin.
    pub fn parameters(&self) -> Vec<String> {
        self.0.parameters()
    }

    /// W with W θ = H q̈ + C q̇ + g, N m per unit of each parameter, into `rows` (samples × n × 10 n), at positions (rad), velocities (rad/s) and
    /// accelerations (rad/s²).
    ///
    /// # Errors
    /// [`Error::Dynamics`] if the lengths do not fit.
    pub fn torque_regressor(&self, motion: [&[f64]; 3], rows: &mut [f64]) -> Result<(), Error> {
        (self.0.torque_regressor(motion, rows)).map_err(error::dynamics)
    }

    /// τ (N m) into `torque` (samples × n), at positions (rad), velocities (rad/s) and accelerations (rad/s²).
    ///
    /// # Errors
    /// [`Error::Dynamics`] if the lengths do not fit.
    pub fn inverse_dynamics(&self, motion: [&[f64]; 3], torque: &mut [f64]) -> Result<(), Error> {
        (self.0.inverse_dynamics(motion, torque)).map_err(error::dynamics)
    }

    /// H (kg m²) at positions (rad) into `inertia` (samples × n × n).
    ///
    /// # Errors
    /// [`Error::Dynamics`] if the lengths do not fit.
    pub fn mass_matrix(&self, q: &[f64], inertia: &mut [f64]) -> Result<(), Error> {
        self.0.mass_matrix(q, inertia).map_err(error::dynamics)
    }

    /// q̈ (rad/s²) of (H + diag(`armature`)) q̈ = τ − C q̇ − g into `acceleration` (samples × n), at positions (rad), velocities (rad/s) and
    /// torques (N m); `armature` is n numbers, kg m².
    ///
    /// # Errors
    /// [`Error::Dynamics`] if the lengths do not fit, or a joint has no inertia to move.
    pub fn forward_dynamics(
        &self,
        motion: [&[f64]; 3],
        armature: &[f64],
        acceleration: &mut [f64],
    ) -> Result<(), Error> {
        (self.0.forward_dynamics(motion, armature, acceleration)).map_err(error::dynamics)
    }
}
