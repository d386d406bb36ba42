//! What is known of each joint's channels: values that are gone some rows later, velocities that no position follows.

use std::collections::VecDeque;
use std::ops::Range;

use super::super::columns::Columns;
use super::super::slots::TIME;
use super::{AHEAD, Raw, motion_slots};
use crate::robust;

/// A value so many times any other of its channel, seen so far or in the rows ahead, is no motion and no load: between neighbours at
/// 50 Hz and more, torque and velocity of a robot that is driven change by less than their range.
pub(crate) const TIMES: f64 = 10.0;
/// Beyond [`LIMITS`] times the limit that the URDF states so many times suffice.
const TIMES_BEYOND: f64 = 3.0;
/// Limits are stated roughly, and peaks lie above continuous ratings: up to three times as high in motors' data sheets.
const LIMITS: f64 = 3.0;
/// Rows of one damaged message, and of those that hold it: more of them in the rows ahead are a signal.
pub(crate) const MOST_ROWS: usize = 4;
/// The same beyond limits: a burst.
const MOST_BEYOND: usize = AHEAD / 2;
/// Fewer rows than this tell nothing of a channel's range.
const LEAST_ROWS: u64 = 16;
/// Velocities up to this, rad/s or m/s, are noise of a differentiator or the first motion of a log at rest.
const LEAST_VELOCITY: f64 = 1.0;
/// Torques up to this share of the limit are the first load of a log without.
const LEAST_EFFORT: f64 = 0.01;
/// An accelerometer of the widest range (200 g) stays below 2 000 m/s², a gyroscope (4 000 °/s) below 70 rad/s; in mg and °/s such
/// numbers are usual, and stay.
const LEAST_IMU: f64 = 100.0;
/// From so many times the greatest velocity so far a velocity is compared with the positions about it.
const COMPARED: f64 = 1.5;
/// A torque that leaves the line between its neighbours by this share of the greatest one, and comes back: less than that spoils little.
const LEAP: f64 = 0.2;
/// What is usual, so many times over, is no noise: of 60 values of Gaussian noise the eleventh largest lies at 1.3 σ, this at 18 σ.
const LEAPS: f64 = 13.0;
/// Rows of one damaged value: a reader that is faster than its messages reads one twice.
const LEAP_ROWS: usize = 2;
/// Of the largest values ahead so many may be of other leaps, and of the rows beside each: of three, as a recorder that damages one value in twenty
/// has them.
const OTHER_LEAPS: usize = 10;
/// Fewer rows are ahead where a log ends: no more than one in so many, or what is usual would be the least of its noise.
const OTHER_ROWS: usize = 6;
/// A velocity that differs from that of the positions by so many times what nine tenths of the rows ahead differ by is not theirs.
const NOT_THEIRS: f64 = 10.0;

/// A velocity that leaves the line between its neighbours by so many times what is usual, and by so much, rad/s (m/s), has taken a blow. Of Gaussian
/// noise one row in 10⁴ does; six steps of a Go2's velocity, 0.0155 rad/s each. Touch-downs of simulated trots at 100 and 200 Hz: 6 to 16 times, 0.48
/// to 2.1 rad/s.
const BENDS: f64 = 3.0;
const LEAST_BEND: f64 = 0.1;

/// By how much a value of these rows usually leaves the line between its neighbours; the few largest may be leaps themselves.
fn usual_off(value: &dyn Fn(usize) -> f64, rows: Range<usize>) -> f64 {
    let off = |n: usize| (value(n + 1) - 0.5 * (value(n) + value(n + 2))).abs();
    let mut all: Vec<f64> = rows.map(off).collect();
    all.sort_by(|a, b| b.total_cmp(a));
    let others = OTHER_LEAPS.min(all.len() / OTHER_ROWS);
    all.get(others).copied().unwrap_or(f64::INFINITY)
}

/// A channel whose values may be gone some rows later.
#[derive(Debug)]
struct Level {
    slot: usize,
    /// The position's slot, of a velocity.
    position: Option<usize>,
    /// The velocity's slot, of a torque.
    velocity: Option<usize>,
    /// What the robot may reach; infinite if not known.
    limit: f64,
    /// What is never a spike.
    least: f64,
    /// The greatest value let in.
    greatest: f64,
    /// The last two values let in.
    last: [f64; 2],
}

/// Channels of all joints, and of the IMU.
#[derive(Debug)]
pub(super) struct Levels {
    levels: Vec<Level>,
    rows: u64,
}

impl Levels {
    pub(super) fn new(columns: &Columns) -> Self {
        let mut levels = Vec::new();
        for (joint, [q, dq, tau]) in motion_slots(columns) {
            let body = &columns.robot().bodies()[joint];
            // A URDF that states a limit of 0 states none.
            let limit = |limit: f64| if limit > 0.0 { limit } else { f64::INFINITY };
            let effort = limit(body.effort);
            let level = |slot, position, velocity, limit, least| Level {
                slot,
                position,
                velocity,
                limit,
                least,
                greatest: 0.0,
                last: [0.0; 2],
            };
            levels.push(level(
                dq,
                Some(q),
                None,
                limit(body.velocity),
                LEAST_VELOCITY,
            ));
            let least = if effort.is_finite() {
                LEAST_EFFORT * effort
            } else {
                0.0
            };
            levels.push(level(tau, None, Some(dq), effort, least));
        }
        let slots = columns.slots;
        let imu = (slots.gyro()..slots.acc() + 3).filter(|slot| columns.has_slot(*slot));
        levels.extend(imu.map(|slot| Level {
            slot,
            position: None,
            velocity: None,
            limit: f64::INFINITY,
            least: LEAST_IMU,
            greatest: 0.0,
            last: [0.0; 2],
        }));
        Self { levels, rows: 0 }
    }

