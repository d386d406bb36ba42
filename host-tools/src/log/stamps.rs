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

/// Time that is read ahead, s: a recorder that has not caught up by then keeps its stamps.
const AHEAD: f64 = 1.0;
/// Rows that are read ahead at least, so that those of a slow log tell its period.
const LEAST_AHEAD: usize = 512;
/// Rows that are read ahead at most: a second at 8 kHz. Stamps that stand still never come to a second.
const MOST_AHEAD: usize = 8192;
/// Time between the two stamps that a period is told by, s, and its rows at least: more than a burst has, fewer than a lost message in a hundred
/// leaves together.
const SPAN: f64 = 0.128;
const LEAST_SPAN: usize = 64;
/// Shares of the spans that may be shorter than the log's own: a recorder that catches up slowly does so in most of them, and one that loses messages
/// has longer ones.
const QUANTILES: [f64; 3] = [0.5, 0.75, 0.25];
/// Share of the period that a row is late by to be looked at: stamps of 1 ms are late by half of it at 500 Hz.
const LATE: f64 = 0.25;
/// Share by which its neighbours are late with it.
const WITH_IT: f64 = 0.05;
/// A period is known to one of these shares: rows that are on time must not seem late by those long after them, nor rows that are late long before
/// them on time.
const KNOWN: [f64; 2] = [2e-3, 1e-4];
/// What velocities leave of the positions' steps is at most this share, squared, of what the stamps leave: noise is in both alike, so that of two
/// clocks that are as good the shares are near 1, and of a wrong one the motion's part comes on top.
const CLEARLY: f64 = 0.5;
/// Clocks by which positions move otherwise than velocities say by up to so many times as much are as good: the error of a sum of some hundred squares of
/// noise.
const AS_GOOD: f64 = 1.1;

