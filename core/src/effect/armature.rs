//! Armature, τ = Ia q̈: the rotor's inertia times the gear ratio squared; its impulse is Ia Δq̇.

use super::{Description, Effect, JointState, Parameter, Prior, Term};
use crate::{Real, go2::Actuator};

/// See the module.
pub(super) struct Armature;

impl Effect for Armature {
    const DESCRIPTION: Description = Description {
        name: "armature",
        torque: "Ia q̈",
        parameters: &[Parameter {
            symbol: "Ia",
            unit: "kg m^2",
            lower: 0.0,
            upper: f64::INFINITY,
        }],
        words: "inertia of the motor's rotor, felt at the joint times the gear ratio squared",
        look_alikes: &["Ixx", "Iyy", "delay"],
        separated_by: "fast motion of this joint while the joints below it are held at different angles",
        urdf: None,
        mjcf: Some("armature"),
    };

    fn prior(actuator: &Actuator) -> Prior {
        Prior {
            mean: actuator.armature(),
            std: 0.5 * actuator.armature(),
        }
    }

    fn term<T: Real>(state: &JointState<T>) -> Term<T> {
        Term {
            boundary: state.dq,
            rate: T::zero(),
        }
    }
}
