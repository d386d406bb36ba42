//! The Stribeck effect, τ = Fs exp(−(q̇/vs)²) sign(q̇): what friction at low speed has beyond that at high speed
//! (Armstrong-Hélouvry, Dupont & Canudas de Wit 1994). Linear in Fs; the speed vs is scanned.

use super::{Description, Effect, Grid, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator, scalar::exp_minus};

/// See the module.
pub(super) struct Stribeck;

impl Effect for Stribeck {
    const DESCRIPTION: Description = Description {
        name: "stribeck",
        torque: "Fs exp(−(q̇/vs)²) sign(q̇)",
        parameters: &[
            Parameter::new("Fs", "N m", 0.0, f64::INFINITY),
            Parameter::new("vs", "rad/s", 0.005, 2.0).shape(Grid::SpeedsAboveNoise),
        ],
        words: "friction that is larger near standstill than in motion (boundary lubrication)",
        look_alikes: &["coulomb", "presliding", "viscous", "load_friction"],
        separated_by: "many slow reversals and slow sweeps, at 0.01 to 0.3 rad/s",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.2,
                std: 0.5,
            },
            _ => Prior {
                mean: 0.1,
                std: 0.1,
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, speed: T) -> [Term<T>; MAX_COLUMNS] {
        let x = state.speed / speed;
        [Term::rate(exp_minus(x * x) * state.sign()), Term::zero()]
    }
}
