//! Coulomb friction, τ = Fc sign(q̇).
//!
//! A joint near rest reports noise, whose sign means nothing: see [`JointState::sign`].

use super::{Description, Effect, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Coulomb;

impl Effect for Coulomb {
    const DESCRIPTION: Description = Description {
        name: "coulomb",
        torque: "Fc sign(q̇)",
        plain: true,
        drifts: true,
        parameters: &[Parameter::new("Fc", "N m", 0.0, f64::INFINITY)],
        words: "friction of constant size against the motion (seals, bearings, gear preload)",
        look_alikes: &[
            "viscous",
            "load_friction",
            "stribeck",
            "presliding",
            "asymmetric_coulomb",
        ],
        separated_by: "motion at several speeds in both directions: constant-speed sweeps, slow and fast",
        urdf: Some("friction"),
        mjcf: Some(Mjcf::Joint("frictionloss")),
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.3,
            std: 1.0,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::rate(state.sign()), Term::zero()]
    }
}
