//! A wrong torque constant: true torque = g × reported. With W θ = g ∫τ the column of g − 1 is −∫τ.

use super::{Description, Effect, Form, JointState, MAX_COLUMNS, Parameter, Prior, Term};
use crate::{Real, go2::Actuator};

/// See the module.
pub(super) struct TorqueGain;

impl Effect for TorqueGain {
    const DESCRIPTION: Description = Description {
        name: "torque_gain",
        torque: "true torque = g × reported",
        form: Form::Columns,
        parameters: &[Parameter::new("g", "1", 0.2, 5.0).neutral(1.0)],
        words: "the reported torque is a constant multiple of the true one (torque constant, gear efficiency)",
        look_alikes: &["payload", "armature", "load_friction", "encoder_offset"],
        separated_by: "a known mass on the foot, in several poses: only it fixes the torque's scale",
        urdf: None,
        mjcf: None,
    };

    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 1.0,
            std: 0.2,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::rate(-state.tau), Term::zero()]
    }
}
