//! Play between motor and link: the link rests on one side of a gap or on the other, as the torque pushes it.
//!
//! q_link = q − ½ gap s(τ), with s going from −1 to 1 through a line of width `TORQUE`.

use super::{Description, Effect, Form, JointState, Parameter, Prior};
use crate::{Real, go2::Actuator, scalar::real};

/// See the module.
pub(super) struct Backlash;

/// Transmitted torque at which the link has crossed the gap, N m.
const TORQUE: f64 = 0.2;

impl Effect for Backlash {
    const DESCRIPTION: Description = Description {
        name: "backlash",
        torque: "link position = motor position ∓ gap/2",
        form: Form::Motion,
        parameters: &[Parameter::new("gap", "rad", 0.0, 0.2)],
        words: "play between motor and link, crossed when the torque changes sign",
        look_alikes: &["elasticity", "cogging", "coulomb", "delay"],
        separated_by: "slow motion through the pose in which the torque changes sign",
        urdf: None,
        mjcf: None,
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.0,
            std: 0.01,
        }
    }

    fn motion<T: Real>(state: &JointState<T>) -> [T; 2] {
        let half = real::<T>(0.5);
        let x = state.load / real(TORQUE);
        if x.abs() < T::one() {
            [-half * x, -half * state.load_rate / real(TORQUE)]
        } else {
            [-half * x.signum(), T::zero()]
        }
    }
}
