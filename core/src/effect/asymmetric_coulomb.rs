//! Coulomb friction that differs with the direction: τ = F+ where q̇ > 0, −F− where q̇ < 0.
//!
//! The mean of the two is ordinary Coulomb friction; half their difference acts like a constant torque. At rest friction is anywhere
//! between the two: their middle is meant.

use super::{
    Description, Effect, EffectKind, JointState, MAX_COLUMNS, Parameter, Prior, Reach, Term,
};
use crate::{Real, robot::Actuator, scalar::real};

/// See the module.
pub(super) struct AsymmetricCoulomb;

impl Effect for AsymmetricCoulomb {
    const DESCRIPTION: Description = Description {
        name: "asymmetric_coulomb",
        torque: "F+ for q̇ > 0, −F− for q̇ < 0",
        reach: Reach::Joint,
        simpler: Some(EffectKind::Coulomb),
        sum_of: &[EffectKind::Coulomb, EffectKind::Bias],
        parameters: &[
            Parameter::new("F_plus", "N m", 0.0, f64::INFINITY),
            Parameter::new("F_minus", "N m", 0.0, f64::INFINITY),
        ],
        words: "friction of constant size against the motion, larger in one direction (a worn or preloaded gear)",
        look_alikes: &["bias", "coulomb", "asymmetric_viscous", "load_friction"],
        separated_by: "no motion: a bias and Coulomb friction are the same torque, at rest too; without the gear only the bias is left",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.3,
                std: 1.0,
            },
            _ => Prior {
                mean: 0.3,
                std: 1.0,
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        // About a reversal the sign is a mean over time: of it the share of each direction.
        let (sign, half) = (state.sign(), real::<T>(0.5));
        [
            Term::rate(half * (sign + T::one())),
            Term::rate(half * (sign - T::one())),
        ]
    }
}
