//! The base recoils from its limbs: it is suspended, or stands on something soft. The momentum h of the limbs over a base that is still moves a free base
//! of the whole robot's inertia I with the twist −I⁻¹ h, and joints feel that base move. A share s of their torque is there: 0 of a fixed base, 1 of a
//! free one, more of one that resonates below the motion.

use super::{Description, Effect, Input, JointState, MAX_COLUMNS, Parameter, Prior, Reach, Term};
use crate::Real;
use crate::robot::Actuator;

/// See the module.
pub(super) struct BaseRecoil;

impl Effect for BaseRecoil {
    const DESCRIPTION: Description = Description {
        name: "base_recoil",
        torque: "s (rigid-body torque of a base that moves by −I⁻¹ h)",
        input: Input::Base,
        reach: Reach::Robot,
        // A suspension that resonates at 1/√2 of the motion's frequency has a share of 2.
        parameters: &[Parameter::new("s", "1", 0.0, 2.0)],
        words: "the base recoils from its limbs: it is suspended, or stands on something soft",
        look_alikes: &["armature", "coupled_armature", "payload"],
        separated_by: "one limb that moves while the others rest; or limbs that move against each other and then together",
        ..Description::TORQUE
    };

    /// A Go2 on a rope has 0.1 to 1.3 (`studies/real_chirps.md`): anything from a fixed base to a free one.
    fn prior(_: &Actuator, _: usize) -> Prior {
        Prior {
            mean: 0.5,
            std: 0.5,
        }
    }

    fn terms<T: Real>(state: &JointState<T>, _: T) -> [Term<T>; MAX_COLUMNS] {
        let [boundary, rate] = state.recoil;
        [Term { boundary, rate }, Term::zero()]
    }
}
