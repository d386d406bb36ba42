//! A log's samples as a listener on the motor bus hears them.

use proprio_core::bus::{EncodeError, Mode, Reply};
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG};
use proprio_core::window::Sample;

/// The replies of a leg's three motors to the poll at one sample. The log's temperatures are not the bus's concern here:
/// no parameter depends on them.
///
/// # Errors
/// [`EncodeError`] if a value does not fit a frame.
pub fn replies(
    sample: &Sample<f64, JOINTS_PER_LEG>,
) -> Result<[Reply; JOINTS_PER_LEG], EncodeError> {
    let mut replies = [Reply::default(); JOINTS_PER_LEG];
    for (j, reply) in replies.iter_mut().enumerate() {
        let (gear, mode) = (ACTUATORS[j].gear, Mode::foc(j as u8));
        *reply = Reply::from_joint(mode, gear, sample.q[j], sample.dq[j], sample.tau[j], 25)?;
    }
    Ok(replies)
}

/// What a listener makes of the replies to one poll.
pub fn heard(
    sample: &Sample<f64, JOINTS_PER_LEG>,
) -> Result<Sample<f64, JOINTS_PER_LEG>, EncodeError> {
    let replies = replies(sample)?;
    let joint = |read: fn(&Reply, f64) -> f64| {
        std::array::from_fn(|j| read(&replies[j], ACTUATORS[j].gear))
    };
    Ok(Sample {
        time_us: sample.time_us,
        q: joint(Reply::joint_position),
        dq: joint(Reply::joint_velocity),
        tau: joint(Reply::joint_torque),
    })
}
