//! A walk's windows, folded into one square-root factor per block of time.

use std::ops::RangeInclusive;

use proprio_core::effect::STANDING_NOISE;
use proprio_core::walk::stance::{AFTER_IMPACT, BEFORE_IMPACT};

use super::channels::Channels;
use super::legged::Legged;
use super::moved_readings::MovedReadings;
use super::projection::{JointStates, Projection};
use super::row_setup::RowSetup;
use super::sensors::{MOVED, Sensors};
use super::stance::Stance;
use super::walk::Walk;
use super::window::{Push, Window, WindowRows};
use super::windows::{WindowSamples, Windows};
use crate::equation::column::Column;
use crate::equation::free_tree::OF_BASE;
use crate::estimate::factor::{BATCH, HeapFactor};

/// Stamps of a steady clock are off by no more, s.
const JITTER: f64 = 1e-4;

/// Rows as a factor.
pub(super) struct Folded {
    pub(super) factor: HeapFactor,
    /// Equations in it.
    pub(super) equations: f64,
}

impl Folded {
    fn empty(columns: usize) -> Self {
        Self {
            factor: HeapFactor::new(columns),
            equations: 0.0,
        }
    }

    /// Of these together.
    pub(super) fn of<'a>(columns: usize, all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut sum = Self::empty(columns);
        for own in all {
            sum.factor.merge(&own.factor);
            sum.equations += own.equations;
        }
        sum
    }
}

/// One block of time.
pub(super) struct Block {
    pub(super) folded: Folded,
    /// Of which walk, and which of its blocks.
    pub(super) of: (usize, usize),
    /// Rows that are not in the factor yet.
    batch: Vec<f64>,
}

impl Block {
    fn empty(columns: usize) -> Self {
        Self {
            folded: Folded::empty(columns),
            of: (0, 0),
            batch: Vec::new(),
        }
    }

    fn push(&mut self, row: &[f64]) {
        self.batch.extend_from_slice(row);
        if self.batch.len() >= BATCH * row.len() {
            self.fold();
        }
    }

    fn fold(&mut self) {
        self.folded.factor.fold(&mut self.batch);
        self.batch = Vec::new();
    }
}

/// A window that was closed.
pub(super) struct SeenWindow<'a> {
    pub(super) rows: &'a WindowRows,
    states: &'a JointStates<'a>,
    stance: &'a Stance,
    sensors: &'a Sensors,
    pub(super) samples: &'a [usize],
}

impl SeenWindow<'_> {
    pub(super) fn projection(&self, setup: &RowSetup) -> Projection<'_> {
        let contact = (setup, self.sensors, self.stance);
        Projection::of(self.states, contact, self.samples, &self.rows.resting)
    }
}

/// One row of a closed window.
pub(super) struct Row<'a> {
    /// When its window began, s.
    pub(super) start: f64,
    /// Equations of its window that contact forces leave, at its window's first row; zero at the others.
    pub(super) rank: usize,
    /// Which coordinate's equation, times the robot's scale.
    pub(super) coordinate: usize,
    /// Which feet may carry a force.
    pub(super) loaded: &'a [bool],
    /// All columns, then the right-hand side.
    pub(super) numbers: &'a mut [f64],
}

