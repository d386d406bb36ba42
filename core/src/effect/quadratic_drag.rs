//! Drag that grows with the square of the speed, τ = c q̇ |q̇|.

use super::{Description, Effect, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct QuadraticDrag;

impl Effect for QuadraticDrag {
    const DESCRIPTION: Description = Description {
        name: "quadratic_drag",
        torque: "c q̇ |q̇|",
        parameters: &[Parameter::new("c", "N m s^2/rad^2", 0.0, f64::INFINITY)],
        words: "drag that grows with the square of speed (churned oil, air)",
        look_alikes: &["viscous", "delay"],
        separated_by: "sweeps at the highest speeds besides medium ones",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.01,
            std: 0.05,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::rate(state.speed * state.speed.abs()), Term::zero()]
    }
}
