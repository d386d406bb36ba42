//! A drive that gives less than it reports: the true torque is the reported one within ± limit.
//!
//! From the motion alone only the true torque can be told, and it never exceeds the limit: where it is there, what is reported is
//! larger by an excess that the motion does not show. So the column is where the limit acts, and its coefficient the mean excess;
//! the limit is scanned. A share of [`EDGE`] below the limit counts in part, as far as a model of the torque can tell.

use super::{
    Description, Effect, Enters, Grid, Input, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior,
    Term, Varies,
};
use crate::{Real, robot::Actuator, scalar::real};

/// Share of the limit from which on a torque may be at it.
const EDGE: f64 = 0.05;

/// See the module.
pub(super) struct Saturation;

impl Effect for Saturation {
    const DESCRIPTION: Description = Description {
        name: "saturation",
        torque: "true torque = reported within ± limit",
        enters: Enters::Limit,
        input: Input::MotorTorque,
        varies: Varies::Slowly,
        parameters: &[
            Parameter::new("limit", "N m", 0.0, f64::INFINITY).shape(Grid::Torques),
            Parameter::new("excess", "N m", 0.0, f64::INFINITY),
        ],
        words: "the motor gives less than it reports beyond a limit (current limit, voltage)",
        look_alikes: &["torque_gain", "load_friction"],
        separated_by: "the same motion slower, or with smaller loads: below the limit all is well",
        mjcf: Some(Mjcf::Range("actuatorfrcrange")),
        ..Description::TORQUE
    };

    fn prior(actuator: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 20.0,
                std: 20.0,
            },
            // A controller may ask for as much again as the drive gives.
            _ => Prior {
                mean: 0.0,
                std: if actuator.effort.is_finite() && actuator.effort > 0.0 {
                    actuator.effort
                } else {
                    20.0
                },
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, limit: T) -> [Term<T>; MAX_COLUMNS] {
        let edge = real::<T>(EDGE) * limit;
        let share = (state.tau.abs() - limit + edge) / edge;
        let share = share.max(T::zero()).min(T::one());
        [Term::rate(share * state.tau.signum()), Term::zero()]
    }
}
