//! A log's samples as motor-bus bytes, played into a device.

use nalgebra::Vector3;
use proprio_core::bus::crc::{SEED_GO2, SEED_STANDALONE};
use proprio_core::bus::{Command, EncodeError, Mode, Reply};
use proprio_core::go2::{ACTUATORS, JOINTS, JOINTS_PER_LEG, LEGS, Leg};
use proprio_core::walk::WalkSample;
use proprio_core::window::Sample;
use proprio_core::wire::{DeviceMessage, Imu};

use super::power_up::PowerUp;
use super::{BusStep, Device, DeviceError, WalkStep};

/// What the legs measured at one time; a leg that a log does not have is silent.
pub type Instant = [Option<Sample<f64, JOINTS_PER_LEG>>; LEGS];

/// Silent steps after the last sample, in which the device folds and solves what it has: longer than the second after which counters come.
const SILENT_STEPS: u64 = 600;
/// Time between silent steps, µs.
const SILENT_STEP_US: u64 = 2_000;
/// How often there is such a silence at most: physically consistent solutions of four legs take eight seconds.
const MOST_SILENCES: usize = 15;

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

/// Most that a foot's sensor can read in a reply.
const MOST_COUNT: f64 = 4095.0;

/// The bytes of one polling cycle: three commands, each with its reply. Quantities are rounded to the bus's quanta.
///
/// # Errors
/// [`ReplayError::Encode`].
pub fn cycle(leg: Leg, sample: &Sample<f64, JOINTS_PER_LEG>) -> Result<Vec<u8>, ReplayError> {
    cycle_after(leg, sample, f64::NAN, &PowerUp::NONE)
}

/// The same of motors that count as `power_up` has them, and of a foot whose sensor reads `foot`, which the calf's reply says.
fn cycle_after(
    leg: Leg,
    sample: &Sample<f64, JOINTS_PER_LEG>,
    foot: f64,
    power_up: &PowerUp,
) -> Result<Vec<u8>, ReplayError> {
    let mut bytes = Vec::with_capacity(JOINTS_PER_LEG * (Command::LEN + Reply::LEN));
    // No number where there is no sensor.
    let count = foot.clamp(0.0, MOST_COUNT) as u16;
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
        let reply = Reply {
            flags: if j + 1 == JOINTS_PER_LEG {
                count << 3
            } else {
                0
            },
            ..reply
        };
        let command = Command {
            mode,
            ..Command::default()
        };
        bytes.extend(command.encode(SEED_GO2));
        bytes.extend(power_up.counted(leg, j, reply).encode(SEED_STANDALONE));
    }
    Ok(bytes)
}

/// What a device that listens to a robot that walks hears of a sample.
///
/// # Errors
/// [`ReplayError::Encode`].
pub fn walk_step(sample: &WalkSample<f64>) -> Result<WalkStep, ReplayError> {
    let single = |x: Vector3<f64>| <[f64; 3]>::from(x).map(|x| x as f32);
    let joints = &sample.joints;
    let time_us = joints.time_us;
    let mut bus = BusStep {
        time_us,
        ..BusStep::default()
    };
    for (leg, bytes) in Leg::ALL.into_iter().zip(&mut bus.buses) {
        let first = JOINTS_PER_LEG * leg.index();
        let of = |all: &[f64; JOINTS]| std::array::from_fn(|j| all[first + j]);
        let own = Sample {
            time_us,
            q: of(&joints.q),
            dq: of(&joints.dq),
            tau: of(&joints.tau),
        };
        *bytes = cycle_after(leg, &own, sample.count[leg.index()], &PowerUp::NONE)?;
    }
    Ok(WalkStep {
        imu: Imu {
            gyro: single(sample.gyro),
            acc: single(sample.acc),
        },
        bus,
    })
}

/// The buses' bytes at `time_us`.
///
/// # Errors
/// [`ReplayError::Encode`].
pub fn bus_step(time_us: u64, instant: &Instant) -> Result<BusStep, ReplayError> {
    bus_step_after(time_us, instant, &PowerUp::NONE)
}

