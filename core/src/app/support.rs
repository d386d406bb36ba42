//! Whether the feet carry the robot: it stands, walks, or was put down. What its legs then say is not of a robot that hangs.
//!
//! A calf's motor holds against the ground what that of a hanging leg does not. Its mean torque over a window, less what the CAD's leg and
//! rotor need in the same motion, over the foot's lever is the vertical force at the foot. Averaged over six windows and over all legs
//! that are heard it is a quarter of the robot's weight, 37 N, if they carry it. Nothing of a robot that hangs comes near: a calf's friction
//! and the CAD's errors change their signs with the motion, and a load pulls the other way.
//!
//! The sensors of the feet are not asked: they count in no unit, one may read nothing, and one that drifts would take windows from a robot
//! that hangs. A leg so straight that its calf has no lever is not told by torques; its standing is then not seen.

use crate::Real;
use crate::estimator::{BASE_RANK, COLUMNS, DevicePrior, DeviceRows, EffectPrior, FRONT, LegBase};
use crate::go2::{ACTUATORS, JOINTS_PER_LEG};
use crate::inertia::INERTIAL;
use crate::scalar::{real, sin_cos};

/// The calf.
const JOINT: usize = JOINTS_PER_LEG - 1;
const REFERENCE: usize = FRONT + BASE_RANK[JOINT];

/// From the calf's joint to the foot's centre, m.
const LENGTH: f64 = 0.213;
/// A lever of less than this, m, tells no force: a friction of 1 N m would be one of 20 N.
const LEAST_LEVER: f64 = 0.05;
/// Windows that the mean is over, about: what waits to be folded in.
const WINDOWS: f64 = 6.0;

/// Mean force at the feet from which they carry the robot, N: a third of what they do when it stands. In five recorded chirps of a robot that
/// hangs it is 4.7 N at most.
const FORCE: f64 = 12.0;
/// They are taken to carry it for so long afterwards, µs: a robot that trots or hops leaves the ground for less.
pub(super) const HOLD_US: u64 = 2_000_000;
/// What a leg said longer ago counts no more, µs.
const FRESH_US: u64 = 200_000;

/// What a leg's calf says of the force at its foot.
#[derive(Clone, Copy, Debug)]
pub(super) struct Support<T> {
    /// The CAD's parameters of the calf's columns.
    reference: [T; REFERENCE],
    /// The force, N, and when it was told last, µs.
    force: T,
    at_us: u64,
}

impl<T: Real> Support<T> {
    /// Nothing known: all zeros.
    pub(super) const fn new() -> Self {
        Self {
            reference: [T::ZERO; REFERENCE],
            force: T::ZERO,
            at_us: 0,
        }
    }

    /// Begins anew, of a leg with these bodies before any data.
    #[inline(never)]
    pub(super) fn begin(&mut self, prior: &DevicePrior<T>, base: &LegBase<T>) {
        *self = Self::new();
        let (effects, bodies) = self.reference.split_at_mut(FRONT);
        for (to, effect) in effects.iter_mut().zip(COLUMNS) {
            *to = real(EffectPrior::of(effect, &ACTUATORS[JOINT]).prior.mean);
        }
        if let (Some(base), Some(calf)) = (base.joint(JOINT), prior.cad().get(JOINT)) {
            let standard: &[T; INERTIAL] = &calf.0.data.0[0];
            base.base_of(standard, bodies);
        }
    }

    /// Takes in a closed window, which ended in this posture (rad).
    #[inline(never)]
    pub(super) fn see(&mut self, rows: &DeviceRows<T>, q: &[T; JOINTS_PER_LEG]) {
        let Some((torque, columns)) = rows.joint(JOINT).split_last() else {
            return;
        };
        let needed = columns.iter().zip(&self.reference);
        let held = needed.fold(*torque, |left, (column, x)| left - *column * *x);
        let [hip, thigh, calf] = *q;
        let (out, below) = (sin_cos(hip).1, sin_cos(thigh + calf).0);
        let lever = out * below * real(LENGTH);
        let least = real::<T>(LEAST_LEVER * LEAST_LEVER);
        let force = -held * lever / (lever * lever + least);
        self.force += (force - self.force) * real(1.0 / WINDOWS);
        self.at_us = rows.span_us[1];
    }
}

/// Whether the feet carry the robot by what its legs have said until now.
pub(super) fn carries<'a, T: Real>(
    legs: impl Iterator<Item = &'a Support<T>>,
    now_us: u64,
) -> bool {
    let (mut sum, mut heard) = (T::zero(), T::zero());
    for leg in legs {
        // Its clock is the steps'; a window may end behind a step that came early.
        let fresh = leg.at_us > 0 && leg.at_us.abs_diff(now_us) < FRESH_US;
        let share = if fresh { T::one() } else { T::zero() };
        sum += leg.force * share;
        heard += share;
    }
    heard > T::zero() && sum >= heard * real(FORCE)
}
