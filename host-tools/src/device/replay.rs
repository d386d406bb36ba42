//! A log's samples as motor-bus bytes, played into a device.

use proprio_core::bus::crc::{SEED_GO2, SEED_STANDALONE};
use proprio_core::bus::{Command, EncodeError, Mode, Reply};
use proprio_core::go2::{ACTUATORS, JOINTS_PER_LEG, LEGS, Leg};
use proprio_core::window::Sample;
use proprio_core::wire::DeviceMessage;

use super::{BusStep, Device, DeviceError};

/// What the legs measured at one time; a leg that a log does not have is silent.
pub type Instant = [Option<Sample<f64, JOINTS_PER_LEG>>; LEGS];

/// Silent steps after the last sample, in which the device folds and solves what it has.
const SILENT_STEPS: u64 = 600;
/// Time between silent steps, µs.
const SILENT_STEP_US: u64 = 2_000;

/// Length of that silence, µs.
pub const SILENCE_US: u64 = SILENT_STEPS * SILENT_STEP_US;

/// Why a replay ended.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// A value does not fit a frame.
    #[error("{joint} at {time_us} µs: {reason}")]
    Encode {
        /// The joint.
        joint: &'static str,
        /// Time of the sample, µs.
        time_us: u64,
        /// What is wrong with it.
        reason: EncodeError,
    },
    /// The device.
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// The bytes of one polling cycle: three commands, each with its reply. Quantities are rounded to the bus's quanta.
///
/// # Errors
/// [`ReplayError::Encode`].
pub fn cycle(leg: Leg, sample: &Sample<f64, JOINTS_PER_LEG>) -> Result<Vec<u8>, ReplayError> {
    let mut bytes = Vec::with_capacity(JOINTS_PER_LEG * (Command::LEN + Reply::LEN));
    for (j, actuator) in ACTUATORS.iter().enumerate() {
        let mode = Mode::foc(j as u8);
        let (q, dq, tau) = (sample.q[j], sample.dq[j], sample.tau[j]);
        let reply = Reply::from_joint(mode, actuator.gear, q, dq, tau, 25).map_err(|reason| {
            ReplayError::Encode {
                joint: leg.joint_names()[j],
                time_us: sample.time_us,
                reason,
            }
        })?;
        bytes.extend(
            Command {
                mode,
                ..Command::default()
            }
            .encode(SEED_GO2),
        );
        bytes.extend(reply.encode(SEED_STANDALONE));
    }
    Ok(bytes)
}

/// The buses' bytes at `time_us`.
///
/// # Errors
/// [`ReplayError::Encode`].
pub fn bus_step(time_us: u64, instant: &Instant) -> Result<BusStep, ReplayError> {
    let mut step = BusStep {
        time_us,
        ..BusStep::default()
    };
    for (leg, bytes) in Leg::ALL.into_iter().zip(&mut step.buses) {
        if let Some(sample) = &instant[leg.index()] {
            *bytes = cycle(leg, sample)?;
        }
    }
    Ok(step)
}

/// Plays `steps` and then silence, until all that was played is in what the device told. Times must grow.
///
/// # Errors
/// [`ReplayError`]; the first error of `steps` ends the replay.
pub fn replay(
    steps: impl IntoIterator<Item = Result<BusStep, ReplayError>>,
    device: &mut dyn Device,
    told: &mut dyn FnMut(DeviceMessage),
) -> Result<(), ReplayError> {
    let mut time_us = 0;
    for step in steps {
        let step = step?;
        time_us = step.time_us;
        device.play(&step, told)?;
    }
    for _ in 0..SILENT_STEPS {
        time_us += SILENT_STEP_US;
        device.play(
            &BusStep {
                time_us,
                ..BusStep::default()
            },
            told,
        )?;
    }
    device.settle(told)?;
    Ok(())
}