/// Tells a walk's windows row by row, but for those `outside` that begin at these times (µs, in order), and counts. Of effects' columns only those
/// `asked` for, by their numbers, are made; the others are zero.
pub(super) fn each_row(
    walk: &Walk,
    stance: &Stance,
    at: Linearised<'_>,
    outside: &[u64],
    asked: impl Fn(usize) -> bool,
    mut tell: impl FnMut(Row<'_>),
) -> Windows {
    let Linearised { setup, moved } = at;
    let columns = &*setup.columns;
    let loads = columns.loads();
    let acc = columns.acc();
    let mut kept = Windows::default();
    let mut row = vec![0.0; columns.len() + 1];
    let effects: Vec<(usize, usize, &Column)> = (columns.effects())
        .filter(|(k, ..)| asked(*k))
        .map(|(k, site, linear)| (k, site, &linear.column))
        .collect();
    let of_effect = |n: usize| effects.iter().any(|(_, own, _)| *own == n);
    let counts = each_window(walk, stance, setup, of_effect, |seen| {
        let rows = seen.rows;
        let start_us = rows.span_us[0];
        if outside.binary_search(&start_us).is_ok() {
            kept.outside += 1;
            return;
        }
        let told = Told::of(walk, stance, rows, &columns.robot);
        if told.equations == 0 {
            kept.still += 1;
            return;
        }
        let projection = seen.projection(setup);
        let effects: Vec<(usize, Vec<f64>)> = effects
            .iter()
            .map(|&(k, site, column)| (k, projection.column(site, column)))
            .collect();
        let moved: Vec<(usize, &Vec<f64>)> = moved.columns(start_us).collect();
        let mut rank = told.equations;
        for (c, _) in told
            .coordinates
            .iter()
            .enumerate()
            .filter(|(_, told)| **told)
        {
            row[..acc].copy_from_slice(rows.inertial(c).as_flattened());
            row[acc..acc + MOVED].copy_from_slice(&rows.acceleration[c]);
            row[acc + MOVED..].fill(0.0);
            effects.iter().for_each(|(k, column)| row[*k] = column[c]);
            for (k, body, load) in &loads {
                let own = &rows.inertial(c)[*body];
                row[*k] = own.iter().zip(load).map(|(a, x)| a * x).sum();
            }
            moved.iter().for_each(|(k, column)| row[*k] = column[c]);
            // The columns are of what sensors get wrong beyond what is taken off: of all of it with this on the right.
            let taken = setup.sensors.taken(columns);
            let taken = taken.map(|(k, value)| value * row[k]).sum::<f64>();
            row[columns.len()] = rows.torque[c] + taken;
            tell(Row {
                start: start_us as f64 * 1e-6,
                rank: std::mem::take(&mut rank),
                coordinate: c,
                loaded: &told.loaded,
                numbers: &mut row,
            });
        }
        kept.used += 1;
        kept.held += u64::from(told.held);
        kept.equations += told.equations as u64;
        kept.resting += told.resting as u64;
        let feet = told.loaded.iter().filter(|loaded| **loaded).count();
        if kept.by_feet.is_empty() {
            kept.by_feet = vec![0; told.loaded.len() + 1];
        }
        kept.by_feet[feet] += 1;
    });
    counts.plus(&kept)
}

/// Parameters that rows are made at, and what moved readings leave there.
#[derive(Clone, Copy)]
pub(super) struct Linearised<'a> {
    pub(super) setup: &'a RowSetup,
    pub(super) moved: &'a MovedReadings,
}

