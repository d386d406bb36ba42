//! Armature, τ = Ia q̈: the rotor's inertia times the gear ratio squared; its impulse is Ia Δq̇.

use super::{Description, Effect, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Armature;

impl Effect for Armature {
    const DESCRIPTION: Description = Description {
        name: "armature",
        torque: "Ia q̈",
        plain: true,
        parameters: &[Parameter::new("Ia", "kg m^2", 0.0, f64::INFINITY)],
        words: "reflected inertia of the motor's rotor: times the gear ratio squared",
        look_alikes: &[
            "payload",
            "delay",
            "elasticity",
            "torque_gain",
            "base_recoil",
        ],
        separated_by: "fast motion of this joint while the joints below it are held at different angles",
        mjcf: Some(Mjcf::Joint("armature")),
        ..Description::TORQUE
    };

    fn prior(actuator: &Actuator, _: usize) -> Prior {
        Prior {
            mean: actuator.armature(),
            std: 0.5 * actuator.armature(),
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::boundary(state.dq), Term::zero()]
    }
}
