//! A log's samples as a listener on the motor bus hears them.

use proprio_core::bus::{EncodeError, Mode, Reply};
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG};
use proprio_core::window::Sample;

/// What a listener makes of the three motors' replies: the frame's integers are all that the bus loses, so bytes and
/// checksums need not be made here.
///
/// # Errors
/// [`EncodeError`] if a value does not fit a frame.
pub(super) fn heard(
    sample: &Sample<f64, JOINTS_PER_LEG>,
) -> Result<Sample<f64, JOINTS_PER_LEG>, EncodeError> {
    let mut heard = *sample;
    for j in 0..JOINTS_PER_LEG {
        let (gear, mode) = (ACTUATORS[j].gear, Mode::foc(j as u8));
        let reply = Reply::from_joint(mode, gear, sample.q[j], sample.dq[j], sample.tau[j], 0)?;
        heard.q[j] = reply.joint_position(gear);
        heard.dq[j] = reply.joint_velocity(gear);
        heard.tau[j] = reply.joint_torque(gear);
    }
    Ok(heard)
}