/// Tells the windows of a walk as its sensors read it, and counts those that are lost. Only effects that are `asked` for, by their numbers, see
/// bristles.
pub(super) fn each_window(
    walk: &Walk,
    stance: &Stance,
    setup: &RowSetup,
    asked: impl Fn(usize) -> bool,
    mut tell: impl FnMut(&SeenWindow<'_>),
) -> Windows {
    let sensors = &setup.sensors;
    let walk = &sensors.corrected(walk);
    let states = &JointStates::of((walk, stance), &setup.columns, asked);
    let robot = &*setup.columns.robot;
    let mut window = Window::new((walk, stance), robot, &setup.tree, sensors);
    let impacts: Vec<f64> = (0..walk.len())
        .filter(|n| stance.touch_down[*n])
        .map(|n| walk.seconds(n))
        .collect();
    let mut counts = Windows::default();
    // The samples of the open window.
    let mut samples: Vec<usize> = Vec::new();
    for n in 0..walk.len() {
        let t = walk.seconds(n);
        let next = impacts.partition_point(|i| *i < t - AFTER_IMPACT - JITTER);
        if impacts
            .get(next)
            .is_some_and(|i| *i <= t + BEFORE_IMPACT + JITTER)
        {
            counts.impact += u64::from(!samples.is_empty());
            samples.clear();
            window.clear();
            continue;
        }
        if n > 0 && stance.held[n] != stance.held[n - 1] {
            counts.cut += u64::from(!samples.is_empty());
            samples.clear();
            window.clear();
        }
        match window.push(n) {
            Push::Closed => {
                let rows = window.rows();
                samples.extend((rows.span_us[1] == walk.time_us[n]).then_some(n));
                tell(&SeenWindow {
                    rows,
                    states,
                    stance,
                    sensors,
                    samples: &samples,
                });
                samples = vec![n];
            }
            Push::Cut => {
                counts.cut += 1;
                samples = vec![n];
            }
            Push::Gap => {
                counts.gap += 1;
                samples = vec![n];
            }
            Push::Rejected => counts.rejected += 1,
            Push::Used => samples.push(n),
        }
    }
    counts
}

/// The windows of a walk.
pub(super) fn windows_of(walk: &Walk, stance: &Stance, setup: &RowSetup) -> Vec<WindowSamples> {
    let mut all = Vec::new();
    each_window(
        walk,
        stance,
        setup,
        |_| false,
        |seen| {
            all.push(WindowSamples {
                start_us: seen.rows.span_us[0],
                samples: seen.samples.to_vec(),
                resting: seen.rows.resting.clone(),
            });
        },
    );
    all
}

/// Which of a window's equations are of use.
struct Told {
    coordinates: Vec<bool>,
    /// How many of these contact forces leave.
    equations: usize,
    /// Joints that friction may hold.
    resting: usize,
    /// Which feet may carry a force.
    loaded: Vec<bool>,
    held: bool,
}

impl Told {
    /// Of a window's rows.
    fn of(walk: &Walk, stance: &Stance, rows: &WindowRows, robot: &Legged) -> Self {
        let [first, last] = rows
            .span_us
            .map(|us| walk.time_us.partition_point(|t| *t < us));
        let (loaded, held) = (&stance.loaded[first], stance.held[first]);
        let told = |c: usize| {
            let joint = c.checked_sub(OF_BASE);
            let moves = joint.is_none_or(|j| !rows.resting[j]);
            // Each leg in the air by itself: no force but the base's acts on it, and that is in the base's equations.
            let alone = || joint.is_some_and(|j| !robot.limb_is_loaded(j, loaded));
            moves && (!held || alone())
        };
        let coordinates: Vec<bool> = (0..robot.coordinates()).map(told).collect();
        let equations = if held {
            coordinates.iter().filter(|c| **c).count()
        } else if stands(
            &walk.q,
            first..=last,
            walk.seconds(last) - walk.seconds(first),
        ) {
            0
        } else {
            rows.rank
        };
        Self {
            coordinates,
            equations,
            resting: rows.resting.iter().filter(|resting| **resting).count(),
            loaded: loaded.clone(),
            held,
        }
    }
}

/// Whether most joints stay where they are for so long (s), whatever is said of their velocities: the robot stands, and what is left of its equations
/// are the sensors' biases.
fn stands(positions: &Channels, samples: RangeInclusive<usize>, seconds: f64) -> bool {
    let joints = positions.width();
    let moves = |j: &usize| {
        let own = || samples.clone().map(|n| positions[n][*j]);
        let [least, most] = [f64::min, f64::max].map(|of| own().reduce(of).unwrap_or(0.0));
        most - least >= STANDING_NOISE * seconds
    };
    2 * (0..joints).filter(moves).count() < joints
}

/// Folds a walk into blocks of `seconds`, and counts.
pub(super) fn fold(
    walk: &Walk,
    stance: &Stance,
    at: Linearised<'_>,
    outside: &[u64],
    seconds: f64,
) -> (Vec<Block>, Windows) {
    let columns = at.setup.columns.len();
    let mut blocks: Vec<Block> = Vec::new();
    let counts = each_row(
        walk,
        stance,
        at,
        outside,
        |_| true,
        |row| {
            let block = (row.start / seconds) as usize;
            let known = blocks.len().max(block + 1);
            blocks.resize_with(known, || Block::empty(columns));
            blocks[block].push(row.numbers);
            blocks[block].folded.equations += row.rank as f64;
        },
    );
    blocks.iter_mut().for_each(Block::fold);
    (blocks, counts)
}
