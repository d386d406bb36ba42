//! Friction with a memory of displacement: after a reversal it builds up over a distance instead of jumping.
//!
//! The asperities between two surfaces are bristles that bend before they slip (Dahl 1968, *A solid friction model*, Aerospace
//! Corporation TOR-0158(3107-18)-1, with exponent 1; Canudas de Wit, Olsson, Åström & Lischinsky 1995, *IEEE Transactions on Automatic
//! Control* 40:419, without Stribeck effect and bristle damping):
//!
//! ```text
//! τ = F z/zs,    dz/dt = q̇ (1 − z sign(q̇)/zs),    |z| ≤ zs
//! ```
//!
//! The deflection z depends on the motion alone and not on F: linear in F, and zs is scanned. For zs → 0 it is Coulomb friction.
//! Beside `coulomb` F is the part of the friction that yields, alone all of it; either is never negative.
//!
//! Its impulse needs all of the motion since the recording began ([`JointState::presliding`]): where nothing is stored there is none.

use super::{
    Description, Effect, EffectKind, Grid, Input, JointState, MAX_COLUMNS, Parameter, Prior, Term,
};
use crate::{Real, robot::Actuator};

/// See the module.
pub(super) struct Presliding;

impl Effect for Presliding {
    const DESCRIPTION: Description = Description {
        name: "presliding",
        torque: "F z/zs with dz/dt = q̇ (1 − z sign(q̇)/zs)",
        input: Input::Bristles,
        without_shape: Some(EffectKind::Coulomb),
        parameters: &[
            Parameter::new("F", "N m", 0.0, f64::INFINITY),
            Parameter::new("zs", "rad", 1e-5, 0.3).shape(Grid::Displacements),
        ],
        words: "dry friction that builds up over a displacement after each reversal (seals, preloaded gears)",
        look_alikes: &["coulomb", "stribeck", "spring", "backlash", "delay"],
        separated_by: "many slow reversals, small and large: swings shorter and longer than the displacement zs",
        ..Description::TORQUE
    };

    fn prior(_: &Actuator, parameter: usize) -> Prior {
        match parameter {
            0 => Prior {
                mean: 0.0,
                std: 1.0,
            },
            _ => Prior {
                mean: 0.005,
                std: 0.01,
            },
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        [Term::boundary(state.presliding), Term::zero()]
    }
}
