//! Coulomb friction of what turns with a joint and the one that carries it: τ = F_sum sign(q̇_i + q̇_j) on both, and F_diff sign(q̇_j − q̇_i) on the
//! joint, against it on the one before.
//!
//! A gear or a seal that turns with the sum of both velocities rubs against the sum, one that turns with the difference against
//! that (Gautier & Janot's wrist of a Stäubli TX40). Which of the two a drive has is for the data to say.

use super::{
    Description, Effect, EffectKind, Form, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior, Term,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct CoupledCoulomb;

/// The sign of the sum of the speeds (`way` 1) or of the difference (−1): a straight line where it may be noise.
fn sign<T: Real>(own: &JointState<T>, other: &JointState<T>, way: T) -> T {
    let noise = own.speed_noise + other.speed_noise;
    ((own.speed + way * other.speed) / noise)
        .max(-T::one())
        .min(T::one())
}

impl Effect for CoupledCoulomb {
    const DESCRIPTION: Description = Description {
        name: "coupled_coulomb",
        torque: "F_sum sign(q̇ + q̇ of the joint before) + F_diff sign(q̇ − q̇ of the joint before), on both",
        form: Form::Coupled,
        beside: &[EffectKind::Coulomb],
        parameters: &[
            Parameter::new("F_sum", "N m", 0.0, f64::INFINITY),
            Parameter::new("F_diff", "N m", 0.0, f64::INFINITY),
        ],
        words: "Coulomb friction of what turns with this joint and the one before",
        look_alikes: &["coulomb", "coupled_viscous", "load_friction"],
        separated_by: "motion of each of the two joints while the other is held, and of both with and against each other",
        mjcf: Some(Mjcf::SumAndDifference("frictionloss")),
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.1,
            std: 0.5,
        }
    }

    fn coupled<T: Real>(own: &JointState<T>, other: &JointState<T>) -> [Term<T>; MAX_COLUMNS] {
        [T::one(), -T::one()].map(|way| Term::rate(sign(own, other, way)))
    }
}
