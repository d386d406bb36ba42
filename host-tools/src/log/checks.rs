//! What can only be judged over a whole log: its rate, its gaps, its units. All of it in constant memory.

use std::f64::consts::TAU;
use std::path::Path;

use super::channel::Channel;
use super::columns::Columns;
use super::error::{LogError, Place, Problem, Unit};
use super::row::Row;
use super::slots::TIME;
use super::warning::Warning;
use crate::model::JointKind;

/// The least sampling rate, Hz: a limb's fastest own motion (a Go2's calf on its controller's gains) lies near 15 Hz, and
/// below three samples to a period nothing is seen of it.
pub const LEAST_RATE: f64 = 50.0;

/// A longer silence than this, s, is no lost message: two recordings in one file, or a clock that was set.
pub const LONGEST_GAP: f64 = 600.0;

/// A silence of so many sampling periods is no gap: a message is lost now and then, at any rate.
pub const GAP_PERIODS: f64 = 2.5;

/// Nor is one of this length, s: over it a robot's motion is still followed. [`proprio_core::window::Settings::max_gap_us`] by default.
pub const GAP: f64 = 0.01;

/// A joint's motion is followed over lost messages that leave a silence no longer than this, s: half a period of what a leg does at 10 Hz.
pub const BRIDGED: f64 = 0.05;

/// A shorter log, s, has fewer than ten windows of 20 ms.
pub const LEAST_DURATION: f64 = 0.2;

/// Robots are sampled at these rates, Hz: three decades, so that at most one unit of time gives such a rate.
const RATES: (f64, f64) = (20.0, 20e3);

/// Stamps this far apart, s, are looked at in other units: 1 kHz in ms is 1 s, less 5 % for jitter. More often than once a second slow logs
/// in seconds are sampled too.
const OTHER_UNIT: f64 = 0.95;

/// How far beyond a joint's limit a sample may lie, rad or m: encoder zero and compliance of the stop.
const LIMIT_MARGIN: f64 = 0.2;

/// What the reader has noticed of a log so far.
#[derive(Debug, Clone)]
pub struct Checks {
    unit: Unit,
    rows: u64,
    first: f64,
    previous: f64,
    previous_row: u64,
    periods: Periods,
    first_slow: Option<u64>,
    repeated_stamps: u64,
    longest: (f64, u64),
    /// Of each recorded joint.
    limits: Vec<LimitCheck>,
    /// Slots of motion, and whether any row has held a number there.
    numbers: Vec<(usize, bool)>,
}

#[derive(Debug, Clone, Copy)]
struct LimitCheck {
    joint: usize,
    turns: bool,
    lower: f64,
    upper: f64,
    outside: u64,
    surely_degrees: u64,
    other_way: u64,
    first: Option<(u64, f64)>,
}

/// Units that stamps come in instead of s, and how many make one.
pub(crate) const TIME_UNITS: [(&str, f64); 3] = [("ms", 1e3), ("µs", 1e6), ("ns", 1e9)];

/// The unit other than the second in which stamps so far apart have a robot's rate.
fn unit_of(period: f64) -> Option<Problem> {
    if period < OTHER_UNIT {
        return None;
    }
    let rates = TIME_UNITS.map(|(unit, per_second)| (unit, per_second, per_second / period));
    let mut likely = rates
        .into_iter()
        .filter(|(.., rate)| (RATES.0..=RATES.1).contains(rate));
    let (unit, per_second, rate) = likely.next()?;
    // At a rate on the border two units are as likely.
    likely.next().is_none().then_some(Problem::TimeUnit {
        unit,
        per_second,
        rate,
    })
}

impl Checks {
    pub(super) fn new(columns: &Columns, unit: Unit) -> Self {
        Self {
            unit,
            rows: 0,
            first: 0.0,
            previous: 0.0,
            previous_row: 0,
            periods: Periods::default(),
            first_slow: None,
            repeated_stamps: 0,
            longest: (0.0, 0),
            limits: columns
                .joints()
                .map(|j| LimitCheck::of(columns, j))
                .collect(),
            numbers: (columns.joints())
                .flat_map(|j| Channel::MOTION.map(|channel| (columns.slots.of(channel, j), false)))
                .collect(),
        }
    }

