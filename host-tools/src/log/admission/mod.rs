//! Which rows of a log are let in: the one gate that all commands read through, in memory that does not grow with the log.
//!
//! A row that no robot can have produced is left out, counted, and the first of its kind is named with its place. What no robot
//! produces follows from the log itself and from physics, not from one robot: a position moves by what its velocity integrates to; a
//! value that is many times any other value of its channel, and gone some rows later, is no motion; a stamp lies between its neighbours.
//! The URDF's limits of effort and velocity count with a wide margin. A value that stays is never left out: it is a unit, a sign or
//! another robot, which [`crate::detect::mismatch`] names.
//!
//! Each row is judged with the [`AHEAD`] rows after it at hand, so that a value that stays is told from one that goes.
//!
//! Files beside:
//!
//! - `channels`: what is known of each joint's channels: values that are gone some rows later, velocities that no position follows
//! - `left_out`: what was left out, and why
//! - `positions`: positions that jump: back after some rows (a second publisher), or for good (a seam)

mod channels;
mod left_out;
mod positions;
#[cfg(test)]
mod tests;

pub(crate) use channels::{MOST_ROWS, TIMES};
use std::collections::VecDeque;

use super::channel::Channel;
use super::checks::{BRIDGED, LONGEST_GAP};
use super::columns::Columns;
use super::error::{Place, Problem, Unit};
use super::slots::{Slots, TIME};
use super::warning::{Cause, Warning};
use channels::Levels;
use left_out::LeftOut;
use positions::Positions;

/// Rows after the one that is judged: at the least rate of a log ([`super::LEAST_RATE`]) more than a second, at 5 kHz 13 ms, longer than
/// what a damaged or a foreign message brings.
pub(super) const AHEAD: usize = 64;

/// Beyond this nothing is a measurement of a robot in any unit: N mm of the largest robots stay below 1e8, encoders' ticks below 1e9.
pub(crate) const NO_MEASUREMENT: f64 = 1e12;

/// The time after a seam that is left out, s: longer than a motion is followed over lost messages, so that every reader has a gap there
/// ([`BRIDGED`]).
const AFTER_SEAM: f64 = 1.2 * BRIDGED;

/// A row as it was read.
#[derive(Debug, Clone)]
struct Raw {
    line: u64,
    values: Vec<f64>,
}

impl Raw {
    fn t(&self) -> f64 {
        self.values[TIME]
    }
}

/// What becomes of the next row.
pub(super) enum Step {
    /// It is let in, with this number.
    Row(u64),
    /// It is left out.
    LeftOut,
    /// There is none.
    End,
}

/// Judges rows as they come.
#[derive(Debug)]
pub(super) struct Admission {
    /// Slots that are read, of time, joints and all else.
    slots: Vec<usize>,
    positions: Positions,
    levels: Levels,
    ahead: VecDeque<Raw>,
    spare: Vec<Vec<f64>>,
    /// The last row that was let in, since the last seam.
    kept: Option<Raw>,
    /// The last row that jumped and came back.
    foreign: Option<Raw>,
    /// The end of what is left out after a seam, s.
    seam_until: f64,
    left_out: LeftOut,
}

impl Admission {
    pub(super) fn new(columns: &Columns, unit: Unit) -> Self {
        let slots = columns.slots;
        Self {
            slots: (0..slots.count())
                .filter(|slot| columns.has_slot(*slot))
                .collect(),
            positions: Positions::new(columns),
            levels: Levels::new(columns),
            ahead: VecDeque::with_capacity(AHEAD + 1),
            spare: Vec::new(),
            kept: None,
            foreign: None,
            seam_until: f64::NEG_INFINITY,
            left_out: LeftOut::new(unit),
        }
    }

    /// Whether more rows are to be read before the next one is judged.
    pub(super) fn wants_more(&self) -> bool {
        self.ahead.len() <= AHEAD
    }

    /// Takes a row as it was read.
    pub(super) fn push(&mut self, line: u64, values: &[f64]) {
        let mut own = self.spare.pop().unwrap_or_default();
        own.clear();
        own.extend_from_slice(values);
        self.ahead.push_back(Raw { line, values: own });
    }

