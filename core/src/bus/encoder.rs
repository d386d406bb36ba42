//! Encoders that no longer follow their motor.

use super::frame::Reply;

/// Watches one motor's encoder.
///
/// A position that stays the same to the last count is no fault by itself: friction holds a motor. It is one if meanwhile
///
/// - the speed says that the motor has moved by more than [`SLIP`] counts and [`SLIP_RATE`] counts a second, for [`SLIPPED_US`]
///   at least: the speed of a motor at rest is noise about zero, and its integral stays below; or
/// - the speed stays the same to the last count as well, for [`FROZEN_US`], while the torque changes by [`TORQUE_CHANGE`]
///   counts: the speed of an encoder that works is never without noise.
#[derive(Clone, Copy, Debug)]
pub(super) struct Encoder {
    position: i32,
    speed: i16,
    /// Least and greatest torque since the position is what it is.
    torque: [i16; 2],
    /// Since when the position is what it is, and when it was last seen, µs.
    since_us: u64,
    last_us: u64,
    /// The speed's integral since then, speed counts × µs.
    travel: i64,
    speed_changed: bool,
}

/// Counts of position, rotor side, by which speed and position may disagree: 0.115 rad of the rotor, 0.018 rad of a hip.
const SLIP: i64 = 600;
/// The same per second: 0.05 rad/s of a hip.
const SLIP_RATE: i64 = 1650;
/// A motor that is polled more often than it measures repeats its position for less than this, µs.
const SLIPPED_US: u64 = 10_000;
const FROZEN_US: u64 = 100_000;
const TORQUE_CHANGE: i32 = 16;

/// Counts of position per second and count of speed: 2π/256 rad/s over 2π/32768 rad.
const POSITION_PER_SPEED: i64 = 128;

impl Encoder {
    pub(super) const fn new() -> Self {
        Self {
            position: 0,
            speed: 0,
            torque: [0; 2],
            since_us: 0,
            last_us: 0,
            travel: 0,
            speed_changed: false,
        }
    }

    /// Takes note of a reply that was heard at `time_us`; whether the encoder is stuck.
    #[inline]
    pub(super) fn is_stuck(&mut self, reply: &Reply, time_us: u64) -> bool {
        if reply.position != self.position || time_us < self.last_us || self.last_us == 0 {
            *self = Self {
                position: reply.position,
                speed: reply.speed,
                torque: [reply.torque; 2],
                since_us: time_us,
                last_us: time_us,
                travel: 0,
                speed_changed: false,
            };
            return false;
        }
        self.is_stuck_at_rest(reply, time_us)
    }

    /// The same of a reply whose position is that of the one before.
    #[inline(never)]
    fn is_stuck_at_rest(&mut self, reply: &Reply, time_us: u64) -> bool {
        let step_us = (time_us - self.last_us) as i64;
        self.last_us = time_us;
        self.travel = self
            .travel
            .saturating_add(i64::from(reply.speed).saturating_mul(step_us));
        self.speed_changed |= reply.speed != self.speed;
        let [least, greatest] = &mut self.torque;
        (*least, *greatest) = ((*least).min(reply.torque), (*greatest).max(reply.torque));
        let pushed = i32::from(*greatest) - i32::from(*least) >= TORQUE_CHANGE;

        let held_us = time_us - self.since_us;
        let moved = self
            .travel
            .saturating_abs()
            .saturating_mul(POSITION_PER_SPEED);
        let allowed = (SLIP * 1_000_000).saturating_add((held_us as i64).saturating_mul(SLIP_RATE));
        (held_us >= SLIPPED_US && moved > allowed)
            || (held_us >= FROZEN_US && pushed && !self.speed_changed)
    }
}
