//! Viscous friction that differs with the direction, beside [`viscous`](super::viscous): τ = d |q̇|.
//!
//! With F+ q̇ for q̇ > 0 and F− q̇ for q̇ < 0, Fv = (F+ + F−)/2 is ordinary viscous friction and d = (F+ − F−)/2 what is told here:
//! one column, orthogonal to that of Fv in any motion that goes to and fro alike. Neither friction is negative while |d| ≤ Fv,
//! which is no bound of d alone: an effect knows nothing of another. d is free, then; a larger one means that the model lacks
//! something else.

use super::{Description, Effect, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct AsymmetricViscous;

impl Effect for AsymmetricViscous {
    const DESCRIPTION: Description = Description {
        name: "asymmetric_viscous",
        torque: "d |q̇|",
        parameters: &[Parameter::new(
            "d",
            "N m s/rad",
            f64::NEG_INFINITY,
            f64::INFINITY,
        )],
        words: "viscous friction that differs with direction: d more forwards, d less backwards (|d| ≤ Fv)",
        look_alikes: &["asymmetric_coulomb", "bias", "viscous", "quadratic_drag"],
        separated_by: "sweeps in both directions over the same range, each at several speeds",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.2,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::rate(state.speed * state.sign()), Term::zero()]
    }
}