    /// Judges the next row; its numbers are put into `values` if it is let in.
    pub(super) fn next(&mut self, values: &mut Vec<f64>) -> Step {
        let verdict = self.judge();
        let Some(mut row) = self.ahead.pop_front() else {
            return Step::End;
        };
        self.left_out.rows += 1;
        let Some((cause, slot)) = verdict else {
            self.levels.let_in(&row.values);
            values.clone_from(&row.values);
            let line = row.line;
            if let Some(last) = &mut self.kept {
                std::mem::swap(last, &mut row);
                self.spare.push(row.values);
            } else {
                self.kept = Some(row);
            }
            return Step::Row(line);
        };
        self.left_out.add(cause, &row, slot);
        match cause {
            Cause::Jump => self.foreign = Some(row),
            _ => self.spare.push(row.values),
        }
        Step::LeftOut
    }

    /// Why the next row is to be left out, and the slot that shows it; none if it is not.
    fn judge(&mut self) -> Option<(Cause, usize)> {
        let row = self.ahead.front()?;
        let kept = self.kept.as_ref();
        if self.stamp_is_wrong() {
            return Some((Cause::Stamp, TIME));
        }
        let no_measurement =
            |slot: &&usize| **slot != TIME && row.values[**slot].abs() > NO_MEASUREMENT;
        if let Some(slot) = self.slots.iter().find(no_measurement) {
            return Some((Cause::Impossible, *slot));
        }
        if row.t() < self.seam_until {
            return Some((Cause::AfterSeam, TIME));
        }
        if let Some(foreign) = &self.foreign
            && self.positions.are_equal(&foreign.values, &row.values)
        {
            return Some((Cause::Jump, self.positions.first()));
        }
        // A spike is judged first: a row's garbage must not make its positions look foreign.
        if let Some(slot) = self
            .levels
            .spike(&self.ahead, kept.map(|kept| &kept.values))
        {
            return Some((Cause::Impossible, slot));
        }
        let Some(kept) = kept else {
            if let Some(slot) = self.positions.zeros_first(&self.ahead) {
                return Some((Cause::ZerosFirst, slot));
            }
            let foreign = self.positions.foreign_first(&self.ahead);
            return foreign.map(|slot| (Cause::Jump, slot));
        };
        let jump = self.positions.jump(kept, &self.ahead)?;
        if jump.comes_back {
            return Some((Cause::Jump, jump.slot));
        }
        let (now, periods) = (row.t(), self.positions.gap(&self.ahead));
        let zeros = self.positions.is_zero(&kept.values, jump.slot);
        self.seam_until = now + AFTER_SEAM.max(periods);
        self.kept = None;
        self.foreign = None;
        let cause = if zeros {
            Cause::ZerosFirst
        } else {
            Cause::Seam
        };
        Some((cause, jump.slot))
    }

    /// Whether the next row's stamp does not lie between those about it, which go on without it.
    fn stamp_is_wrong(&self) -> bool {
        let Some(row) = self.ahead.front() else {
            return false;
        };
        let (t, next) = (row.t(), self.ahead.get(1).map(Raw::t));
        let Some(next) = next else {
            return false;
        };
        match self.kept.as_ref().map(Raw::t) {
            Some(before) => {
                let goes_on = next > before && next - before < LONGEST_GAP;
                goes_on && (t < before || t > next)
            }
            None => {
                let then = self.ahead.get(2).map_or(next, Raw::t);
                let goes_on = then >= next && then - next < LONGEST_GAP;
                goes_on && (t > next || next - t > LONGEST_GAP)
            }
        }
    }

    /// What a user should know of it, once all is read.
    pub(super) fn warnings(&self, columns: &Columns) -> Vec<Warning> {
        self.left_out.warnings(columns)
    }

    /// What makes the log useless: rows of two publishers, of which neither is the log's.
    pub(super) fn problem(&self, columns: &Columns) -> Option<(Place, Problem)> {
        self.left_out.problem(columns)
    }
}

/// Recorded joints: their slots of position, velocity and torque.
fn motion_slots(columns: &Columns) -> impl Iterator<Item = (usize, [usize; 3])> + '_ {
    let slots: Slots = columns.slots;
    let of = move |joint| Channel::MOTION.map(|channel| slots.of(channel, joint));
    columns.joints().map(move |joint| (joint, of(joint)))
}
