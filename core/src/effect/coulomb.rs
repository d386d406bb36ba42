//! Coulomb friction, τ = Fc sign(q̇).
//!
//! The sign is a straight line through zero within ±`SPEED`: a joint at rest reports noise of that size, whose sign means
//! nothing, and the line gives it no weight on average.

use super::{Description, Effect, JointState, Parameter, Prior, Term};
use crate::{Real, go2::Actuator, scalar::real};

/// Speed, rad/s, above which the sign of the velocity is trusted: the noise of a standing Go2's velocity (go2.md).
const SPEED: f64 = 0.035;

/// See the module.
pub(super) struct Coulomb;

impl Effect for Coulomb {
    const DESCRIPTION: Description = Description {
        name: "coulomb",
        torque: "Fc sign(q̇)",
        parameters: &[Parameter {
            symbol: "Fc",
            unit: "N m",
            lower: 0.0,
            upper: f64::INFINITY,
        }],
        words: "friction of constant size against the motion (seals, bearings, gear preload)",
        look_alikes: &["viscous", "load_friction", "stribeck"],
        separated_by: "motion at several speeds in both directions: constant-speed sweeps, slow and fast",
        urdf: Some("friction"),
        mjcf: Some("frictionloss"),
    };

    fn prior(_: &Actuator) -> Prior {
        Prior {
            mean: 0.3,
            std: 1.0,
        }
    }

    fn term<T: Real>(state: &JointState<T>) -> Term<T> {
        let sign = (state.dq / real(SPEED)).max(-T::one()).min(T::one());
        Term {
            boundary: T::zero(),
            rate: sign,
        }
    }
}
