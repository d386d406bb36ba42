//! A spring between motor and link: the link lags the motor by the transmitted torque times the compliance 1/k.
//!
//! The measured position is the motor's; the rigid body moves as the link does, q_link = q − τ/k. The link's own acceleration
//! against the motor adds to τ: near the resonance √(k/M) of the inertia M that the joint turns it goes much farther.

use super::{
    Description, Effect, Enters, Form, Grid, JointState, Moved, Parameter, Prior, Transmission,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Elasticity;

impl Effect for Elasticity {
    const DESCRIPTION: Description = Description {
        name: "elasticity",
        torque: "link position = motor position − torque/k",
        form: Form::Motion(Moved::Link(Transmission::Spring)),
        enters: Enters::Derivative,
        parameters: &[
            Parameter::new("1/k", "rad/(N m)", 0.0, f64::INFINITY).searched(Grid::Resonances)
        ],
        words: "the link deflects against the motor in proportion to the torque (gear, belt, shaft)",
        look_alikes: &["delay", "armature", "backlash"],
        separated_by: "fast motion near the resonance and slow motion under load",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.01,
        }
    }

    fn motion<T: Real>(state: &JointState<T>, _: usize) -> [T; 2] {
        state.give
    }
}
