//! An encoder whose disc turns about another axis than its own: reported = true + s sin q + c cos q, once per turn of the joint.
//!
//! A disc off its axis by e reads e/r too much and too little in turn, r the radius at which it is read. The velocity that comes with the position has the
//! slope of it: reported q̇ = true q̇ (1 + s cos q − c sin q). The rigid body's torque then changes by its slope along position and velocity.

use super::{
    Description, Effect, Enters, Form, JointState, Moved, Parameter, Prior, Reach, Varies,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Eccentricity;

impl Effect for Eccentricity {
    const DESCRIPTION: Description = Description {
        name: "eccentricity",
        torque: "reported position = true + s sin(q) + c cos(q)",
        form: Form::Motion(Moved::OncePerTurn),
        enters: Enters::Derivative,
        reach: Reach::Joint,
        varies: Varies::Slowly,
        parameters: &[
            Parameter::new("s", "rad", -0.2, 0.2),
            Parameter::new("c", "rad", -0.2, 0.2),
        ],
        words: "the encoder's disc is off its axis: the position is wrong once per turn of the joint",
        look_alikes: &["encoder_offset", "velocity_gain", "spring", "cogging"],
        separated_by: "motion over as much of a turn as the joint has, fast and slow",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.02,
        }
    }

    fn motion<T: Real>(state: &JointState<T>, parameter: usize) -> [T; 2] {
        let (sin, cos) = (state.q.sin(), state.q.cos());
        match parameter {
            0 => [-sin, -cos * state.dq],
            _ => [-cos, sin * state.dq],
        }
    }
}