    /// Takes note of a row; an error if time runs backwards or jumps.
    pub(super) fn row(&mut self, row: &Row) -> Result<(), Problem> {
        let now = row.t();
        if self.rows == 0 {
            self.first = now;
        } else {
            let gap = now - self.previous;
            if gap < 0.0 {
                return Err(Problem::TimeBackwards {
                    before: self.previous,
                    now,
                });
            }
            // Joined recordings have a period before the jump.
            let unit = (gap > LONGEST_GAP && self.rows == 1).then(|| unit_of(gap));
            if let Some(problem) = unit.flatten() {
                return Err(problem);
            }
            if gap > LONGEST_GAP {
                return Err(Problem::TimeJump {
                    gap,
                    before: self.place(self.previous_row),
                });
            }
            self.repeated_stamps += u64::from(gap == 0.0);
            if gap > self.longest.0 {
                self.longest = (gap, self.previous_row);
            }
            if gap * LEAST_RATE > 1.0 {
                self.first_slow.get_or_insert(row.line);
            }
            self.periods.add(gap);
        }
        for (slot, seen) in &mut self.numbers {
            *seen |= !row.at(*slot).is_nan();
        }
        let q = row.q();
        for limits in &mut self.limits {
            limits.add(row.line, q[limits.joint]);
        }
        self.rows += 1;
        (self.previous, self.previous_row) = (now, row.line);
        Ok(())
    }

    fn place(&self, number: u64) -> Place {
        Place {
            unit: self.unit,
            number,
        }
    }

    /// Rows read.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Time from the first row to the last, s.
    pub fn duration(&self) -> f64 {
        self.previous - self.first
    }

    /// Stamp of the first row, s.
    pub(super) fn first(&self) -> f64 {
        self.first
    }

    /// Sampling rate, Hz: one over the median period.
    pub fn rate(&self) -> f64 {
        1.0 / self.periods.median()
    }

    /// Judges the log, once all of it is read.
    pub(super) fn finish(&self, path: &Path, columns: &Columns) -> Result<Vec<Warning>, LogError> {
        let error = |problem| LogError::new(path, problem);
        if self.rows < 2 {
            let place = self.place(self.previous_row.max(1));
            return Err(self.too_short(path).at(Some(place)));
        }
        if self.duration() == 0.0 {
            let (rows, stamp) = (self.rows, self.first);
            return Err(error(Problem::OneStamp { rows, stamp }));
        }
        if let Some((slot, _)) = self.numbers.iter().find(|(_, seen)| !seen) {
            let rows = self.rows;
            let cell = columns.cell[*slot].unwrap_or_default();
            let error = error(Problem::NoNumbers { rows });
            return Err(error.at_column(cell, columns.column_name(cell)));
        }
        let period = self.periods.median();
        // The median is known to 1 %: a log of exactly the least rate passes.
        if let Some(row) = self.first_slow.filter(|_| period * LEAST_RATE > 1.02) {
            let column = columns.cell[TIME].unwrap_or_default();
            let problem = unit_of(period).unwrap_or(Problem::TooSlow {
                rate: 1.0 / period,
                least: LEAST_RATE,
            });
            let error = error(problem).at(Some(self.place(row)));
            return Err(error.at_column(column, columns.column_name(column)));
        }
        let degrees = self.limits.iter().any(|l| 2 * l.surely_degrees > self.rows);
        for limits in &self.limits {
            let name = columns.name(limits.joint);
            if let Some((row, problem)) = limits.judge(name, self.rows, degrees) {
                let slot = columns.slots.of(Channel::Q, limits.joint);
                let cell = columns.cell[slot].unwrap_or_default();
                let error = error(problem).at(Some(self.place(row)));
                return Err(error.at_column(cell, columns.column_name(cell)));
            }
        }
        Ok(self.warnings())
    }

    pub(super) fn too_short(&self, path: &Path) -> LogError {
        let problem = Problem::TooShort {
            rows: self.rows,
            least: LEAST_DURATION,
        };
        LogError::new(path, problem)
    }

    fn warnings(&self) -> Vec<Warning> {
        let (longest, row) = self.longest;
        let limit = self.periods.gap();
        let count = self.periods.longer_than(limit);
        let gaps = (count > 0).then_some(Warning::Gaps {
            count,
            limit,
            longest,
            after: self.place(row),
        });
        let repeated = (self.repeated_stamps > 0).then_some(Warning::RepeatedStamps {
            count: self.repeated_stamps,
            rows: self.rows,
        });
        gaps.into_iter().chain(repeated).collect()
    }
}

impl LimitCheck {
    fn of(columns: &Columns, joint: usize) -> Self {
        let body = &columns.robot().bodies()[joint];
        let [lower, upper] = body.limits;
        Self {
            joint,
            turns: body.kind != JointKind::Prismatic,
            lower,
            upper,
            outside: 0,
            surely_degrees: 0,
            other_way: 0,
            first: None,
        }
    }

