//! Positions that jump: back after some rows (a second publisher), or for good (a seam).
//!
//! Between two rows a position moves by the integral of its velocity, or, where that is reported in another unit, hardly at all.

use std::collections::VecDeque;

use super::super::checks::GAP_PERIODS;
use super::super::columns::Columns;
use super::{Raw, motion_slots};
use crate::robust;

/// Least jump, rad or m, and as a share of the joint's range: trapezia between samples of a driven joint, 10 ms apart, miss
/// a t²/4 = 0.025 for 1 000 rad/s².
const LEAST: f64 = 0.05;
const LEAST_OF_RANGE: f64 = 0.02;
/// The time between samples up to which [`LEAST`] holds, s; it grows with the time's square.
const TIME: f64 = 0.01;
/// It grows no further than from so many times that time on: what a joint does in longer silences follows its velocity, or is another robot's.
const LONGEST_TIMES: f64 = 2.0;
/// Stamps of a recorder that falls behind come in bursts: a joint may have moved, at its reported speed, for its time between stamps and so
/// many periods more.
const BURST: f64 = 3.0;
/// Rows closer than this share of their mean distance are of one burst; where half of them are, stamps are of reception.
const CLOSE: f64 = 0.2;
/// A jump is so many times what half of the rows ahead move by, and differ by from their velocities.
const TIMES: f64 = 20.0;
/// Most rows after which what jumped comes back.
const RUN: usize = 16;
/// No jump is told over a longer silence, s.
const LONGEST: f64 = 0.05;
/// Rows at the beginning of a log that are another's, if all others go on without them.
const FIRST: usize = 8;

#[derive(Debug)]
struct Joint {
    q: usize,
    dq: usize,
    tau: usize,
    least: f64,
}

/// Positions of all joints.
#[derive(Debug)]
pub(super) struct Positions {
    joints: Vec<Joint>,
}

/// A jump of positions.
#[derive(Debug, Clone, Copy)]
pub(super) struct Jump {
    pub(super) slot: usize,
    pub(super) comes_back: bool,
}

impl Positions {
    pub(super) fn new(columns: &Columns) -> Self {
        let joint = |(joint, [q, dq, tau]): (usize, [usize; 3])| {
            let [lower, upper] = columns.robot().bodies()[joint].limits;
            let range = upper - lower;
            let is_known = range.is_finite() && range > 0.0;
            let least = if is_known {
                LEAST.min(LEAST_OF_RANGE * range)
            } else {
                LEAST
            };
            Joint { q, dq, tau, least }
        };
        Self {
            joints: motion_slots(columns).map(joint).collect(),
        }
    }

    /// The slot of the first joint's position.
    pub(super) fn first(&self) -> usize {
        self.joints.first().map_or(0, |joint| joint.q)
    }

    /// Whether two rows hold the same motion.
    pub(super) fn are_equal(&self, a: &[f64], b: &[f64]) -> bool {
        let equal = |joint: &Joint| [joint.q, joint.dq, joint.tau].map(|slot| a[slot] == b[slot]);
        self.joints.iter().all(|joint| equal(joint) == [true; 3])
    }

    /// Whether the joint whose position lies at `slot` reports nothing but zeros.
    pub(super) fn is_zero(&self, row: &[f64], slot: usize) -> bool {
        let own = self.joints.iter().find(|joint| joint.q == slot);
        own.is_some_and(|joint| joint.is_zero(row))
    }

    /// What is a gap at the rate of the rows ahead, and more, s.
    pub(super) fn gap(&self, ahead: &VecDeque<Raw>) -> f64 {
        let rows = ahead.iter().zip(ahead.iter().skip(1));
        let period = robust::median(rows.map(|(row, next)| next.t() - row.t()));
        (GAP_PERIODS + 1.0) * period.unwrap_or(0.0)
    }

    /// The position's slot of a joint that reports zeros in the first row ahead, before its first state.
    pub(super) fn zeros_first(&self, ahead: &VecDeque<Raw>) -> Option<usize> {
        let (first, period) = (ahead.front()?, period(ahead));
        let later = |joint: &&Joint| {
            let state = ahead.iter().position(|row| !joint.is_zero(&row.values));
            let state = state.filter(|n| *n > 0);
            state.is_some_and(|n| !joint.goes_on(&ahead[n - 1], &ahead[n], period))
        };
        let zeros = self
            .joints
            .iter()
            .filter(|joint| joint.is_zero(&first.values));
        zeros.clone().find(later).map(|joint| joint.q)
    }

    /// The position's slot of a joint by which the first row ahead is another publisher's: the other rows go on without it.
    pub(super) fn foreign_first(&self, ahead: &VecDeque<Raw>) -> Option<usize> {
        let (first, period) = (ahead.front()?, period(ahead));
        let broken = |n: usize| Some((n, self.breaks(first, &ahead[n], period)?));
        let (other, slot) = (1..ahead.len()).find_map(broken)?;
        self.is_confirmed(first, &ahead[other], ahead, slot)
            .then_some(())?;
        let (own, theirs) = (self.chain(ahead, 0), self.chain(ahead, other));
        let is_interleaved = own.iter().any(|n| *n > other);
        let is_short = own.len() <= FIRST && ahead.len() > 4 * FIRST;
        (theirs.len() > own.len() && (is_interleaved || is_short)).then_some(slot)
    }

