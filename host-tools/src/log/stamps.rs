//! Time stamps of a recorder that falls behind: rows are measured at an even pace, stamped late, and closer together until it has caught up.
//!
//! A row can be stamped late, not early: a row is measured at least a period before the next one, so that the earliest moment that the rows after
//! it leave for it is known (the lower envelope of the stamps; Cristian 1989, *Probabilistic clock synchronization*, bounds messages' times so). Whether stamps or envelope are right is for the motion to say: over the rows in question positions have moved by what
//! velocities integrate to on one of the two clocks. Rows that rest, and rows whose sender was not even, keep their stamps; messages that are
//! lost leave their gap.

use std::collections::VecDeque;

use super::channel::Channel;
use super::checks::BRIDGED;
use super::columns::Columns;
use super::error::{Place, Unit};
use super::slots::TIME;
use super::warning::Warning;
use crate::robust;

/// Rows that are read ahead: a second at 500 Hz, at 5 kHz 0.1 s; a recorder that has not caught up by then keeps its stamps.
const AHEAD: usize = 512;
/// Rows between the two stamps that a period is told by: more than a burst has, fewer than a lost message in a hundred leaves together.
const SPAN: usize = 64;
/// Share of the period that a row is late by to be looked at: stamps of 1 ms are late by half of it at 500 Hz.
const LATE: f64 = 0.25;
/// Share by which its neighbours are late with it.
const WITH_IT: f64 = 0.05;
/// A period is known to this share: rows that are on time must not seem late by those long after them.
const KNOWN: f64 = 2e-3;
/// What velocities leave of the positions' steps is at most this share, squared, of what the stamps leave: noise is in both alike, so that of two
/// clocks that are as good the shares are near 1, and of a wrong one the motion's part comes on top.
const CLEARLY: f64 = 0.5;

/// Share of a log's rows from which late stamps are told: computers that do other things too are late with one row in some thousands.
const SAID: f64 = 1e-3;

/// A row that waits for those after it.
#[derive(Debug)]
struct Held {
    line: u64,
    values: Vec<f64>,
}

impl Held {
    fn t(&self) -> f64 {
        self.values[TIME]
    }
}

/// Reads ahead and puts late stamps right.
#[derive(Debug)]
pub(super) struct Stamps {
    unit: Unit,
    /// Slots of each joint's position and velocity.
    joints: Vec<[usize; 2]>,
    /// Rows that those to be judged have after them.
    lookahead: usize,
    ahead: VecDeque<Held>,
    /// How many of them are judged.
    judged: usize,
    ended: bool,
    /// The last row that was given.
    last: Option<Held>,
    spare: Vec<Vec<f64>>,
    rows: u64,
    mended: u64,
    latest: f64,
    first: Option<u64>,
}

impl Stamps {
    pub(super) fn new(columns: &Columns, unit: Unit) -> Self {
        let slots = columns.slots;
        let of = |joint| [Channel::Q, Channel::Dq].map(|channel| slots.of(channel, joint));
        Self::of(unit, columns.joints().map(of).collect())
    }

    /// Of a log that is still being made: rows are given as they come, with their stamps.
    pub(super) fn live(columns: &Columns, unit: Unit) -> Self {
        Self {
            lookahead: 0,
            ..Self::new(columns, unit)
        }
    }

    fn of(unit: Unit, joints: Vec<[usize; 2]>) -> Self {
        Self {
            unit,
            joints,
            lookahead: AHEAD,
            ahead: VecDeque::new(),
            judged: 0,
            ended: false,
            last: None,
            spare: Vec::new(),
            rows: 0,
            mended: 0,
            latest: 0.0,
            first: None,
        }
    }

    /// Whether more rows are to be read before the next one is given.
    pub(super) fn wants_more(&self) -> bool {
        !self.ended && self.judged == 0 && self.ahead.len() < (2 * self.lookahead).max(1)
    }

    /// Takes a row.
    pub(super) fn push(&mut self, line: u64, values: &[f64]) {
        let mut own = self.spare.pop().unwrap_or_default();
        own.clear();
        own.extend_from_slice(values);
        self.ahead.push_back(Held { line, values: own });
    }

    /// No row follows.
    pub(super) fn end(&mut self) {
        self.ended = true;
    }

    /// The next row's number, its values put into `values`; none where there is none.
    pub(super) fn next(&mut self, values: &mut Vec<f64>) -> Option<u64> {
        if self.judged == 0 {
            self.judge();
        }
        let row = self.ahead.pop_front()?;
        self.judged -= 1;
        self.rows += 1;
        values.clone_from(&row.values);
        let line = row.line;
        let given = self.last.replace(row);
        self.spare.extend(given.map(|row| row.values));
        Some(line)
    }