    fn add(&mut self, line: u64, q: f64) {
        if !self.is_within(q) {
            self.outside += 1;
            self.surely_degrees += u64::from(self.is_surely_degrees(q));
            self.other_way += u64::from(self.is_within(-q));
            self.first.get_or_insert((line, q));
        }
    }

    fn is_within(&self, q: f64) -> bool {
        q > self.lower - LIMIT_MARGIN && q < self.upper + LIMIT_MARGIN
    }

    /// Within the limits as degrees, and farther out than a wrong sign and a zero wrong by a full turn would take an angle
    /// in radians. A Go2's calf, which is always bent by 48° or more, is so in every sample.
    fn is_surely_degrees(&self, q: f64) -> bool {
        let reach = self.lower.abs().max(self.upper.abs()) + TAU;
        self.turns && q.abs() > reach && self.is_within(q.to_radians())
    }

    /// More than half of the samples outside is no glitch but a wrong unit, sign or zero.
    fn judge(&self, joint: &str, rows: u64, degrees: bool) -> Option<(u64, Problem)> {
        let (line, value) = self.first.filter(|_| 2 * self.outside > rows)?;
        Some((
            line,
            Problem::OutsideLimits {
                joint: joint.to_owned(),
                lower: self.lower,
                upper: self.upper,
                unit: if self.turns { "rad" } else { "m" },
                percent: 100.0 * self.outside as f64 / rows as f64,
                value,
                degrees: degrees && self.turns,
                // All but a glitch, so that a wrong zero is not taken for a wrong sign.
                other_way: 20 * self.other_way > 19 * self.outside,
            },
        ))
    }
}

/// The sampling periods of a log so far, as a histogram of fixed size: which silences are gaps at its rate.
#[derive(Debug, Clone)]
pub struct Periods {
    /// Bins of 1 % width in ratio, from 10 µs to over a quarter of an hour.
    counts: Vec<u64>,
    total: u64,
}

const SHORTEST: f64 = 1e-5;
const RATIO: f64 = 1.01;
const BINS: usize = 1850;

impl Default for Periods {
    fn default() -> Self {
        Self {
            counts: vec![0; BINS],
            total: 0,
        }
    }
}

impl Periods {
    /// Takes the time between two samples, s, and says whether it is a gap.
    pub fn is_gap(&mut self, period: f64) -> bool {
        self.add(period);
        self.exceeds(period)
    }

    /// Whether a time, s, is longer than samples of this log may lie apart.
    pub fn exceeds(&self, time: f64) -> bool {
        time > GAP && time > self.gap()
    }

    /// What is longer is a gap, s.
    fn gap(&self) -> f64 {
        GAP.max(GAP_PERIODS * self.median())
    }

    fn add(&mut self, period: f64) {
        let bin = (period.max(SHORTEST) / SHORTEST).ln() / RATIO.ln();
        self.counts[(bin as usize).min(BINS - 1)] += 1;
        self.total += 1;
    }

    /// How many are longer than `limit`, s, by more than bins can tell.
    fn longer_than(&self, limit: f64) -> u64 {
        let bin = (limit / SHORTEST).ln() / RATIO.ln();
        self.counts.iter().skip(bin as usize + 2).sum()
    }

    /// Within 1 %.
    fn median(&self) -> f64 {
        let mut seen = 0;
        let bin = self.counts.iter().position(|count| {
            seen += count;
            2 * seen >= self.total
        });
        SHORTEST * RATIO.powf(bin.unwrap_or(0) as f64 + 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_named_if_it_alone_gives_a_robots_rate() {
        let unit = |period| match unit_of(period) {
            Some(Problem::TimeUnit { unit, rate, .. }) => Some((unit, rate.round())),
            _ => None,
        };
        // 1 kHz, 500 Hz and 100 Hz; slow logs in seconds; 20 Hz in ms is 20 kHz in µs as well.
        let cases = [
            (1.0, Some(("ms", 1000.0))),
            (2.0, Some(("ms", 500.0))),
            (2e3, Some(("µs", 500.0))),
            (1e7, Some(("ns", 100.0))),
            (0.002, None),
            (0.1, None),
            (0.5, None),
            (50.0, None),
            (1e12, None),
        ];
        for (period, expected) in cases {
            assert_eq!(unit(period), expected, "{period} s");
        }
    }
}
