//! What a microcontroller keeps of a leg: base columns, candidate effects beside the active ones, two folds.
//!
//! A joint's factor has the independent columns of its bodies' parameters only ([`crate::base_parameters`]): 15 for a
//! hip instead of 30, and as many numbers as its columns squared are rotated for each row. Before them stand the effects that
//! are active at first, behind them the candidates: the model of the first ones is then the triangle's front, at no cost.
//! Nothing is lost: the rows of all columns are those of the independent ones times P.
//!
//! Windows go to the fold of their block of time, in turn, six at a time. All data are the two folds together; each fold alone judges what
//! was fitted to the other ([`crate::criticism`]). There is no guard between blocks: it would cost the estimate its data or
//! the board a third set of factors, and windows that remember the block before are few (residuals are forgotten within
//! 0.1 s of 2 s).
//!
//! [`Gather`] turns the folds into the factors of the active effects and all standard parameters, those that the desktop
//! folds directly; from there on the solution is the same code.

mod base;
mod beliefs;
mod change;
mod folds;
mod gather;
mod window;

pub use base::LegBase;
pub use beliefs::Beliefs;
pub use change::{BlockTest, Change, ChangeKind, Verdict};
pub use folds::DeviceFolds;
pub use gather::Gather;
pub use window::{DeviceRows, DeviceWindow};

use super::{
    CAD_UNCERTAINTY, EffectPrior, JointFactors, LEG_INERTIAL, Layout, LimbPrior, Solver, solver_len,
};
use crate::consistent::Descent;
use crate::effect::{EffectKind, Form, JointState, Term};
use crate::factor::packed_len;
use crate::inertia::INERTIAL;
pub(crate) use crate::regressor::leg::BASE_COLUMNS as BASE_RANK;
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::robot::{Actuator, Robot};
use crate::window::EffectList;
use crate::{Real, scalar::real};
use heapless::Vec;

macro_rules! columns {
    ($($name:ident),* $(,)?) => {
        /// The effects whose columns a device keeps for every joint, the first of each: those that are active at first, then
        /// the candidates.
        ///
        /// Beside `bias` a spring needs its first column alone: the second is the bias's. Beside `coulomb` the first column
        /// of `asymmetric_coulomb` is what the positive direction has more. A shape is the mean of its prior. Effects of
        /// another form than columns (`torque_gain` scales the model's torque) need a fit before they have a column: the
        /// desktop's `diagnose` finds those.
        pub const COLUMNS: [EffectKind; DEVICE_COLUMNS] = [$(EffectKind::$name),*];

        /// Effect columns of a joint.
        pub(crate) const DEVICE_COLUMNS: usize = [$(EffectKind::$name),*].len();

        impl EffectList<DEVICE_COLUMNS> for DeviceColumns {
            // Written out, so that each call is compiled for its effect.
            #[inline(always)]
            fn terms<T: Real>(&self, state: &JointState<T>) -> [Term<T>; DEVICE_COLUMNS] {
                [$({
                    const SHAPE: f64 = shape(EffectKind::$name);
                    let [first, _] = EffectKind::$name.terms(state, real(SHAPE));
                    first
                }),*]
            }
        }
    };
}

columns! {
    Viscous, Coulomb, Armature, Bias,
    AsymmetricCoulomb, Stribeck, LoadFriction, QuadraticDrag, Spring, Delay,
}

/// Of [`COLUMNS`] those that are integrals of a rate, and those that are differences between a window's ends.
const RATED: [usize; 7] = [1, 3, 4, 5, 6, 7, 8];
const BOUNDARY: [usize; 3] = [0, 2, 9];

/// [`COLUMNS`] as a type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DeviceColumns;

/// The shape at which an effect's column is kept: of the shaped effects only `stribeck` has one, vs in rad/s.
const fn shape(effect: EffectKind) -> f64 {
    match effect {
        EffectKind::Stribeck => 0.1,
        _ => 1.0,
    }
}

