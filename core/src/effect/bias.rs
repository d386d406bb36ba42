//! Bias, τ = β: an offset of the torque measurement, or a constant load; its impulse is β Δt.

use super::{Description, Effect, JointState, MAX_COLUMNS, Parameter, Prior, Term, Varies};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Bias;

impl Effect for Bias {
    const DESCRIPTION: Description = Description {
        name: "bias",
        torque: "β",
        plain: true,
        drifts: true,
        varies: Varies::Slowly,
        parameters: &[Parameter::new("β", "N m", f64::NEG_INFINITY, f64::INFINITY)],
        words: "a constant torque: an offset of the current sensor, or a load that does not move",
        look_alikes: &[
            "asymmetric_coulomb",
            "encoder_offset",
            "base_tilt",
            "spring",
            "payload",
        ],
        separated_by: "slow motion through the whole range, so that gravity's torque changes and the offset does not",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.5,
        }
    }

    fn terms<T: Real>(_: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::rate(T::one()), Term::zero()]
    }
}
