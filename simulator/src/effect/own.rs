//! A torque of the motor's motion that a program brings: what an effect from outside the identification's catalogue is tested with.

use std::fmt;
use std::hash::{Hash, Hasher};

use super::{Description, Effect, JointState};

/// What a joint does at an instant, for a program's own torque.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Time, s.
    pub t: f64,
    /// Position of the motor (joint side), rad.
    pub q: f64,
    /// Velocity of the motor (joint side), rad/s.
    pub dq: f64,
    /// Torque that the gear hands to the link, N m.
    pub transmitted: f64,
    /// Motor temperature, °C.
    pub temperature: f64,
}

/// Torque on the motor's side of the gear, N m, by the parameters' values and what the joint does.
type Torque = dyn Fn(&[f64], &Instant) -> f64 + Sync;

/// Torques on the motors of a joint and of the one that carries it, N m, by the parameters' values and each one's position (rad) and velocity (rad/s).
pub type CoupledTorque = dyn Fn(&[f64], [f64; 2], [f64; 2]) -> [f64; 2] + Sync;

/// An effect from outside this crate. Its name is its identity.
pub struct OwnHidden {
    /// Name, parameters, words.
    pub description: Description,
    /// Its torque.
    pub torque: &'static Torque,
    /// What it is beside that at two joints, of one that couples them.
    pub coupled: Option<&'static CoupledTorque>,
}

impl PartialEq for OwnHidden {
    fn eq(&self, other: &Self) -> bool {
        self.description.name == other.description.name
    }
}

impl Eq for OwnHidden {}

impl Hash for OwnHidden {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.description.name.hash(state);
    }
}

impl fmt::Debug for OwnHidden {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("OwnHidden")
            .field(&self.description.name)
            .finish()
    }
}

/// It at a joint.
pub(super) struct Own {
    torque: &'static Torque,
    coupled: Option<&'static CoupledTorque>,
    values: Vec<f64>,
}

pub(super) fn new(own: &OwnHidden, values: &[f64]) -> Own {
    Own {
        torque: own.torque,
        coupled: own.coupled,
        values: values.to_vec(),
    }
}

impl Effect for Own {
    fn motor_torque(&self, state: &JointState) -> f64 {
        let instant = Instant {
            t: state.t,
            q: state.q,
            dq: state.dq,
            transmitted: state.transmitted,
            temperature: state.temperature,
        };
        (self.torque)(&self.values, &instant)
    }

    fn coupled_torque(&self, own: [f64; 2], carrier: [f64; 2]) -> [f64; 2] {
        let of = |coupled: &CoupledTorque| coupled(&self.values, own, carrier);
        self.coupled.map_or([0.0; 2], of)
    }
}