// A column of no term would be zero whatever the data, and its effect never found.
const _: () = {
    let mut n = 0;
    while n < DEVICE_COLUMNS {
        assert!(matches!(
            COLUMNS[n].description().form,
            Form::Columns | Form::Clock
        ));
        n += 1;
    }
};

/// Folds of the data.
pub const FOLDS: usize = 2;

/// Effects in front of a fold's base columns: those that are active at first. The others stand behind.
pub(crate) const FRONT: usize = 4;

/// What a load would change first, on each body in turn: a standard parameter of it. A thigh's or a calf's load changes the mass, which
/// the joints before feel, and the moment along the link; a hip's, whose joint's axis is x, the moments across it.
const LOADS: [(usize, usize); 6] = [(0, 2), (0, 3), (1, 0), (1, 3), (2, 0), (2, 3)];
/// How many of them a joint feels: the last ones. A body's mass is at its own joint's origin.
const fn loads_felt(joint: usize) -> usize {
    match joint {
        0 => 6,
        1 => 3,
        2 => 1,
        _ => 0,
    }
}

/// Most effect parameters of a leg.
pub(crate) const MAX_EFFECTS: usize = DEVICE_COLUMNS * JOINTS_PER_LEG;

/// The columns of a leg with every effect active: what the storage has to hold.
const LARGEST: Layout<JOINTS_PER_LEG> = Layout::chain(DEVICE_COLUMNS);

/// Columns of a joint's fold.
const fn columns(joint: usize) -> usize {
    DEVICE_COLUMNS + rank(joint)
}

/// Standard parameters that a joint's torque may depend on.
const fn standard(joint: usize) -> usize {
    INERTIAL * (JOINTS_PER_LEG - joint)
}

/// Where joint `joint`'s triangle lies if those of `len(0)`, `len(1)`, … columns lie one after the other.
macro_rules! range {
    ($len:ident, $joint:expr) => {{
        let (mut start, mut before) = (0, 0);
        while before < $joint {
            start += packed_len($len(before));
            before += 1;
        }
        start..start + packed_len($len($joint))
    }};
}
use range;

/// Base parameters of a joint; none beyond the leg.
const fn rank(joint: usize) -> usize {
    if joint < JOINTS_PER_LEG {
        BASE_RANK[joint]
    } else {
        0
    }
}

/// The directions of the [`LOADS`] that joints feel, one after the other, joint by joint.
const LOADS_LEN: usize = loads_before(JOINTS_PER_LEG);

/// Where a joint's directions begin.
const fn loads_before(joint: usize) -> usize {
    let (mut start, mut before) = (0, 0);
    while before < joint {
        start += loads_felt(before) * rank(before);
        before += 1;
    }
    start
}

const FOLD_LEN: usize = range!(columns, JOINTS_PER_LEG - 1).end;
/// Numbers that the joints' rows of a window have.
const ROWS_LEN: usize = {
    let (mut len, mut joint) = (0, 0);
    while joint < JOINTS_PER_LEG {
        len += columns(joint) + 1;
        joint += 1;
    }
    len
};
/// Where a joint's entries lie in the rows of a window.
fn entries(joint: usize) -> core::ops::Range<usize> {
    let start = (0..joint).map(|joint| columns(joint) + 1).sum();
    start..start + columns(joint) + 1
}
/// Numbers of the longest triangle of a joint in a fold, the hip's.
pub const LONGEST_TRIANGLE: usize = packed_len(columns(0));
const BASE_LEN: usize = range!(standard, JOINTS_PER_LEG - 1).end;
const MARGINAL_LEN: usize = range!(rank, JOINTS_PER_LEG - 1).end;

/// The solver of a leg with any of the effects active.
pub type DeviceSolver<T> = Solver<
    T,
    [T; LARGEST.packed_len()],
    [T; solver_len(LEG_INERTIAL + MAX_EFFECTS)],
    JOINTS_PER_LEG,
>;
/// The prior of a leg with any of the effects active.
pub type DevicePrior<T> = LimbPrior<T, Vec<EffectPrior, MAX_EFFECTS>, JOINTS_PER_LEG>;

