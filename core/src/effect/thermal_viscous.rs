//! Viscous friction that changes with temperature, τ = kT (T − T0) q̇ with T0 = 40 °C: grease thins as it warms.
//!
//! Where no temperature is known it has no column.

use super::{Description, Effect, Input, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator, scalar::real};

/// See the module.
pub(super) struct ThermalViscous;

/// Temperature at which the ordinary viscous friction holds, °C.
const REFERENCE: f64 = 40.0;

impl Effect for ThermalViscous {
    const DESCRIPTION: Description = Description {
        name: "thermal_viscous",
        torque: "kT (T − 40 °C) q̇",
        input: Input::Temperature,
        parameters: &[Parameter::new(
            "kT",
            "N m s/(rad °C)",
            f64::NEG_INFINITY,
            f64::INFINITY,
        )],
        words: "viscous friction that changes as the motor warms",
        look_alikes: &["viscous", "coulomb"],
        separated_by: "the same motion cold and warm: log the warm-up from a cold start",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.005,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        let warmer = state.temperature - real(REFERENCE);
        let known = if warmer.is_finite() {
            warmer
        } else {
            T::zero()
        };
        [Term::rate(known * state.speed), Term::zero()]
    }
}
