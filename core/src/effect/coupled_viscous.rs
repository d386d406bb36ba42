//! Viscous friction that couples a joint with the one that carries it, τ = Fc q̇ of the other, on both: a seal or a gear that turns
//! with both.
//!
//! Friction Fv (q̇_i + q̇_j) of what turns with their sum acts on both; the share of each joint's own velocity is its
//! [`viscous`](super::viscous) friction. Where it turns with their difference Fc is negative. The impulse is Fc Δq of the other.

use super::{
    Description, Effect, EffectKind, Form, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior, Term,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct CoupledViscous;

impl Effect for CoupledViscous {
    const DESCRIPTION: Description = Description {
        name: "coupled_viscous",
        torque: "Fc q̇ of the joint before, and the same there of this joint's",
        form: Form::Coupled,
        beside: &[EffectKind::Viscous],
        parameters: &[Parameter::new(
            "Fc",
            "N m s/rad",
            f64::NEG_INFINITY,
            f64::INFINITY,
        )],
        words: "viscous friction of what turns with this joint and the one before",
        look_alikes: &["viscous", "coupled_coulomb", "coupled_armature"],
        separated_by: "motion of each of the two joints while the other is held, at several speeds",
        mjcf: Some(Mjcf::Tendon("damping")),
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.2,
        }
    }

    fn coupled<T: Real>(_: &JointState<T>, other: &JointState<T>) -> [Term<T>; MAX_COLUMNS] {
        [Term::boundary(other.q), Term::zero()]
    }
}
