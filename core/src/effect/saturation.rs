//! A torque that is limited below the reported one: true = reported within ± limit. The column is the excess; its
//! coefficient, the share of it that is missing, is one where the limit is right. The limit is scanned.

use super::{Description, Effect, Form, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, go2::Actuator};

/// See the module.
pub(super) struct Saturation;

impl Effect for Saturation {
    const DESCRIPTION: Description = Description {
        name: "saturation",
        torque: "true torque = reported within ± limit",
        form: Form::Columns,
        parameters: &[
            Parameter::new("limit", "N m", 0.0, f64::INFINITY).shape(),
            Parameter::new("share", "1", 0.0, 1.5),
        ],
        words: "the motor gives less than it reports beyond a limit (current limit, voltage)",
        look_alikes: &["torque_gain", "load_friction"],
        separated_by: "the same motion slower, or with smaller loads: below the limit all is well",
        urdf: None,
        mjcf: None,
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 20.0,
                std: 20.0,
            },
            _ => Prior {
                mean: 0.0,
                std: 1.0,
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, limit: T) -> [Term<T>; MAX_COLUMNS] {
        let excess = state.tau - state.tau.max(-limit).min(limit);
        [Term::rate(excess), Term::zero()]
    }
}
