//! Encoders that no longer follow their motor, or that count from elsewhere than before.

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
    /// When the position was last seen, µs; whether it has been seen more than once, and since when.
    last_us: u64,
    rests: bool,
    since_us: u64,
    /// The speed's integral since then, speed counts × µs.
    travel: i64,
    speed_changed: bool,
}

/// What a motor has said last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorState {
    /// Position, 2π/32768 rad of the rotor.
    pub position: i32,
    /// Speed, 2π/256 rad/s of the rotor.
    pub speed: i16,
    /// When, µs.
    pub time_us: u64,
}

/// Whether a motor still counts its position from where it did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Counting {
    GoesOn,
    /// Its position is elsewhere than its speed has taken it.
    Jumped,
}

/// Counts of position, rotor side, by which speed and position may disagree: 0.115 rad of the rotor, 0.018 rad of a hip.
const SLIP: i64 = 600;
/// The same per second: 0.05 rad/s of a hip.
const SLIP_RATE: i64 = 1650;
/// A motor that is polled more often than it measures repeats its position for less than this, µs.
const SLIPPED_US: u64 = 10_000;
const FROZEN_US: u64 = 100_000;
const TORQUE_CHANGE: i32 = 16;

/// Counts of position, rotor side, between two replies that are no motion where the speed does not say so: a tenth of a turn. In the 10 ms
/// that a window bridges, 3000 rad/s² of a rotor (500 rad/s² of a hip, twice what its motor can do to a leg) make a quarter of that.
const JUMP: u32 = 3277;
/// Time that a speed is taken to last at most, µs.
const LONGEST_US: u64 = 1_000_000;

/// Counts of position per second and count of speed: 2π/256 rad/s over 2π/32768 rad.
const POSITION_PER_SPEED: i64 = 128;

impl Encoder {
    pub(super) const fn new() -> Self {
        Self {
            position: 0,
            speed: 0,
            torque: [0; 2],
            last_us: 0,
            rests: false,
            since_us: 0,
            travel: 0,
            speed_changed: false,
        }
    }

    /// What it has said last; nothing yet, if it has not.
    pub(super) fn state(&self) -> Option<MotorState> {
        (self.last_us > 0).then_some(MotorState {
            position: self.position,
            speed: self.speed,
            time_us: self.last_us,
        })
    }

    /// Whether a reply that was heard at `time_us` counts from where the one before did; to be asked before [`Self::is_stuck`].
    #[inline]
    pub(super) fn counting(&self, reply: &Reply, time_us: u64) -> Counting {
        let step = reply.position.wrapping_sub(self.position);
        match step.unsigned_abs() <= JUMP {
            true => Counting::GoesOn,
            false => self.counting_after(reply, step, time_us),
        }
    }

    #[cold]
    #[inline(never)]
    fn counting_after(&self, reply: &Reply, step: i32, time_us: u64) -> Counting {
        if self.last_us == 0 {
            return Counting::GoesOn;
        }
        // A silence that is longer is one whatever the position: that is the receiver's affair.
        let step_us = time_us.saturating_sub(self.last_us).min(LONGEST_US) as i64;
        let speeds = i64::from(self.speed) + i64::from(reply.speed);
        // The mean of the two speeds, in counts × 2 µs: a division of 64 bits is a library's.
        let moved = speeds * POSITION_PER_SPEED * step_us;
        let beyond = i64::from(step) * 2_000_000 - moved;
        match beyond.unsigned_abs() > u64::from(JUMP) * 2_000_000 {
            true => Counting::Jumped,
            false => Counting::GoesOn,
        }
    }

    /// Takes note of a reply that was heard at `time_us`; whether the encoder is stuck.
    #[inline]
    pub(super) fn is_stuck(&mut self, reply: &Reply, time_us: u64) -> bool {
        if reply.position != self.position || time_us < self.last_us || self.last_us == 0 {
            self.position = reply.position;
            self.speed = reply.speed;
            self.torque = [reply.torque; 2];
            self.last_us = time_us;
            self.rests = false;
            return false;
        }
        self.is_stuck_at_rest(reply, time_us)
    }

    /// The same of a reply whose position is that of the one before.
    #[inline(never)]
    fn is_stuck_at_rest(&mut self, reply: &Reply, time_us: u64) -> bool {
        if !self.rests {
            (self.rests, self.since_us) = (true, self.last_us);
            (self.travel, self.speed_changed) = (0, false);
        }
        let step_us = (time_us - self.last_us) as i64;
        self.last_us = time_us;
        self.travel = self
            .travel
            .saturating_add(i64::from(reply.speed).saturating_mul(step_us));
        self.speed_changed |= reply.speed != self.speed;
        self.speed = reply.speed;
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
