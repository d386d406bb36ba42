//! Play between motor and link: the link rests on one side of a gap or on the other, as the torque pushes it, and crosses it
//! when the torque changes its sign.
//!
//! q_link = q + gap x, with x from −½ to ½.

use super::{
    Description, Effect, Enters, Form, Grid, JointState, Moved, Parameter, Prior, Reach,
    Transmission,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Backlash;

impl Effect for Backlash {
    const DESCRIPTION: Description = Description {
        name: "backlash",
        torque: "link position = motor position ∓ gap/2",
        form: Form::Motion(Moved::Link(Transmission::Backlash)),
        enters: Enters::Trial,
        reach: Reach::Joint,
        parameters: &[Parameter::new("gap", "rad", 0.0, 0.2).searched(Grid::Gaps)],
        words: "a gap between motor and link, crossed when the torque changes sign",
        look_alikes: &["elasticity", "cogging", "coulomb", "delay"],
        separated_by: "slow motion through the pose in which the torque changes sign",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.01,
        }
    }

    fn motion<T: Real>(state: &JointState<T>, _: usize) -> [T; 2] {
        state.play
    }
}
