//! Viscous friction that levels off with speed, τ = F (1 − exp(−|q̇|/vs)) sign(q̇): harmonic and cycloidal drives, whose lubricant
//! thins as it shears. Slow motion feels F/vs as viscous friction, fast motion F as Coulomb friction; linear in F, the speed vs is
//! scanned.

use super::{
    Description, Effect, EffectKind, Grid, JointState, MAX_COLUMNS, Parameter, Prior, Term,
};
use crate::{Real, robot::Actuator, scalar::exp_minus};

/// See the module.
pub(super) struct SaturatingViscous;

impl Effect for SaturatingViscous {
    const DESCRIPTION: Description = Description {
        name: "saturating_viscous",
        torque: "F (1 − exp(−|q̇|/vs)) sign(q̇)",
        without_shape: Some(EffectKind::Coulomb),
        beside: &[EffectKind::Viscous, EffectKind::Coulomb],
        parameters: &[
            Parameter::new("F", "N m", 0.0, f64::INFINITY),
            Parameter::new("vs", "rad/s", 0.02, 50.0).shape(Grid::SpeedsOfMotion),
        ],
        words: "viscous friction that levels off with speed (harmonic and cycloidal drives)",
        look_alikes: &["viscous", "coulomb", "presliding", "quadratic_drag"],
        separated_by: "sweeps at many speeds, from crawling to the highest",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.2,
                std: 0.5,
            },
            _ => Prior {
                mean: 1.0,
                std: 1.0,
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, speed: T) -> [Term<T>; MAX_COLUMNS] {
        let size = T::one() - exp_minus(state.speed.abs() / speed);
        [Term::rate(size * state.sign()), Term::zero()]
    }
}
