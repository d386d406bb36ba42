//! A spring across the joint, τ = k (q − q0): a cable, a hose, a cover. Linear in k and in c = −k q0.

use super::{
    Description, Effect, EffectKind, JointState, MAX_COLUMNS, Mjcf, Parameter, Prior, Term, Varies,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Spring;

impl Effect for Spring {
    const DESCRIPTION: Description = Description {
        name: "spring",
        torque: "k q + c, zero at q0 = −c/k",
        varies: Varies::Slowly,
        simpler: Some(EffectKind::Bias),
        parameters: &[
            Parameter::new("k", "N m/rad", 0.0, f64::INFINITY),
            Parameter::new("c", "N m", f64::NEG_INFINITY, f64::INFINITY).same_as(EffectKind::Bias),
        ],
        words: "a torque in proportion to the position: a cable, hose or cover that pulls back",
        look_alikes: &[
            "bias",
            "payload",
            "encoder_offset",
            "base_tilt",
            "torque_gain",
        ],
        separated_by: "slow motion through the whole range in several poses of the joint's neighbours: gravity's torque changes with them, a spring's does not",
        mjcf: Some(Mjcf::Slope {
            slope: "stiffness",
            zero: "springref",
        }),
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.2,
                std: 1.0,
            },
            _ => Prior {
                mean: 0.0,
                std: 1.0,
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::rate(state.q), Term::rate(T::one())]
    }
}
