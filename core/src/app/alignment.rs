//! The replies of a leg's motors, each of its own time, to one sample.
//!
//! The motors of a leg are polled one after the other; what they say is brought to the time of the first reply of the
//! cycle. Velocity and torque lie on the line from the motor's last reply to this one, so that noise is averaged and never
//! amplified, as extrapolation would; position goes back from this reply by the mean of the two velocities, which is exact
//! to the third order in time. Where a motor's last reply is too old, its velocity and torque are taken as they are.

use core::marker::PhantomData;

use crate::Real;
use crate::bus::Cycle;
use crate::robot::{Robot, places};
use crate::scalar::real;
use crate::window::Sample;

/// The last reply of each motor of a leg of robot `R`.
#[derive(Clone, Copy, Debug)]
pub struct Alignment<T, R, const J: usize> {
    last: [Reading<T>; J],
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
    const PLACES: [usize; J] = places(R::MOTOR_IDS);

    /// No reply yet.
    pub const fn new() -> Self {
        let last = Reading {
            time_us: 0,
            dq: T::ZERO,
            tau: T::ZERO,
        };
        Self {
            last: [last; J],
            robot: PhantomData,
        }
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
        let joints = Self::PLACES.iter().zip(&R::ACTUATORS).zip(&mut self.last);
        for (j, ((place, actuator), last)) in joints.enumerate() {
            let Some(heard) = cycle.get(*place) else {
                continue;
            };
            let (reply, gear) = (&heard.reply, actuator.gear);
            let now = Reading::<T> {
                time_us: heard.time_us,
                dq: real(reply.joint_velocity(gear)),
                tau: real(reply.joint_torque(gear)),
            };
            let back_us = now.time_us.saturating_sub(sample.time_us).min(max_gap_us);
            let step_us = now.time_us.wrapping_sub(last.time_us);
            let bridged = step_us <= max_gap_us && back_us < step_us;
            let share: T = match bridged {
                true => real::<T>(f64::from(back_us as u32)) / real(f64::from(step_us as u32)),
                false => T::ZERO,
            };
            let back: T = real(f64::from(back_us as u32) * 1e-6);
            let dq = now.dq - (now.dq - last.dq) * share;
            let mean = (now.dq + dq) * real(0.5);
            let position: T = real(reply.joint_position(gear));
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
        sample
    }
}

impl<T: Real, R: Robot<J>, const J: usize> Default for Alignment<T, R, J> {
    fn default() -> Self {
        Self::new()
    }
}
