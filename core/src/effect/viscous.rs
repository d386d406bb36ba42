//! Viscous friction, τ = Fv q̇: its impulse over a window is Fv Δq, exact however noisy the velocity.

use super::{Description, Effect, JointState, Parameter, Prior, Term};
use crate::{Real, go2::Actuator};

/// See the module.
pub(super) struct Viscous;

impl Effect for Viscous {
    const DESCRIPTION: Description = Description {
        name: "viscous",
        torque: "Fv q̇",
        parameters: &[Parameter {
            symbol: "Fv",
            unit: "N m s/rad",
            lower: 0.0,
            upper: f64::INFINITY,
        }],
        words: "friction that grows in proportion to speed (grease, back-EMF not accounted for)",
        look_alikes: &["coulomb", "delay"],
        separated_by: "motion at several speeds in both directions: constant-speed sweeps, slow and fast",
        urdf: Some("damping"),
        mjcf: Some("damping"),
    };

    fn prior(_: &Actuator) -> Prior {
        Prior {
            mean: 0.1,
            std: 0.5,
        }
    }

    fn term<T: Real>(state: &JointState<T>) -> Term<T> {
        Term {
            boundary: state.q,
            rate: T::zero(),
        }
    }
}
