//! Where a leg's zeros are: from which count of each motor its joint's angle is told, in which direction, and whether that still holds.
//!
//! A motor of this family knows its rotor's angle within one turn and counts turns from its power-up on, so a joint's zero is another count
//! after each ([`go2`](crate::go2); unitree_actuator_sdk #11, #26, of motors sold alone). What a robot's main board adds never is on the bus.
//! Nothing is known until a host says where a joint is, and what it said holds while the motor counts on. It is void
//!
//! - after a jump: the position is elsewhere than the speed has taken it, by a tenth of a turn or more;
//! - after a silence of 0.1 s: the motor may have been switched off, and a joint that meanwhile moved by a turn says what it said before;
//! - after a restart of the board, which is a silence of nobody knows how long. The zeros are kept; a host that knows that the motors were
//!   not switched off can have them back.
//!
//! A leg without all its zeros is listened to and counted, and is in no estimate.

use super::alignment::Alignment;
use super::identity::Identity;
use crate::Real;
use crate::bus::{Breaks, Listener, position_counts};
use crate::go2::{ACTUATORS, BEYOND_STOPS, Go2, JOINTS_PER_LEG, Leg, position_limits, quanta};
use crate::slot::Slot;
use crate::wire::{Outcome, Positions, SetZero, Zero};

/// A leg's replies to samples.
pub(super) type LegAlignment<T> = Alignment<T, Go2, JOINTS_PER_LEG>;

/// What a motor said longer ago is not where it is now, µs.
const FRESH_US: u64 = 100_000;
/// Greatest speed of a joint that is held still, counts of the rotor: 0.2 rad/s of a hip, six deviations of its noise.
const STILL: u16 = 52;
/// A zero that is set anew within so many counts is the same, 0.005 rad of a hip: what was learnt still holds.
const SAME: u32 = 165;

/// When a joint (its place in the leg) rests for its zero to be set: the greatest speed, rad/s, and how far (rad) positions may be off for their zeros
/// to be the same.
pub fn rest(joint: usize) -> [f64; 2] {
    let [position, speed, _] = quanta(joint);
    [f64::from(STILL) * speed, f64::from(SAME) * position]
}

/// How each zero is kept in a snapshot: its count, what is known of it, and the angle at which it was set.
pub(super) const NUMBERS: usize = 3 * JOINTS_PER_LEG;

/// What is known of a leg's zeros. All zeros at first: nothing.
#[derive(Clone, Copy, Debug)]
pub(super) struct Zeros {
    joints: [Zero; JOINTS_PER_LEG],
    /// The angles at which they were set, rad.
    angles: [f32; JOINTS_PER_LEG],
    /// All are known.
    known: bool,
}

/// What became of a zero that was set.
pub(super) enum Done {
    /// It is what it was.
    Same,
    /// What was learnt until now was of another one.
    Another,
}

impl Zeros {
    /// Nothing known.
    pub(super) const fn new() -> Self {
        Self {
            joints: [Zero::Unknown; JOINTS_PER_LEG],
            angles: [0.0; JOINTS_PER_LEG],
            known: false,
        }
    }

    /// Whether all are known.
    #[inline]
    pub(super) fn are_known(&self) -> bool {
        self.known
    }

    /// Whether a host has set all of them, and they hold.
    pub(super) fn are_set(&self) -> bool {
        self.joints.iter().all(|zero| *zero == Zero::Set)
    }

    /// The angles at which they were set, rad.
    pub(super) fn angles(&self) -> &[f32; JOINTS_PER_LEG] {
        &self.angles
    }

    /// What is told of them.
    pub(super) fn told(&self) -> [Zero; JOINTS_PER_LEG] {
        self.joints
    }

    /// Begins as a device of this identity does.
    pub(super) fn begin<T: Real>(&mut self, identity: &Identity, alignment: &mut LegAlignment<T>) {
        self.set_positions(identity.positions, alignment);
    }

    /// Takes positions to be angles, or counts whose zeros are still to be said.
    pub(super) fn set_positions<T: Real>(
        &mut self,
        positions: Positions,
        alignment: &mut LegAlignment<T>,
    ) {
        (0..JOINTS_PER_LEG).for_each(|joint| alignment.set_zero(joint, 0, false));
        self.joints = [match positions {
            Positions::FromPowerUp => Zero::Unknown,
            Positions::Absolute => Zero::Absolute,
        }; JOINTS_PER_LEG];
        self.judge();
    }

    fn judge(&mut self) {
        self.known = self.joints.iter().all(|zero| zero.is_known());
    }

