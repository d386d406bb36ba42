//! Zeros that a device is told while its robot rests.

use proprio_core::go2::{JOINTS_PER_LEG, LEGS};
use proprio_core::wire::{Action, DeviceMessage, HostMessage, Positions, Request, SetZero};
use proprio_host::device::power_up::PowerUp;
use proprio_host::device::replay::resting;
use proprio_host::device::{Device, DeviceError};

use crate::motion::SAMPLE_US;

/// Steps at rest before each zero is set.
const RESTING: usize = 10;

/// Has `device` hear a robot that rests at `angles` (rad), and sets the zeros of all its joints there: its legs are on trial from then on. Gives the
/// time of the next step, µs.
///
/// # Errors
/// The device's.
pub fn set_where_it_rests(
    device: &mut dyn Device,
    angles: &[[f64; JOINTS_PER_LEG]; LEGS],
    told: &mut dyn FnMut(DeviceMessage),
) -> Result<u64, DeviceError> {
    let mut id = 0;
    let mut ask = |device: &mut dyn Device, action| {
        id += 1;
        device.command(&HostMessage::Request(Request { id, action }))
    };
    ask(device, Action::SetPositions(Positions::FromPowerUp))?;
    let mut time_us = SAMPLE_US;
    for (leg, joint) in (0..LEGS).flat_map(|leg| (0..JOINTS_PER_LEG).map(move |joint| (leg, joint)))
    {
        for _ in 0..RESTING {
            device.play(&resting(time_us, angles, &PowerUp::NONE), told)?;
            time_us += SAMPLE_US;
        }
        device.settle(told)?;
        let asked = SetZero {
            leg: leg as u8,
            joint: joint as u8,
            angle: angles[leg][joint] as f32,
            reversed: false,
        };
        ask(device, Action::SetZero(asked))?;
    }
    Ok(time_us)
}
