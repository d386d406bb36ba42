//! Time stamps of a recorder that falls behind: rows are measured at an even pace, stamped late, and closer together until it has caught up.
//!
//! A row can be stamped late, not early: a row is measured at least a period before the next one, so that the earliest moment that the rows after
//! it leave for it is known (the lower envelope of the stamps; Cristian 1989, *Probabilistic clock synchronization*, bounds messages' times so). Whether stamps or envelope are right is for the motion to say: over the rows in question positions have moved by what
//! velocities integrate to on one of the two clocks. Rows that rest, rows whose sender was not even, and rows after a pause keep their stamps;
//! messages that are lost leave their gap.

use std::collections::VecDeque;

use super::channel::Channel;
use super::checks::BRIDGED;
use super::columns::Columns;
use super::error::{Place, Unit};
use super::slots::TIME;
use super::warning::Warning;
use crate::robust;

/// Time that is read ahead, s: a recorder that has not caught up by then keeps its stamps.
const AHEAD: f64 = 1.0;
/// Rows that are read ahead at least, so that those of a slow log tell its period.
const LEAST_AHEAD: usize = 512;
/// Rows that are read ahead at most: a second at 8 kHz. Stamps that stand still never come to a second.
const MOST_AHEAD: usize = 8192;
/// So many spans, one after the other, are in what was read; a period is told by the two stamps at the ends of one. A span is 0.13 s, in which most
/// recorders catch up, and has more rows than a burst.
const SPANS: usize = 16;
/// Rows of a span at least: fewer than a lost message in a hundred leaves together.
const LEAST_SPAN: usize = 64;
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
    /// The recorder's, s; the time among the values is the row's.
    stamp: f64,
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
    /// Rows are given as they come.
    live: bool,
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
            live: true,
            ..Self::new(columns, unit)
        }
    }

    fn of(unit: Unit, joints: Vec<[usize; 2]>) -> Self {
        Self {
            unit,
            joints,
            live: false,
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
        let [first, last] = [self.ahead.front(), self.ahead.back()];
        let time = last.zip(first).map_or(0.0, |(b, a)| b.stamp - a.stamp);
        let count = self.ahead.len();
        let enough = match self.live {
            true => count > 0,
            false => count >= 2 * LEAST_AHEAD && time >= 2.0 * AHEAD || count >= 2 * MOST_AHEAD,
        };
        !self.ended && self.judged == 0 && !enough
    }

    /// Takes a row.
    pub(super) fn push(&mut self, line: u64, values: &[f64]) {
        let mut own = self.spare.pop().unwrap_or_default();
        own.clear();
        own.extend_from_slice(values);
        self.ahead.push_back(Held {
            line,
            stamp: own[TIME],
            values: own,
        });
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
        if row.t() < row.stamp {
            self.mended += 1;
            self.latest = self.latest.max(row.stamp - row.t());
            self.first.get_or_insert(line);
        }
        let given = self.last.replace(row);
        self.spare.extend(given.map(|row| row.values));
        Some(line)
    }

    /// Judges as many rows as those after them tell of.
    fn judge(&mut self) {
        let stamps = self.times();
        let count = stamps.len();
        self.judged = count;
        if self.live {
            return;
        }
        if !self.ended {
            let known = &stamps[..count.saturating_sub(LEAST_AHEAD)];
            let told = known.partition_point(|t| *t <= stamps[count - 1] - AHEAD);
            // Half of them, where the rows of a second are too many.
            self.judged = told.max(count / 2);
        }
        let Some(period) = period(&stamps) else {
            return;
        };
        let early = envelope(&stamps, period, 0.0);
        // A run is judged whole, if it ends within what is read ahead.
        if !self.ended {
            let is_late = |n| stamps[n] - early[n] > WITH_IT * period;
            let on_time = (1..=self.judged).rev().find(|&n| !is_late(n));
            self.judged = on_time.unwrap_or(self.judged);
        }
        self.put_right(&stamps, early, period);
        if self.ended {
            // The recorder may be behind at the log's end: no row after that tells how much.
            let times = self.times();
            let early = envelope(&times, period, behind(&times, period));
            self.put_right(&times, early, period);
        }
    }

    /// The times of the rows ahead, s.
    fn times(&self) -> Vec<f64> {
        self.ahead.iter().map(Held::t).collect()
    }

    /// Gives rows that are late at `times` those of `early`, run by run, where the motion says so.
    fn put_right(&mut self, times: &[f64], mut early: Vec<f64>, period: f64) {
        let late = |early: &[f64], n: usize| (times[n] - early[n]) / period;
        let mut from = 0;
        while from < self.judged {
            let to = (from..self.judged).find(|&n| late(&early, n) <= WITH_IT);
            let to = to.unwrap_or(self.judged);
            let worst = (from..to).map(|n| late(&early, n));
            let worst = worst.fold(0.0, f64::max);
            if worst > LATE {
                // The rows of a run are a period apart: it is those on time that must not seem late.
                for n in (from..to - 1).rev() {
                    early[n] = early[n].min(early[n + 1] - period);
                }
                let apart = (worst.ceil() as usize).min(times.len());
                let rows = [from, (to + apart).min(times.len())];
                let [before, after] = [times, &early[..]].map(|t| self.moves_off(t, rows, apart));
                if after < CLEARLY * before {
                    self.mend(&early, from, to);
                }
            }
            from = to.max(from + 1);
        }
    }

    /// By how much positions move otherwise than velocities integrate to at such times, squared and added up over the joints and the rows
    /// `from..to`: between each of them and the one that is `apart` rows before, for by so much the later of two rows may be late and the other not.
    /// A pause says nothing: how joints moved meanwhile is not known.
    fn moves_off(&self, times: &[f64], [from, to]: [usize; 2], apart: usize) -> f64 {
        let start = from.saturating_sub(apart);
        let mut sum = 0.0;
        let mut off = Vec::with_capacity(to - start);
        for [q, dq] in &self.joints {
            off.clear();
            off.push(0.0);
            for n in start + 1..to {
                let [before, row] = [n - 1, n].map(|n| &self.ahead[n]);
                let speed = 0.5 * (row.values[*dq] + before.values[*dq]);
                let step = row.values[*q] - before.values[*q];
                let step = step - speed * (times[n] - times[n - 1]);
                let says = step.is_finite() && row.stamp - before.stamp <= BRIDGED;
                off.push(off[n - 1 - start] + if says { step } else { 0.0 });
            }
            let moved = |n: usize| off[n - start] - off[n.saturating_sub(apart).max(start) - start];
            sum += (from..to).map(|n| moved(n).powi(2)).sum::<f64>();
        }
        sum
    }

    fn mend(&mut self, envelope: &[f64], from: usize, to: usize) {
        let last = self.last.as_ref().map_or(f64::NEG_INFINITY, Held::t);
        let mut before = from.checked_sub(1).map_or(last, |n| self.ahead[n].t());
        for n in from..to {
            before = before.max(envelope[n]);
            self.ahead[n].values[TIME] = before;
        }
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

/// The time between rows, s: at most places where rows follow one another, or by the stamps that are early, where that is less. Too short a period
/// leaves some of the lateness, too long a one makes rows late that are not. None of so few rows, of stamps that are not in order, or if time stands still.
fn period(stamps: &[f64]) -> Option<f64> {
    let span = (stamps.len() / SPANS).max(LEAST_SPAN);
    let is_whole = |span: &&[f64]| span.windows(2).all(|pair| pair[1] - pair[0] <= BRIDGED);
    let spans = stamps.windows(span + 1).step_by(span / 8);
    let spans = spans.filter(is_whole);
    let usual = robust::median(spans.map(|rows| (rows[span] - rows[0]) / span as f64))?;
    let period = usual.min(early_period(stamps)?);
    (period > 0.0 && stamps.is_sorted()).then_some(period)
}

/// The time between rows by the two that are on time and farthest apart, s: the slope of the longest edge of the lower convex hull of stamps over
/// their numbers, for rows that are late lie above it (monotone chain, Andrew 1979).
fn early_period(stamps: &[f64]) -> Option<f64> {
    let slope = |a: usize, b: usize| (stamps[b] - stamps[a]) / (b - a) as f64;
    let mut hull: Vec<usize> = Vec::new();
    for n in 0..stamps.len() {
        while let [.., a, b] = hull[..]
            && slope(b, n) <= slope(a, b)
        {
            hull.pop();
        }
        hull.push(n);
    }
    let longest = hull.windows(2).max_by_key(|edge| edge[1] - edge[0])?;
    Some(slope(longest[0], longest[1]))
}

/// By how much the last row is late, s, by those since the last pause.
fn behind(stamps: &[f64], period: f64) -> f64 {
    let last = stamps.len() - 1;
    let mut since = (1..=last).rev();
    let since = since.find(|&n| stamps[n] - stamps[n - 1] > BRIDGED);
    (since.unwrap_or(0)..=last)
        .map(|n| stamps[last] - stamps[n] - (last - n) as f64 * period)
        .fold(0.0, f64::max)
}

/// The latest moment of each row that leaves a period to each row after it, and is not after its stamp; the last row is `behind` s late.
fn envelope(stamps: &[f64], period: f64, behind: f64) -> Vec<f64> {
    let mut envelope = stamps.to_vec();
    let mut next = f64::INFINITY;
    for (n, t) in envelope.iter_mut().enumerate().rev() {
        let late = if n + 1 == stamps.len() { behind } else { 0.0 };
        *t = (*t - late).min(next);
        next = *t - period * (1.0 - KNOWN);
    }
    envelope
}

#[cfg(test)]
mod tests;
