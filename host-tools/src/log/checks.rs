//! What can only be judged over a whole log: its rate, its gaps, its units. All of it in constant memory.

use std::fmt;
use std::path::Path;

use super::columns::{Channel, Columns, TIME, slot};
use super::error::{LogError, Problem};
use super::joint::JointId;
use super::reader::Row;
use proprio_core::go2::{JOINTS, position_limits};

/// The least sampling rate, Hz. A leg's fastest own motion (a calf on its controller's gains) lies near 15 Hz, and
/// a window of 20 ms must hold several samples.
pub const LEAST_RATE: f64 = 100.0;

/// A longer silence than this, s, is no lost message: two recordings in one file, or a clock that was set.
pub const LONGEST_GAP: f64 = 600.0;

/// A gap that ends a window, s; [`proprio_core::window::Settings::max_gap_us`] by default.
pub const GAP: f64 = 0.01;

/// How far beyond a joint's limit a sample may lie, rad: encoder zero and compliance of the stop.
const LIMIT_MARGIN: f64 = 0.2;

/// What the reader has noticed of a log so far.
#[derive(Debug, Clone)]
pub struct Checks {
    rows: u64,
    first: f64,
    previous: f64,
    previous_line: u64,
    periods: Periods,
    first_slow: Option<u64>,
    repeated_stamps: u64,
    gaps: u64,
    longest: (f64, u64),
    limits: [LimitCheck; JOINTS],
}

#[derive(Debug, Clone, Copy, Default)]
struct LimitCheck {
    outside: u64,
    inside_as_degrees: u64,
    first: Option<(u64, f64)>,
}

/// What a user should know about a log that can still be used.
#[derive(Debug, Clone, PartialEq)]
pub enum Warning {
    /// No samples for a while; windows do not bridge it.
    Gaps {
        /// How many gaps.
        count: u64,
        /// The longest, s.
        longest: f64,
        /// Line of the row before the longest.
        line: u64,
    },
    /// Rows with the time stamp of the row above.
    RepeatedStamps {
        /// How many.
        count: u64,
        /// Of how many rows.
        rows: u64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gaps {
                count,
                longest,
                line,
            } => write!(
                f,
                "{count} gap{} over {:.0} ms, the longest {:.0} ms after line {line}; no window bridges a gap",
                if *count == 1 { "" } else { "s" },
                GAP * 1e3,
                longest * 1e3,
            ),
            Self::RepeatedStamps { count, rows } => {
                write!(
                    f,
                    "{count} of {rows} rows repeat the time stamp of the row above and are skipped"
                )
            }
        }
    }
}

impl Checks {
    pub(super) fn new() -> Self {
        Self {
            rows: 0,
            first: 0.0,
            previous: 0.0,
            previous_line: 0,
            periods: Periods::new(),
            first_slow: None,
            repeated_stamps: 0,
            gaps: 0,
            longest: (0.0, 0),
            limits: [LimitCheck::default(); JOINTS],
        }
    }