    /// Rows that go on from a row.
    fn chain(&self, ahead: &VecDeque<Raw>, from: usize) -> Vec<usize> {
        let (mut chain, period) = (vec![from], period(ahead));
        for n in from + 1..ahead.len() {
            let last = &ahead[chain[chain.len() - 1]];
            let is_near = ahead[n].t() - last.t() <= self.longest(ahead);
            if is_near && self.breaks(last, &ahead[n], period).is_none() {
                chain.push(n);
            }
        }
        chain
    }

    /// How the positions of the first row ahead jump from those of the last row, if they do.
    pub(super) fn jump(&self, last: &Raw, ahead: &VecDeque<Raw>) -> Option<Jump> {
        let (row, period) = (ahead.front()?, period(ahead));
        let slot = self.breaks(last, row, period)?;
        let longest = self.longest(ahead);
        let since = row.t() - last.t();
        if since <= 0.0 || since > longest || !self.is_confirmed(last, row, ahead, slot) {
            return None;
        }
        let returns =
            |row: &Raw| row.t() - last.t() <= longest && self.breaks(last, row, period).is_none();
        let comes_back = ahead.iter().skip(1).take(RUN).any(returns);
        // Without a row that shows it nothing tells whether it stays.
        let comes_back = comes_back || ahead.len() == 1;
        Some(Jump { slot, comes_back })
    }

    /// The longest silence over which a jump is told, s.
    fn longest(&self, ahead: &VecDeque<Raw>) -> f64 {
        LONGEST.max(2.0 * self.gap(ahead))
    }

    /// The position's slot of a joint whose motion does not go on from one row to another.
    fn breaks(&self, from: &Raw, to: &Raw, period: f64) -> Option<usize> {
        let mut joints = self.joints.iter();
        let broken = joints.find(|joint| !joint.goes_on(from, to, period));
        broken.map(|joint| joint.q)
    }

    /// Whether a joint jumps by far more than between the rows ahead; of these every second may be another's.
    fn is_confirmed(&self, from: &Raw, to: &Raw, ahead: &VecDeque<Raw>, slot: usize) -> bool {
        let Some(joint) = self.joints.iter().find(|joint| joint.q == slot) else {
            return false;
        };
        let least = |n: usize, of: &dyn Fn(&Raw, &Raw) -> f64| {
            let later = ahead.iter().skip(n + 1).take(2);
            later
                .map(|row| of(&ahead[n], row))
                .fold(f64::INFINITY, f64::min)
        };
        let usual = |of: &dyn Fn(&Raw, &Raw) -> f64| {
            let all = (0..ahead.len().saturating_sub(1)).map(|n| least(n, of));
            robust::median(all).unwrap_or(0.0)
        };
        let moved = |from: &Raw, to: &Raw| joint.moved(from, to).abs();
        let missed = |from: &Raw, to: &Raw| joint.missed(from, to).abs();
        moved(from, to) > TIMES * usual(&moved) && missed(from, to) > TIMES * usual(&missed)
    }
}

/// Mean time between the rows ahead, s; where stamps come in bursts, which hide how long ago rows were measured, the longest that is judged.
fn period(ahead: &VecDeque<Raw>) -> f64 {
    let ends = ahead.front().zip(ahead.back());
    let span = ends.map_or(0.0, |(first, last)| last.t() - first.t());
    let mean = span.max(0.0) / (ahead.len().max(2) - 1) as f64;
    let steps = ahead.iter().zip(ahead.iter().skip(1));
    let close = steps.filter(|(row, next)| next.t() - row.t() < CLOSE * mean);
    match 2 * close.count() > ahead.len() {
        true => mean.max(LONGEST / BURST),
        false => mean,
    }
}

impl Joint {
    fn is_zero(&self, row: &[f64]) -> bool {
        [self.q, self.dq, self.tau]
            .iter()
            .all(|slot| row[*slot] == 0.0)
    }

    fn moved(&self, from: &Raw, to: &Raw) -> f64 {
        to.values[self.q] - from.values[self.q]
    }

    /// By how much a position moved otherwise than its velocity says.
    fn missed(&self, from: &Raw, to: &Raw) -> f64 {
        let velocity = 0.5 * (from.values[self.dq] + to.values[self.dq]);
        self.moved(from, to) - velocity * (to.t() - from.t())
    }

    fn goes_on(&self, from: &Raw, to: &Raw, period: f64) -> bool {
        let moved = self.moved(from, to).abs();
        // What is not a number is for others to tell.
        if moved.is_nan() || moved <= self.least {
            return true;
        }
        let since = (to.t() - from.t()).abs();
        let time = (since / TIME).clamp(1.0, LONGEST_TIMES);
        let least = self.least * time * time;
        let speed = from.values[self.dq].abs().max(to.values[self.dq].abs());
        moved <= least + speed * (since + BURST * period) || self.missed(from, to).abs() <= least
    }
}
