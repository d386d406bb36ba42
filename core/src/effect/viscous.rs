//! Viscous friction, τ = Fv q̇: its impulse over a window is Fv Δq, exact however noisy the velocity.

use super::{Description, Effect, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Viscous;

impl Effect for Viscous {
    const DESCRIPTION: Description = Description {
        name: "viscous",
        torque: "Fv q̇",
        plain: true,
        drifts: true,
        parameters: &[Parameter::new("Fv", "N m s/rad", 0.0, f64::INFINITY)],
        words: "friction that grows in proportion to speed (grease, back-EMF not accounted for)",
        look_alikes: &["coulomb", "quadratic_drag", "delay", "velocity_gain"],
        separated_by: "motion at several speeds in both directions: constant-speed sweeps, slow and fast",
        urdf: Some("damping"),
        mjcf: Some(Mjcf::Joint("damping")),
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.1,
            std: 0.5,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::boundary(state.q), Term::zero()]
    }
}