/// A recorder that is behind when what was read ends has caught up by more than so many periods since it was latest.
const CATCHES_UP: f64 = 0.5;
/// So many joints tell a log's clock.
const TELL_THE_CLOCK: usize = 3;

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
        let count = self.ahead.len();
        let enough = match self.live {
            true => count > 0,
            false => count >= 2 * LEAST_AHEAD && self.read_ahead() >= 2.0 * AHEAD,
        };
        !self.ended && self.judged == 0 && !enough && count < 2 * MOST_AHEAD
    }

    /// The time that the rows read ahead last, s.
    fn read_ahead(&self) -> f64 {
        let [first, last] = [self.ahead.front(), self.ahead.back()].map(|row| row.map(Held::t));
        last.zip(first).map_or(0.0, |(last, first)| last - first)
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
        self.judged = count;
        if self.live {
            return;
        }
        if !self.ended {
            let told = count.saturating_sub(LEAST_AHEAD);
            let last = stamps.last().copied().unwrap_or_default();
            let is_told = |n: &usize| stamps[*n - 1] <= last - AHEAD;
            // Rows whose times are anything are half of those that were read.
            self.judged = (1..=told).rev().find(is_told).unwrap_or(count / 2);
        }
        let Some((period, envelope)) = self.clock(&stamps) else {
            return;
        };
        let late = |n: usize| (stamps[n] - envelope[n]) / period;
        // A run is judged whole, if it ends within what is read ahead.
        if !self.ended {
            let on_time = (1..=self.judged).rev().find(|&n| late(n) <= WITH_IT);
            self.judged = on_time.unwrap_or(self.judged);
        }
        let mut from = 0;
        while from < self.judged {
            let is_late = |n: &usize| late(*n) > WITH_IT;
            let to = (from..self.judged).find(|n| !is_late(n));
            let to = to.unwrap_or(self.judged);
            let worst = (from..to).map(late).fold(0.0, f64::max);
            if worst > LATE {
                let apart = (worst.ceil() as usize).min(MOST_AHEAD);
                let until = (to + apart).min(count);
                let [by_stamps, by_envelope] = [&stamps, &envelope]
                    .map(|times| self.moves_off(&self.joints, times, [from, until], apart));
                if by_envelope < CLEARLY * by_stamps {
                    self.mend(&envelope, from, to);
                }
            }
            from = to.max(from + 1);
        }
    }

    /// The period of the rows, s, and the earliest moments at which they were measured; none where no row is late. Of the periods that the spans
    /// tell, it is the one by which positions move as velocities say.
    fn clock(&self, stamps: &[f64]) -> Option<(f64, Vec<f64>)> {
        // Who is late stamps no row before the one that it stamped last: these are damaged, or of another clock.
        if !stamps.is_sorted() {
            return None;
        }
        let hull = on_time(stamps);
        let mut told = Vec::new();
        for period in periods(stamps, &hull) {
            let of = |known: f64, end: f64| (period, envelope(stamps, period * (1.0 - known), end));
            told.extend(KNOWN.map(|known| of(known, f64::INFINITY)));
            // What was read may end while its recorder is behind: no row after that tells how much. It catches up, unlike rows after a pause.
            for &[_, on_time] in &hull {
                let after = stamps.len() - 1 - on_time;
                let end = stamps[on_time] + after as f64 * period;
                let late = |n: usize| stamps[n] - stamps[on_time] - (n - on_time) as f64 * period;
                let worst = (on_time..stamps.len()).map(late).fold(0.0, f64::max);
                if worst - late(stamps.len() - 1) > CATCHES_UP * period {
                    told.push(of(KNOWN[1], end));
                }
            }
        }
        let most = |(period, envelope): &(f64, Vec<f64>)| {
            let late = stamps.iter().zip(envelope).map(|(t, e)| (t - e) / period);
            late.fold(0.0, f64::max)
        };
        // A period that is wrong makes all rows late: the least is of one that is not.
        let late = told.iter().map(most).filter(|late| *late > LATE);
        let worst = late.fold(f64::INFINITY, f64::min);
        if worst == f64::INFINITY {
            return None;
        }
        let apart = (worst.ceil() as usize).min(stamps.len());
        let moving = self.moving();
        let off = told
            .iter()
            .map(|(_, times)| self.moves_off(&moving, times, [0, self.judged], apart));
        let off: Vec<f64> = off.collect();
        let least = off.iter().copied().fold(f64::INFINITY, f64::min);
        let mut good: Vec<_> = off.into_iter().zip(told).collect();
        good.retain(|(off, _)| *off <= AS_GOOD * least);
        // Of clocks that are as good, the fastest leaves the stamps most as they are.
        let fastest =
            (good.iter()).fold(f64::INFINITY, |least, (_, (period, _))| least.min(*period));
        good.retain(|(_, (period, _))| *period <= fastest * (1.0 + KNOWN[1]));
        let best = good.into_iter().min_by(|(a, _), (b, _)| a.total_cmp(b));
        best.map(|(_, clock)| clock)
    }

    /// The joints that move most in what was read: they tell the clock, and the others no more.
    fn moving(&self) -> Vec<[usize; 2]> {
        let square = |&[_, dq]: &[usize; 2]| -> f64 {
            let rows = self.ahead.iter().map(|row| row.values[dq]);
            rows.filter(|x| x.is_finite()).map(|x| x * x).sum()
        };
        let mut joints: Vec<_> = self.joints.iter().map(|own| (square(own), *own)).collect();
        joints.sort_by(|a, b| b.0.total_cmp(&a.0));
        joints.truncate(TELL_THE_CLOCK);
        joints.into_iter().map(|(_, own)| own).collect()
    }

    /// By how much positions move otherwise than velocities integrate to at such times, squared and added up over `joints` and the rows
    /// `from..to`: between each of them and the one that is `apart` rows before, for by so much the later of two rows may be late and the other not.
    fn moves_off(
        &self,
        joints: &[[usize; 2]],
        times: &[f64],
        [from, to]: [usize; 2],
        apart: usize,
    ) -> f64 {
        let start = from.saturating_sub(apart);
        let mut sum = 0.0;
        let mut gone = Vec::with_capacity(to - start);
        for [q, dq] in joints {
            gone.clear();
            let mut integral = 0.0;
            for n in start..to {
                let row = &self.ahead[n].values;
                if n > start {
                    let speed = 0.5 * (row[*dq] + self.ahead[n - 1].values[*dq]);
                    let step = speed * (times[n] - times[n - 1]);
                    integral += if step.is_finite() { step } else { 0.0 };
                }
                gone.push(row[*q] - integral);
            }
            for n in from..to {
                let before = n.saturating_sub(apart).max(start);
                let off = (gone[n - start] - gone[before - start]).powi(2);
                sum += if off.is_finite() { off } else { 0.0 };
            }
        }
        sum
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

/// What the time between rows may be, s: by the spans in which rows follow one another, and by the stamps that are early over all of them; none of
/// so few, or if time stands still.
fn periods(stamps: &[f64], on_time: &[[usize; 2]]) -> Vec<f64> {
    let Some(usual) = robust::median(stamps.windows(2).map(|pair| pair[1] - pair[0])) else {
        return Vec::new();
    };
    let span = ((SPAN / usual.max(f64::MIN_POSITIVE)) as usize).clamp(LEAST_SPAN, MOST_AHEAD / 8);
    let is_whole = |span: &&[f64]| span.windows(2).all(|pair| pair[1] - pair[0] <= BRIDGED);
    let spans = stamps.windows(span + 1).step_by(LEAST_SPAN / 8);
    let mut spans: Vec<f64> = (spans.filter(is_whole))
        .map(|stamps| (stamps[span] - stamps[0]) / span as f64)
        .collect();
    spans.sort_by(f64::total_cmp);
    let quantile = |share: f64| {
        let at = share * spans.len().saturating_sub(1) as f64;
        spans.get(at.round() as usize).copied()
    };
    let told: Vec<f64> = QUANTILES.into_iter().filter_map(quantile).collect();
    let least = told.iter().copied().fold(f64::INFINITY, f64::min) * (1.0 - KNOWN[0]);
    let most = told.iter().copied().fold(0.0, f64::max) * (1.0 + KNOWN[0]);
    let slope = |&[a, b]: &[usize; 2]| (stamps[b] - stamps[a]) / (b - a) as f64;
    // Over a pause, or over messages that were lost, there is another slope.
    let slopes = on_time.iter().map(slope);
    let slopes = slopes.filter(|period| (least..=most).contains(period));
    let told = told.iter().copied().chain(slopes);
    told.filter(|period| *period > 0.0).collect()
}

/// Pairs of rows that are on time: those that an edge of the lower convex hull of stamps over their numbers joins, for rows that are late lie above it
/// (monotone chain, Andrew 1979). The longest edge, and that over the middle row, should the first or the last row be late. None of a single row.
fn on_time(stamps: &[f64]) -> Vec<[usize; 2]> {
    let mut hull: Vec<usize> = Vec::new();
    let slope = |a: usize, b: usize| (stamps[b] - stamps[a]) / (b - a) as f64;
    for n in 0..stamps.len() {
        while let [.., a, b] = hull[..]
            && slope(b, n) <= slope(a, b)
        {
            hull.pop();
        }
        hull.push(n);
    }
    let edges = hull.windows(2).map(|edge| [edge[0], edge[1]]);
    let longest = edges.clone().max_by_key(|[a, b]| b - a);
    let middle = edges.clone().find(|[_, b]| 2 * b >= stamps.len());
    let middle = middle.filter(|middle| Some(*middle) != longest);
    longest.into_iter().chain(middle).collect()
}

/// The latest moment of each row that leaves a period to each row after it, and is not after its stamp; of the last one not after `end`.
fn envelope(stamps: &[f64], period: f64, end: f64) -> Vec<f64> {
    let mut envelope = stamps.to_vec();
    if let Some(last) = envelope.last_mut() {
        *last = last.min(end);
    }
    for n in (0..stamps.len().saturating_sub(1)).rev() {
        envelope[n] = envelope[n].min(envelope[n + 1] - period);
    }
    envelope
}

#[cfg(test)]
mod tests;
