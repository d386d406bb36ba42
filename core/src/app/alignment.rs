//! Three motors' replies, each of its own time, to one sample.
//!
//! The motors of a leg are polled one after the other; what they say is brought to the time of the first reply of the
//! cycle. Velocity and torque lie on the line from the motor's last reply to this one, so that noise is averaged and never
//! amplified, as extrapolation would; position goes back from this reply by the mean of the two velocities, which is exact
//! to the third order in time. Where a motor's last reply is too old, its velocity and torque are taken as they are.

use crate::Real;
use crate::bus::Cycle;
use crate::go2::{ACTUATORS, JOINTS_PER_LEG};
use crate::scalar::real;
use crate::window::Sample;

/// The last reply of each motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alignment<T> {
    last: [Reading<T>; JOINTS_PER_LEG],
}

/// What one motor said, joint side.
#[derive(Clone, Copy, Debug)]
struct Reading<T> {
    time_us: u64,
    dq: T,
    tau: T,
}

impl<T: Real> Alignment<T> {
    /// No reply yet.
    pub(super) const fn new() -> Self {
        let last = Reading {
            time_us: 0,
            dq: T::ZERO,
            tau: T::ZERO,
        };
        Self {
            last: [last; JOINTS_PER_LEG],
        }
    }

    /// The leg at the time of the first reply of `cycle`. Replies further apart than `max_gap_us` are not interpolated.
    #[inline(never)]
    pub(super) fn sample(&mut self, cycle: &Cycle, max_gap_us: u64) -> Sample<T, JOINTS_PER_LEG> {
        let time_us = cycle.iter().map(|heard| heard.time_us).min();
        let mut sample = Sample {
            time_us: time_us.unwrap_or_default(),
            q: [T::ZERO; JOINTS_PER_LEG],
            dq: [T::ZERO; JOINTS_PER_LEG],
            tau: [T::ZERO; JOINTS_PER_LEG],
        };
        let joints = cycle.iter().zip(&ACTUATORS).zip(&mut self.last);
        for (j, ((heard, actuator), last)) in joints.enumerate() {
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
