//! A log's samples as a listener on the motor bus receives them.

use proprio_core::bus::{Mode, Reply};
use proprio_core::go2::ACTUATORS;

use crate::recording::Recording;

/// Position (rad), velocity (rad/s) and torque (N m) of the leg's joint `joint`, counted from its hip, as its motor's reply carries them: the
/// frame's integers are all that the bus loses, so bytes and checksums need not be made. Values that fit no frame stay: they are also
/// more than the robot can do.
pub fn received(joint: usize, [q, dq, tau]: [f64; 3]) -> [f64; 3] {
    let (gear, mode) = (ACTUATORS[joint].gear, Mode::foc(joint as u8));
    let reply = Reply::from_joint(mode, gear, q, dq, tau, 0);
    reply.map_or([q, dq, tau], |reply| {
        let (q, dq) = (reply.joint_position(gear), reply.joint_velocity(gear));
        [q, dq, reply.joint_torque(gear)]
    })
}

/// Rounds each sample of a Go2's legs to what the bus carries.
pub(super) fn round(recording: &mut Recording) {
    for (_, limb) in &mut recording.limbs {
        limb.replace(received);
    }
}