/// The buses' bytes of a robot whose legs rest at these angles (rad); what fits no frame is silent.
pub fn resting(
    time_us: u64,
    angles: &[[f64; JOINTS_PER_LEG]; LEGS],
    power_up: &PowerUp,
) -> BusStep {
    let sample = |q: &[f64; JOINTS_PER_LEG]| Sample {
        time_us,
        q: *q,
        dq: [0.0; JOINTS_PER_LEG],
        tau: [0.0; JOINTS_PER_LEG],
    };
    let instant = angles.each_ref().map(|q| Some(sample(q)));
    bus_step_after(time_us, &instant, power_up).unwrap_or(BusStep {
        time_us,
        ..BusStep::default()
    })
}

/// The buses' bytes at `time_us`, of motors that count as `power_up` has them.
///
/// # Errors
/// [`ReplayError::Encode`].
pub fn bus_step_after(
    time_us: u64,
    instant: &Instant,
    power_up: &PowerUp,
) -> Result<BusStep, ReplayError> {
    let mut step = BusStep {
        time_us,
        ..BusStep::default()
    };
    for (leg, bytes) in Leg::ALL.into_iter().zip(&mut step.buses) {
        if let Some(sample) = &instant[leg.index()] {
            *bytes = cycle_after(leg, sample, f64::NAN, power_up)?;
        }
    }
    Ok(step)
}

/// Plays `steps` and then silence, until all that was played is in what the device told. Times must grow. Gives the time of the last step, µs.
///
/// # Errors
/// [`ReplayError`]; the first error of `steps` ends the replay.
pub fn replay(
    steps: impl IntoIterator<Item = Result<BusStep, ReplayError>>,
    device: &mut dyn Device,
    told: &mut dyn FnMut(DeviceMessage),
) -> Result<u64, ReplayError> {
    let mut time_us = 0;
    let mut played = [false; LEGS];
    for step in steps {
        let step = step?;
        time_us = step.time_us;
        let buses = played.iter_mut().zip(&step.buses);
        buses.for_each(|(played, bytes)| *played |= !bytes.is_empty());
        device.play(&step, told)?;
    }
    settle(device, time_us, &played, told)
}

/// Plays silence after the step at `time_us`, until all that was played to the legs of `played` is in what the device told. Gives the time of
/// the last step, µs.
///
/// # Errors
/// [`ReplayError::Device`].
pub fn settle(
    device: &mut dyn Device,
    mut time_us: u64,
    played: &[bool; LEGS],
    told: &mut dyn FnMut(DeviceMessage),
) -> Result<u64, ReplayError> {
    device.settle(told)?;
    let mut covered = Covered::default();
    for _ in 0..MOST_SILENCES {
        let mut hear = |message: DeviceMessage| {
            covered.hear(&message);
            told(message);
        };
        for _ in 0..SILENT_STEPS {
            time_us += SILENT_STEP_US;
            let silent = BusStep {
                time_us,
                ..BusStep::default()
            };
            device.play(&silent, &mut hear)?;
        }
        device.settle(&mut hear)?;
        if covered.all_of(played) {
            break;
        }
    }
    Ok(time_us)
}

/// Of which legs the device has told an estimate that was begun after all samples had come, by the device's own clock; of a robot that walks an
/// estimate is of all.
#[derive(Default)]
struct Covered {
    /// When the device first counted what it had heard, µs.
    counted_us: Option<u64>,
    /// When each leg's last estimate was begun, µs.
    begun_us: [u64; LEGS],
}

impl Covered {
    fn hear(&mut self, message: &DeviceMessage) {
        match message {
            DeviceMessage::Counters(counters) => {
                self.counted_us.get_or_insert(counters.time_us);
            }
            DeviceMessage::Estimate(estimate) => {
                if let Some(begun) = self.begun_us.get_mut(usize::from(estimate.leg)) {
                    *begun = estimate.time_us;
                }
            }
            DeviceMessage::Walk(walk) => self.begun_us = [walk.time_us; LEGS],
            _ => {}
        }
    }

    fn all_of(&self, played: &[bool; LEGS]) -> bool {
        let Some(counted) = self.counted_us else {
            return false;
        };
        let mut legs = played.iter().zip(&self.begun_us);
        legs.all(|(played, begun)| !played || *begun >= counted)
    }
}