/// The consistent solution of a leg with any of the effects active, that a device's solver serves.
pub type DeviceDescent<T> =
    Descent<T, [T; LEG_INERTIAL + MAX_EFFECTS], [T; packed_len(LEG_INERTIAL)]>;

/// Which effects of [`COLUMNS`] the model of each joint of a leg has, bit n for the n-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Active(pub [u32; JOINTS_PER_LEG]);

/// Viscous, coulomb, armature, bias at every joint.
pub const DEFAULT_ACTIVE: Active = Active([0b1111; JOINTS_PER_LEG]);

impl Active {
    /// No effect at any joint.
    pub(crate) const NONE: Self = Self([0; JOINTS_PER_LEG]);

    /// Whether the model of a joint has effect n.
    pub fn has(&self, joint: usize, n: usize) -> bool {
        self.0.get(joint).is_some_and(|mask| mask >> n & 1 == 1)
    }

    /// Adds effect n to a joint's model, or drops it.
    pub fn set(&mut self, joint: usize, n: usize, active: bool) {
        if let (Some(mask), true) = (self.0.get_mut(joint), n < DEVICE_COLUMNS) {
            *mask = if active {
                *mask | 1 << n
            } else {
                *mask & !(1 << n)
            };
        }
    }

    /// The columns of a leg with these effects.
    pub fn layout(&self) -> Layout<JOINTS_PER_LEG> {
        let effects = self.0.map(|mask| mask.count_ones() as usize);
        Layout::new(JOINTS_PER_LEG, [JOINTS_PER_LEG; JOINTS_PER_LEG], effects).unwrap_or(LARGEST)
    }

    /// The active effects' priors in the order of θ, and each one's place in [`COLUMNS`].
    pub fn effects(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..JOINTS_PER_LEG)
            .flat_map(|joint| (0..DEVICE_COLUMNS).map(move |n| (joint, n)))
            .filter(|&(joint, n)| self.has(joint, n))
    }
}

/// What is known before any data of effect n at a joint that `actuator` drives, and its bounds; of the parameter beyond its neutral value.
fn effect_prior(actuator: &Actuator, n: usize) -> EffectPrior {
    EffectPrior::of(COLUMNS[n % DEVICE_COLUMNS], actuator)
}

impl<T: Real> DevicePrior<T> {
    /// The CAD's inertias within [`CAD_UNCERTAINTY`], each active effect as its catalogue entry says.
    pub fn of<R: Robot<JOINTS_PER_LEG>>(which: R, active: &Active) -> Self {
        let cad = which.tree::<T>().bodies().map(|body| body.inertia);
        let mut prior = Self::new(cad, [real(CAD_UNCERTAINTY); JOINTS_PER_LEG], Vec::new());
        prior.activate(active, &Beliefs::NONE, &R::ACTUATORS);
        prior
    }

    /// Becomes the prior of a model with other effects, or of other beliefs of them, of a leg with these actuators.
    pub fn activate(
        &mut self,
        active: &Active,
        beliefs: &Beliefs,
        actuators: &[Actuator; JOINTS_PER_LEG],
    ) {
        // There is room for all effects.
        let mut effects = Vec::new();
        for (joint, n) in active.effects() {
            if let Some(actuator) = actuators.get(joint) {
                let _ = effects.push(beliefs.prior(joint, n, actuator));
            }
        }
        self.set_effects(effects);
    }
}

impl<T: Real> DeviceDescent<T> {
    /// One that has solved nothing yet: all zeros.
    pub const fn empty() -> Self {
        let theta = [T::ZERO; LEG_INERTIAL + MAX_EFFECTS];
        Self::new(theta, theta, [T::ZERO; packed_len(LEG_INERTIAL)])
    }
}

impl<T: Real> DeviceSolver<T> {
    /// A solver that has solved nothing yet and knows no columns: all zeros.
    pub const fn empty() -> Self {
        let data = JointFactors::unset(Layout::NONE, [T::ZERO; LARGEST.packed_len()]);
        Self::new(data, [T::ZERO; solver_len(LEG_INERTIAL + MAX_EFFECTS)])
    }
}
