//! Hysteresis of a gear that gives way: the torque under which link and motor turn against each other by x depends on the way that x came.
//!
//! ```text
//! τ = k x + f z,   dz/dx = (1 − z sgn ẋ)/w
//! ```
//!
//! with the spring of `elasticity`, and z, from −1 to 1, the state of friction inside the gear (Dahl 1968; of harmonic drives Ruderman &
//! Bertram 2012, *IEEE/ASME Trans. Mechatronics* 17:1142). It hardly shows in a torque: an encoder at the link tells it.

use super::{Description, Effect, Enters, Form, Moved, Parameter, Prior, Transmission};
use crate::robot::Actuator;

/// See the module.
pub(super) struct ElasticHysteresis;

impl Effect for ElasticHysteresis {
    const DESCRIPTION: Description = Description {
        name: "elastic_hysteresis",
        torque: "transmitted torque = k (motor − link) + f z, z by the way that came",
        form: Form::Motion(Moved::Link(Transmission::SpringFriction)),
        enters: Enters::Positions,
        parameters: &[
            Parameter::new("f", "N m", 0.0, f64::INFINITY),
            Parameter::new("w", "rad", 0.0, f64::INFINITY),
        ],
        words: "the gear deflects otherwise under a growing torque than under a falling one (friction inside the gear)",
        look_alikes: &["elasticity", "backlash"],
        separated_by: "a second encoder at the link (q_link)",
        ..Description::TORQUE
    };

    fn prior(actuator: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.0,
                std: 0.1 * actuator.effort,
            },
            _ => Prior {
                mean: 0.002,
                std: 0.01,
            },
        }
    }
}
