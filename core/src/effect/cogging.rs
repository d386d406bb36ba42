//! Cogging, τ = A sin(N q + ψ): the rotor prefers some angles. Linear in the two parts As sin(N q) + Ac cos(N q); N, a multiple
//! of the gear ratio, is scanned.

use super::{Description, Effect, Grid, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator, scalar::sin_cos};

/// See the module.
pub(super) struct Cogging;

impl Effect for Cogging {
    const DESCRIPTION: Description = Description {
        name: "cogging",
        torque: "As sin(N q) + Ac cos(N q)",
        parameters: &[
            Parameter::new("As", "N m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("Ac", "N m", f64::NEG_INFINITY, f64::INFINITY),
            Parameter::new("N", "1/rad", 0.0, f64::INFINITY).shape(Grid::Harmonics),
        ],
        words: "a torque periodic in position: magnetic cogging or gear teeth; once per turn of the joint, a counterbalance or weight",
        look_alikes: &["spring", "coulomb", "backlash"],
        separated_by: "very slow motion in both directions over several turns of the rotor",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.0,
                std: 0.3,
            },
            1 => Prior {
                mean: 0.0,
                std: 0.3,
            },
            _ => Prior {
                mean: 38.0,
                std: 100.0,
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, frequency: T) -> [Term<T>; MAX_COLUMNS] {
        let (sin, cos) = sin_cos(frequency * state.q);
        [Term::rate(sin), Term::rate(cos)]
    }
}
