//! The replies of a leg's motors, each of its own time, to one sample.
//!
//! A motor counts its rotor's turns from somewhere; a joint's angle is what it counts from the joint's zero, over the gear, and for a motor that
//! turns the other way, less that. Whether the zeros are known is `zeros`'s affair.
//!
//! The motors of a leg are polled one after the other; what they say is brought to the time of the first reply of the
//! cycle. Velocity and torque lie on the line from the motor's last reply to this one, so that noise is averaged and never
//! amplified, as extrapolation would; position goes back from this reply by the mean of the two velocities, which is exact
//! to the third order in time. Where a motor's last reply is too old, its velocity and torque are taken as they are.

use core::marker::PhantomData;

use crate::Real;
use crate::bus::{Cycle, joint_side};
use crate::robot::{Robot, places};
use crate::scalar::real;
use crate::window::Sample;

/// A motor that says nothing for so long may have been switched off and have moved meanwhile, µs.
const SILENCE_US: u64 = 100_000;

/// The last reply of each motor of a leg of robot `R`.
#[derive(Clone, Copy, Debug)]
pub struct Alignment<T, R, const J: usize> {
    last: [Reading<T>; J],
    /// Each motor's count where its joint's angle is 0.
    zeros: [i32; J],
    /// Motors that turn against their joints, bit n for the n-th joint.
    reversed: u8,
    /// A motor was silent so long that it may have been switched off.
    silent: bool,
    robot: PhantomData<R>,
}

/// What one motor said, joint side.
#[derive(Clone, Copy, Debug)]
struct Reading<T> {
    time_us: u64,
    dq: T,
    tau: T,
}

impl<T: Real, R: Robot<J>, const J: usize> Alignment<T, R, J> {
    /// The places of the joints' motors in a cycle.
    pub(super) const PLACES: [usize; J] = places(R::MOTOR_IDS);
    /// Each joint's position (rad), velocity (rad/s) and torque (N m) of one count.
    const SCALES: [[f64; 3]; J] = {
        assert!(J <= 8);
        let mut scales = [[0.0; 3]; J];
        let mut joint = 0;
        while joint < J {
            scales[joint] = joint_side(R::ACTUATORS[joint].gear);
            joint += 1;
        }
        scales
    };

    /// No reply yet; motors that count from their joints' zeros and turn as their joints do.
    pub const fn new() -> Self {
        let last = Reading {
            time_us: 0,
            dq: T::ZERO,
            tau: T::ZERO,
        };
        Self {
            last: [last; J],
            zeros: [0; J],
            reversed: 0,
            silent: false,
            robot: PhantomData,
        }
    }

    /// Takes a joint's angle to be 0 where its motor counts `zero`, and the motor to turn against the joint if it is `reversed`.
    pub fn set_zero(&mut self, joint: usize, zero: i32, reversed: bool) {
        if let Some(place) = self.zeros.get_mut(joint) {
            *place = zero;
            self.reversed = self.reversed & !(1 << joint) | u8::from(reversed) << joint;
        }
    }

    /// Whether a motor was silent for 0.1 s before its last reply, or the clock was set back, since this was asked last.
    #[inline]
    pub fn take_silence(&mut self) -> bool {
        core::mem::take(&mut self.silent)
    }

    /// Whether it was, without taking note of the answer.
    #[inline]
    pub(super) fn was_silent(&self) -> bool {
        self.silent
    }

    /// The count of a motor where its joint's angle is 0, and whether it turns against the joint.
    pub fn zero(&self, joint: usize) -> (i32, bool) {
        let zero = self.zeros.get(joint).copied().unwrap_or_default();
        (zero, self.reversed >> joint & 1 == 1)
    }

    /// Motors that turn against their joints, bit n for the n-th joint.
    pub(super) fn reversed(&self) -> u8 {
        self.reversed
    }

    /// The leg at the time of the first reply of `cycle`. Replies further apart than `max_gap_us` are not interpolated.
    #[inline(never)]
    pub fn sample(&mut self, cycle: &Cycle<J>, max_gap_us: u64) -> Sample<T, J> {
        let time_us = cycle.iter().map(|heard| heard.time_us).min();
        let mut sample = Sample {
            time_us: time_us.unwrap_or_default(),
            q: [T::ZERO; J],
            dq: [T::ZERO; J],
            tau: [T::ZERO; J],
        };
        let joints = Self::PLACES.iter().zip(&Self::SCALES);
        let joints = joints.zip(&mut self.last).zip(&self.zeros);
        for (j, (((place, scales), last), zero)) in joints.enumerate() {
            let Some(heard) = cycle.get(*place) else {
                continue;
            };
            let (reply, [position, speed, torque]) = (&heard.reply, *scales);
            let now = Reading::<T> {
                time_us: heard.time_us,
                dq: real(f64::from(reply.speed) * speed),
                tau: real(f64::from(reply.torque) * torque),
            };
            let back_us = now.time_us.saturating_sub(sample.time_us).min(max_gap_us);
            let step_us = now.time_us.wrapping_sub(last.time_us);
            let bridged = step_us <= max_gap_us && back_us < step_us;
            let share: T = match bridged {
                true => real::<T>(f64::from(back_us as u32)) / real(f64::from(step_us as u32)),
                false => {
                    self.silent |= step_us > SILENCE_US && last.time_us != 0;
                    T::ZERO
                }
            };
            let back: T = real(f64::from(back_us as u32) * 1e-6);
            let dq = now.dq - (now.dq - last.dq) * share;
            let mean = (now.dq + dq) * real(0.5);
            let count = reply.position.wrapping_sub(*zero);
            let position: T = real(f64::from(count) * position);
            let values = (
                position - mean * back,
                dq,
                now.tau - (now.tau - last.tau) * share,
            );
            if let (Some(q), Some(dq), Some(tau)) = (
                sample.q.get_mut(j),
                sample.dq.get_mut(j),
                sample.tau.get_mut(j),
            ) {
                (*q, *dq, *tau) = values;
            }
            *last = now;
        }
        if self.reversed != 0 {
            self.turn_round(&mut sample);
        }
        sample
    }

    /// The sample of motors some of which turn against their joints.
    #[cold]
    fn turn_round(&self, sample: &mut Sample<T, J>) {
        let joints = sample.q.iter_mut().zip(&mut sample.dq).zip(&mut sample.tau);
        for (j, ((q, dq), tau)) in joints.enumerate() {
            if self.reversed >> j & 1 == 1 {
                (*q, *dq, *tau) = (-*q, -*dq, -*tau);
            }
        }
    }
}

impl<T: Real, R: Robot<J>, const J: usize> Default for Alignment<T, R, J> {
    fn default() -> Self {
        Self::new()
    }
}