    /// Takes note of motors that no longer count from where they did, or were silent; whether a zero is void that was not.
    #[cold]
    pub(super) fn void<T: Real>(&mut self, breaks: Breaks, silent: bool) -> bool {
        let places = LegAlignment::<T>::PLACES;
        let before = self.joints;
        for (zero, motor) in self.joints.iter_mut().zip(places) {
            let has = |bits: u8| bits >> motor & 1 == 1;
            // What never held, or holds whatever a motor says, is no matter of the motor's.
            if matches!(*zero, Zero::Set | Zero::Restarted) {
                *zero = match *zero {
                    _ if has(breaks.exchanged) => Zero::Exchanged,
                    _ if has(breaks.jumped) => Zero::Jumped,
                    _ if silent => Zero::Silent,
                    same => same,
                };
            }
        }
        self.judge();
        self.joints != before
    }

    /// Takes a joint's angle to be what the host says, at `now_us`.
    pub(super) fn set<T: Real>(
        &mut self,
        leg: Leg,
        asked: &SetZero,
        listener: &Slot<Listener>,
        alignment: &mut LegAlignment<T>,
        now_us: u64,
    ) -> Result<Done, Outcome> {
        let joint = usize::from(asked.joint);
        let (Some(actuator), Some([lower, upper])) = (
            ACTUATORS.get(joint),
            position_limits(leg).get(joint).copied(),
        ) else {
            return Err(Outcome::NoSuchJoint);
        };
        let angle = f64::from(asked.angle);
        if !(lower - BEYOND_STOPS..=upper + BEYOND_STOPS).contains(&angle) {
            return Err(Outcome::OutOfRange);
        }
        let motor = LegAlignment::<T>::PLACES.get(joint).copied();
        let heard = motor.and_then(|motor| listener.get()?.motor(motor));
        let Some(state) = heard.filter(|state| state.time_us.abs_diff(now_us) <= FRESH_US) else {
            return Err(Outcome::NotHeard);
        };
        if state.speed.unsigned_abs() > STILL {
            return Err(Outcome::Moves);
        }
        let turned = if asked.reversed { -angle } else { angle };
        let counts = position_counts(actuator.gear, turned).map_err(|_| Outcome::OutOfRange)?;
        let zero = state.position.wrapping_sub(counts);
        let (before, reversed) = alignment.zero(joint);
        let near = before.wrapping_sub(zero).unsigned_abs() <= SAME && reversed == asked.reversed;
        let Some(place) = self.joints.get_mut(joint) else {
            return Err(Outcome::NoSuchJoint);
        };
        // What was learnt before a zero became void was of one that held.
        let wrong = place.is_known() && !near;
        *place = Zero::Set;
        if let Some(place) = self.angles.get_mut(joint) {
            *place = asked.angle;
        }
        alignment.set_zero(joint, zero, asked.reversed);
        self.judge();
        Ok(if wrong { Done::Another } else { Done::Same })
    }

    /// Takes the zeros to hold that were kept before a restart; false if there are none, or none that have held since.
    pub(super) fn trust(&mut self) -> bool {
        let mut trusted = false;
        for zero in &mut self.joints {
            if *zero == Zero::Restarted {
                (*zero, trusted) = (Zero::Set, true);
            }
        }
        self.judge();
        trusted
    }

    /// The n-th number of a snapshot.
    pub(super) fn number<T: Real>(&self, alignment: &LegAlignment<T>, n: usize) -> Option<f64> {
        let joint = n / 3;
        let zero = self.joints.get(joint)?;
        let (count, reversed) = alignment.zero(joint);
        let angle = self.angles.get(joint).copied().map(f64::from)?;
        let kept = matches!(zero, Zero::Set | Zero::Restarted);
        Some(match (n % 3, kept, reversed) {
            (0, ..) => f64::from(count),
            (2, ..) => angle,
            (_, false, _) => 0.0,
            (_, true, false) => 1.0,
            (_, true, true) => -1.0,
        })
    }

    /// Takes the n-th number of a snapshot. A device whose positions are angles has no use for it.
    pub(super) fn set_number<T: Real>(
        &mut self,
        alignment: &mut LegAlignment<T>,
        n: usize,
        number: f64,
    ) {
        let joint = n / 3;
        let Some(zero) = self.joints.get_mut(joint) else {
            return;
        };
        if *zero == Zero::Absolute {
            return;
        }
        let (count, reversed) = alignment.zero(joint);
        if n.is_multiple_of(3) {
            alignment.set_zero(joint, number as i32, reversed);
        } else if n % 3 == 2 {
            if let Some(angle) = self.angles.get_mut(joint) {
                *angle = number as f32;
            }
        } else if number != 0.0 {
            alignment.set_zero(joint, count, number < 0.0);
            *zero = Zero::Restarted;
        }
    }
}
