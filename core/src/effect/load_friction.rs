//! Friction in proportion to the load, τ = μ |τ| sign(q̇) with the transmitted torque τ: gears, whose teeth rub under load.
//!
//! Where the transmitted torque is taken to be the measured one, it differs by the friction itself, and μ = 1 would make of the
//! measured torque its own explanation. A gear that takes half of the load locks itself when it is driven backwards: no leg has one.

use super::{Description, Effect, Input, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct LoadFriction;

impl Effect for LoadFriction {
    const DESCRIPTION: Description = Description {
        name: "load_friction",
        torque: "μ |transmitted torque| sign(q̇)",
        input: Input::TransmittedTorque,
        parameters: &[Parameter::new("μ", "1", 0.0, 0.5)],
        words: "friction that grows with the transmitted torque: the gear's efficiency",
        look_alikes: &["coulomb", "torque_gain", "asymmetric_coulomb"],
        separated_by: "the same motion with and without a load, or in poses of small and of large gravity torque",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.05,
            std: 0.2,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::rate(state.load.abs() * state.sign()), Term::zero()]
    }
}
