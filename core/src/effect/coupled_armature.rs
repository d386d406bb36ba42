//! Inertia that couples a joint with the one that carries it, τ = Ic q̈ of the other, on both: a rotor that turns with both joints,
//! as in a wrist whose drives share their bevel gears, or a motor that sits in the body before.
//!
//! A rotor of inertia I (times the gear ratio squared) that turns with q_i + q_j has ½ I (q̇_i + q̇_j)²: I q̈_j at joint i, I q̈_i at joint j
//! and, at each, an [`armature`](super::armature) of its own; where it turns with their difference Ic is negative (Gautier & Janot's
//! wrist of a Stäubli TX40). The impulse is Ic Δq̇ of the other.

use super::{
    Description, Effect, EffectKind, Form, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior, Term,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct CoupledArmature;

impl Effect for CoupledArmature {
    const DESCRIPTION: Description = Description {
        name: "coupled_armature",
        torque: "Ic q̈ of the joint before, and the same there of this joint's",
        form: Form::Coupled,
        beside: &[EffectKind::Armature],
        parameters: &[Parameter::new(
            "Ic",
            "kg m^2",
            f64::NEG_INFINITY,
            f64::INFINITY,
        )],
        words: "a rotor that turns with this joint and the one before",
        look_alikes: &["armature", "payload", "coupled_viscous"],
        separated_by: "fast motion of each of the two joints while the other is held, then of both",
        mjcf: Some(Mjcf::Tendon("armature")),
        ..Description::TORQUE
    };

    fn prior(actuator: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.5 * actuator.armature(),
        }
    }

    fn coupled<T: Real>(_: &JointState<T>, other: &JointState<T>) -> [Term<T>; MAX_COLUMNS] {
        [Term::boundary(other.dq), Term::zero()]
    }
}