    /// Notes a row that is let in.
    pub(super) fn let_in(&mut self, values: &[f64]) {
        self.rows += 1;
        for level in &mut self.levels {
            let value = values[level.slot];
            level.greatest = level.greatest.max(value.abs());
            level.last = [level.last[1], value];
        }
    }

    /// The slot of a value of the first row ahead that no robot reaches for a moment; `before`: the last row that was let in.
    pub(super) fn spike(&self, ahead: &VecDeque<Raw>, before: Option<&Vec<f64>>) -> Option<usize> {
        if self.rows + (ahead.len() as u64) < LEAST_ROWS {
            return None;
        }
        let row = &ahead.front()?.values;
        let spike = |level: &&Level| {
            let size = row[level.slot].abs();
            let is_large = size > COMPARED * level.greatest && size > level.least;
            // The usual row ends with both sizes.
            (is_large && (level.is_gone(ahead, size) || level.is_not_the_positions(ahead, before)))
                || level.leaps(ahead, before)
        };
        self.levels.iter().find(spike).map(|level| level.slot)
    }
}

impl Level {
    fn is_gone(&self, ahead: &VecDeque<Raw>, size: f64) -> bool {
        let beyond = size > LIMITS * self.limit;
        let (times, most) = if beyond {
            (TIMES_BEYOND, MOST_BEYOND.min(ahead.len() / 2).max(1))
        } else {
            (TIMES, MOST_ROWS)
        };
        size > times * self.greatest && self.count_from(ahead, size / times) <= most
    }

    /// A torque that leaves quiet neighbours for one or two rows, and no velocity follows: a robot's torque of that size rises and falls in more rows
    /// than one, or moves it, and a blow against it shows in the velocity too. At 200 Hz and less a foot's touch-down lasts a row or two: there the
    /// velocity alone tells it from damage, by what its own rows differ by at that rate.
    fn leaps(&self, ahead: &VecDeque<Raw>, before: Option<&Vec<f64>>) -> bool {
        let (Some(dq), Some(before)) = (self.velocity, before) else {
            return false;
        };
        let (own, [before_last, last]) = (ahead[0].values[self.slot], self.last);
        let least = self.least.max(LEAP * self.greatest);
        if (own - last).abs() <= least || ahead.len() < LEAST_ROWS as usize {
            return false;
        }
        let at = |n: usize| ahead[n].values[self.slot];
        (1..=LEAP_ROWS).any(|back| {
            let between = 0.5 * (last + at(back));
            let off = (own - between).abs();
            let is_out = (0..back).all(|n| (at(n) - between).abs() > 0.5 * off);
            let about = [before_last, last, at(back), at(back + 1)];
            let is_quiet = about
                .windows(2)
                .all(|two| (two[1] - two[0]).abs() <= LEAP * off);
            if off <= least || !is_out || !is_quiet {
                return false;
            }
            let velocity = |n: usize| ahead[n].values[dq];
            let rows = back..ahead.len() - 2;
            let changes = rows.clone().map(|n| (velocity(n + 2) - velocity(n)).abs());
            let change = (velocity(back) - before[dq]).abs();
            let between = 0.5 * (before[dq] + velocity(back));
            let own = (0..back).map(|n| (velocity(n) - between).abs());
            let bend = own.fold(0.0, f64::max);
            let is_blow = bend > LEAST_BEND && bend > BENDS * usual_off(&velocity, rows.clone());
            off > LEAPS * usual_off(&at, rows)
                && change <= 2.0 * changes.fold(0.0, f64::max)
                && !is_blow
        })
    }

    /// Rows ahead, with the first, in which it is greater than so much.
    fn count_from(&self, ahead: &VecDeque<Raw>, size: f64) -> usize {
        let above = |row: &&Raw| row.values[self.slot].abs() > size;
        ahead.iter().filter(above).count()
    }

    /// A velocity, for some rows, that the positions about it do not have, though in the rows ahead they have the reported one.
    fn is_not_the_positions(&self, ahead: &VecDeque<Raw>, before: Option<&Vec<f64>>) -> bool {
        let (Some(q), Some(before)) = (self.position, before) else {
            return false;
        };
        let off = |last: &[f64], own: &[f64], next: &[f64]| {
            let velocity = (next[q] - last[q]) / (next[TIME] - last[TIME]);
            (own[self.slot] - velocity).abs()
        };
        let rows: Vec<&[f64]> = std::iter::once(before.as_slice())
            .chain(ahead.iter().map(|row| row.values.as_slice()))
            .collect();
        let mut all = rows.windows(3).map(|rows| off(rows[0], rows[1], rows[2]));
        let Some(own) = all.next() else {
            return false;
        };
        let size = ahead[0].values[self.slot].abs();
        let usual = robust::quantile(all, 0.9);
        own > 0.5 * size
            && own > LEAST_VELOCITY
            && usual.is_some_and(|usual| own > NOT_THEIRS * usual)
            && self.count_from(ahead, size / COMPARED) <= MOST_ROWS
    }
}
