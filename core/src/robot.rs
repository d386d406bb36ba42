//! What a robot is to the estimator.

/// What a joint's motor and transmission are, on paper.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Actuator {
    /// Motor turns per joint turn.
    pub gear: f64,
    /// Inertia of the rotor about its own axis, kg m².
    pub rotor_inertia: f64,
    /// Largest torque, N m.
    pub effort: f64,
    /// Largest speed, rad/s.
    pub velocity: f64,
}

impl Actuator {
    /// Rotor inertia as the joint feels it: times the gear ratio squared, kg m².
    pub fn armature(&self) -> f64 {
        self.rotor_inertia * self.gear * self.gear
    }
}
