//! What is counted alike of a robot that hangs and of one that walks.

use crate::bus::Listener;
use crate::go2::{Go2, JOINTS_PER_LEG};
use crate::robot::{Robot, places};
use crate::slot::Slot;
use crate::wire::{LegCounters, Load, Losses};

/// The place of each joint's motor in a polling cycle.
const MOTORS: [usize; JOINTS_PER_LEG] = places(<Go2 as Robot<JOINTS_PER_LEG>>::MOTOR_IDS);

/// What is told without a host: sums that grow, and wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Health {
    /// Samples of all legs.
    pub samples: u32,
    /// What was lost or refused of all buses, of the IMU and of the host link, and steps over budget.
    pub losses: u32,
}

/// A leg's counters: what its listener counts, and `own`.
pub(super) fn heard(listener: &Slot<Listener>, own: LegCounters) -> LegCounters {
    let Some(listener) = listener.get() else {
        return LegCounters::ZERO;
    };
    let (frames, cycles) = (listener.frames(), listener.cycles());
    LegCounters {
        commands: frames.commands,
        replies: frames.replies,
        bad_crc: frames.bad_crc,
        short: frames.short,
        skipped_bytes: frames.skipped_bytes,
        unused_replies: cycles.unused_replies,
        incomplete: cycles.incomplete,
        motor_faults: cycles.motor_faults,
        overheated: cycles.overheated,
        stuck: cycles.stuck,
        temperatures: MOTORS.map(|motor| listener.temperature(motor)),
        ..own
    }
}

/// What is told without a host, of all legs' counters, of what was lost around the application and of steps over budget.
pub(super) fn health(
    legs: impl Iterator<Item = LegCounters>,
    losses: &Losses,
    load: &Load,
) -> Health {
    let imu_and_host = [&losses.host_line, &losses.imu];
    let lines = losses.buses.iter().chain(imu_and_host);
    let lost = lines.fold(load.over_budget, |sum, line| {
        sum.wrapping_add(line.overruns).wrapping_add(line.errors)
    });
    legs.fold(
        Health {
            samples: 0,
            losses: lost,
        },
        |sum, leg| {
            let lost = [
                leg.rejected,
                leg.unfolded,
                leg.unsolved,
                leg.surplus,
                leg.motor_faults,
                leg.overheated,
                leg.stuck,
                leg.incomplete,
                leg.bad_crc,
                leg.short,
            ];
            Health {
                samples: sum.samples.wrapping_add(leg.samples),
                losses: lost.into_iter().fold(sum.losses, u32::wrapping_add),
            }
        },
    )
}