    /// Judges as many rows as those after them tell of.
    fn judge(&mut self) {
        let stamps: Vec<f64> = self.ahead.iter().map(Held::t).collect();
        let count = stamps.len();
        let known = if self.ended {
            count
        } else {
            count.saturating_sub(self.lookahead)
        };
        self.judged = known;
        let Some(period) = period(&stamps) else {
            return;
        };
        let envelope = envelope(&stamps, period * (1.0 - KNOWN));
        let late = |n: usize| (stamps[n] - envelope[n]) / period;
        // A run is judged whole, if it ends within what is read ahead.
        if !self.ended {
            let on_time = (1..=known).rev().find(|&n| late(n) <= WITH_IT);
            self.judged = on_time.unwrap_or(known);
        }
        let mut from = 0;
        while from < self.judged {
            let is_late = |n: &usize| late(*n) > WITH_IT;
            let to = (from..self.judged).find(|n| !is_late(n));
            let to = to.unwrap_or(self.judged);
            let worst = (from..to).map(late).fold(0.0, f64::max);
            if worst > LATE && self.moves_by(&envelope, from, to) {
                self.mend(&envelope, from, to);
            }
            from = to.max(from + 1);
        }
    }

    /// Whether positions move by what velocities integrate to over rows `from..to` at the times of `envelope`, and not at their stamps.
    fn moves_by(&self, envelope: &[f64], from: usize, to: usize) -> bool {
        let [mut by_stamps, mut by_envelope] = [0.0; 2];
        for n in from..(to + 1).min(self.ahead.len()) {
            let row = &self.ahead[n];
            let before = match n.checked_sub(1) {
                Some(before) => &self.ahead[before],
                None => match &self.last {
                    Some(last) => last,
                    None => continue,
                },
            };
            let time = |n: usize| {
                let mended = n >= from && n < to;
                if mended {
                    envelope[n]
                } else {
                    self.ahead[n].t()
                }
            };
            let mended = time(n) - n.checked_sub(1).map_or(before.t(), time);
            let stamped = row.t() - before.t();
            for [q, dq] in &self.joints {
                let speed = 0.5 * (row.values[*dq] + before.values[*dq]);
                let step = row.values[*q] - before.values[*q];
                let [a, b] = [stamped, mended].map(|time| (step - speed * time).powi(2));
                if a.is_finite() && b.is_finite() {
                    by_stamps += a;
                    by_envelope += b;
                }
            }
        }
        by_envelope < CLEARLY * by_stamps
    }

    fn mend(&mut self, envelope: &[f64], from: usize, to: usize) {
        let last = self.last.as_ref().map_or(f64::NEG_INFINITY, Held::t);
        for n in from..to {
            let row = &mut self.ahead[n];
            // Rows that were given before keep their times.
            let t = envelope[n].max(last);
            self.latest = self.latest.max(row.t() - t);
            row.values[TIME] = t;
            self.first.get_or_insert(row.line);
        }
        self.mended += (to - from) as u64;
    }

    /// What a user should know of it, once all is read.
    pub(super) fn warning(&self) -> Option<Warning> {
        let first = self
            .first
            .filter(|_| self.mended as f64 > SAID * self.rows as f64);
        first.map(|number| Warning::LateStamps {
            count: self.mended,
            rows: self.rows,
            latest: self.latest,
            first: Place {
                unit: self.unit,
                number,
            },
        })
    }
}

/// The time between rows at most places where rows follow one another, s; none of so few, or if time stands still.
fn period(stamps: &[f64]) -> Option<f64> {
    let is_whole = |span: &&[f64]| span.windows(2).all(|pair| pair[1] - pair[0] <= BRIDGED);
    let spans = stamps.windows(SPAN + 1).step_by(SPAN / 8);
    let spans = spans.filter(is_whole);
    let period = robust::median(spans.map(|span| (span[SPAN] - span[0]) / SPAN as f64))?;
    (period > 0.0).then_some(period)
}

/// The latest moment of each row that leaves a period to each row after it, and is not after its stamp.
fn envelope(stamps: &[f64], period: f64) -> Vec<f64> {
    let mut envelope = stamps.to_vec();
    for n in (0..stamps.len().saturating_sub(1)).rev() {
        envelope[n] = envelope[n].min(envelope[n + 1] - period);
    }
    envelope
}

#[cfg(test)]
mod tests;
