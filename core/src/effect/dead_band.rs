//! A motor that gives nothing until the reported torque exceeds a band: τ_reported = τ + b sat(τ/w).
//!
//! The controller has to ask for b before anything comes, in either direction (the dead zone of Tao & Kokotović 1996). How fast
//! what is asked for jumps where the torque changes its sign is w: a dead zone that is exact has w = 0, rounded edges and the noise of the torque
//! widen it. w is scanned.

use super::{Description, Effect, Grid, Input, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct DeadBand;

impl Effect for DeadBand {
    const DESCRIPTION: Description = Description {
        name: "dead_band",
        torque: "reported torque = true + b sat(true/w)",
        input: Input::MotorTorque,
        parameters: &[
            Parameter::new("b", "N m", 0.0, f64::INFINITY),
            Parameter::new("w", "N m", 1e-6, f64::INFINITY).shape(Grid::SmallTorques),
        ],
        words: "the motor gives nothing until more than a band is asked for: the amplifier's dead band",
        look_alikes: &[
            "coulomb",
            "torque_gain",
            "load_friction",
            "saturating_viscous",
        ],
        separated_by: "motion in which the motor brakes: its torque and the velocity change their signs at different times",
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

    fn terms<T: Real>(state: &JointState<T>, width: T) -> [Term<T>; MAX_COLUMNS] {
        let share = (state.tau / width).max(-T::one()).min(T::one());
        [Term::rate(share), Term::zero()]
    }
}
