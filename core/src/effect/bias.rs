//! Bias, τ = β: an offset of the torque measurement, or a constant load; its impulse is β Δt.

use super::{Description, Effect, JointState, Parameter, Prior, Term};
use crate::{Real, go2::Actuator};

/// See the module.
pub(super) struct Bias;

impl Effect for Bias {
    const DESCRIPTION: Description = Description {
        name: "bias",
        torque: "β",
        parameters: &[Parameter {
            symbol: "β",
            unit: "N m",
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
        }],
        words: "a constant torque: an offset of the current sensor, or a load that does not move",
        look_alikes: &[
            "asymmetric_coulomb",
            "encoder_offset",
            "base_tilt",
            "hx",
            "hz",
        ],
        separated_by: "slow motion through the whole range, so that gravity's torque changes and the offset does not",
        urdf: None,
        mjcf: None,
    };

    fn prior(_: &Actuator) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.5,
        }
    }

    fn term<T: Real>(_: &JointState<T>) -> Term<T> {
        Term {
            boundary: T::zero(),
            rate: T::one(),
        }
    }
}