    /// Takes note of a row; an error if time runs backwards or jumps.
    pub(super) fn row(&mut self, columns: &Columns, row: &Row) -> Result<(), Problem> {
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
            if gap > LONGEST_GAP {
                return Err(Problem::TimeJump {
                    gap,
                    before: self.previous_line,
                });
            }
            self.gaps += u64::from(gap > GAP);
            self.repeated_stamps += u64::from(gap == 0.0);
            if gap > self.longest.0 {
                self.longest = (gap, self.previous_line);
            }
            if gap * LEAST_RATE > 1.0 {
                self.first_slow.get_or_insert(row.line);
            }
            self.periods.add(gap);
        }
        for joint in columns.joints() {
            self.limits[joint.index()].add(joint, row.line, row.q()[joint.index()]);
        }
        self.rows += 1;
        (self.previous, self.previous_line) = (now, row.line);
        Ok(())
    }

    /// Rows read.
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Time from the first row to the last, s.
    pub fn duration(&self) -> f64 {
        self.previous - self.first
    }

    /// Judges the log, once all of it is read.
    pub(super) fn finish(&self, path: &Path, columns: &Columns) -> Result<Vec<Warning>, LogError> {
        let error = |problem| LogError::new(path, problem);
        if self.rows < 2 {
            let line = self.previous_line.max(1);
            return Err(error(Problem::TooShort { rows: self.rows }).at_line(line));
        }
        let period = self.periods.median();
        // The median is known to 1 %: a log of exactly the least rate passes.
        if let Some(line) = self.first_slow.filter(|_| period * LEAST_RATE > 1.02) {
            let column = columns.cell[TIME].unwrap_or_default();
            let problem = Problem::TooSlow {
                rate: 1.0 / period,
                least: LEAST_RATE,
            };
            return Err(error(problem).at_line(line).at_column(column, "t"));
        }
        let degrees = columns.joints().any(|joint| self.is_calf_in_degrees(joint));
        for joint in columns.joints() {
            let limits = &self.limits[joint.index()];
            if let Some((line, problem)) = limits.judge(joint, self.rows, degrees) {
                let name = Channel::Q.column(joint);
                let cell = columns.cell[slot(Channel::Q, joint.index())].unwrap_or_default();
                return Err(error(problem).at_line(line).at_column(cell, &name));
            }
        }
        Ok(self.warnings())
    }

    /// Only a calf tells degrees from a wrong sign or zero: it is always bent by 48° or more, which no angle in
    /// radians reaches. Every leg has one.
    fn is_calf_in_degrees(&self, joint: JointId) -> bool {
        joint.place() == 2 && 2 * self.limits[joint.index()].inside_as_degrees > self.rows
    }

    fn warnings(&self) -> Vec<Warning> {
        let (longest, line) = self.longest;
        let gaps = (self.gaps > 0).then_some(Warning::Gaps {
            count: self.gaps,
            longest,
            line,
        });
        let repeated = (self.repeated_stamps > 0).then_some(Warning::RepeatedStamps {
            count: self.repeated_stamps,
            rows: self.rows,
        });
        gaps.into_iter().chain(repeated).collect()
    }
}

impl LimitCheck {
    fn add(&mut self, joint: JointId, line: u64, q: f64) {
        let [lower, upper] = limits(joint);
        let within = |q: f64| q > lower - LIMIT_MARGIN && q < upper + LIMIT_MARGIN;
        if !within(q) {
            self.outside += 1;
            self.inside_as_degrees += u64::from(within(q.to_radians()));
            self.first.get_or_insert((line, q));
        }
    }

    /// More than half of the samples outside is no glitch but a wrong unit, sign or zero.
    fn judge(&self, joint: JointId, rows: u64, degrees: bool) -> Option<(u64, Problem)> {
        let (line, value) = self.first.filter(|_| 2 * self.outside > rows)?;
        let [lower, upper] = limits(joint);
        let percent = 100.0 * self.outside as f64 / rows as f64;
        Some((
            line,
            Problem::OutsideLimits {
                joint,
                lower,
                upper,
                percent,
                value,
                degrees,
            },
        ))
    }
}

fn limits(joint: JointId) -> [f64; 2] {
    position_limits(joint.leg())[joint.place()]
}

/// The median sampling period from a histogram of fixed size.
#[derive(Debug, Clone)]
struct Periods {
    /// Bins of 1 % width in ratio, from 10 µs to over a quarter of an hour.
    counts: Vec<u64>,
    total: u64,
}

const SHORTEST: f64 = 1e-5;
const RATIO: f64 = 1.01;
const BINS: usize = 1850;

impl Periods {
    fn new() -> Self {
        Self {
            counts: vec![0; BINS],
            total: 0,
        }
    }

    fn add(&mut self, period: f64) {
        let bin = (period.max(SHORTEST) / SHORTEST).ln() / RATIO.ln();
        self.counts[(bin as usize).min(BINS - 1)] += 1;
        self.total += 1;
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
