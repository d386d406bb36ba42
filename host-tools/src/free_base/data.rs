//! All walks' windows as factors: one per block of time, all together, and all but each part of the time.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::columns::{EffectSite, WalkColumns};
use super::error::FreeBaseError;
use super::gravity;
use super::moved_readings::MovedReadings;
use super::outside::{LIMIT, MANY};
use super::projection::{JointStates, Projection};
use super::row_setup::RowSetup;
use super::rows::{Block, Folded, Linearised, each_row, fold, windows_of};
use super::stance::Stance;
use super::structure::ModelStructure;
use super::unseen::UnseenFoot;
use super::walk::Walk;
use super::walks::Walks;
use super::windows::{WindowSamples, Windows};
use crate::estimate::factor::HeapFactor;
use crate::parallel::by_number;

/// Length of a block of time, s, and how many blocks a short log is cut into at least.
const BLOCK: f64 = 1.0;
const LEAST_BLOCKS: f64 = 12.0;
/// Parts of the time that are predicted by the others.
pub(crate) const PARTS: usize = 5;

/// Blocks taken together.
pub(crate) struct Sum {
    pub(crate) factor: HeapFactor,
    /// The factor's triangle, the right-hand side last.
    pub(super) rows: DMatrix<f64>,
    pub(crate) equations: f64,
}

impl Sum {
    fn of(folded: Folded) -> Self {
        Self {
            rows: folded.factor.dense(),
            factor: folded.factor,
            equations: folded.equations,
        }
    }

    /// Sum of squares that these parameters leave, N² m².
    pub(super) fn squares(&self, theta: &DVector<f64>) -> f64 {
        self.factor.sum_of_squares(theta.as_slice())
    }
}

/// A part of the time, and all blocks that share no noise with it.
pub(crate) struct Part {
    pub(crate) own: Sum,
    pub(crate) others: Sum,
}

/// What the walks say of all columns.
pub(crate) struct Data {
    /// What gravity's length tells of the accelerometer's bias, one row per walk ([`gravity::length_rows`]).
    pub(crate) gravity: DMatrix<f64>,
    pub(super) blocks: Vec<Block>,
    pub(crate) all: Sum,
    /// None of logs that are too short.
    pub(crate) parts: Vec<Part>,
    pub(crate) windows: Windows,
    setup: RowSetup,
    readings: Readings,
    /// When windows begin that are left out, log after log, µs in order.
    pub(super) outside: Vec<Vec<u64>>,
    /// Feet that carry a force in some of these while they are taken to be in the air.
    pub(crate) unseen: Vec<UnseenFoot>,
}

impl Data {
    /// The rows of all windows at the CAD's bodies, none left out for what a fit leaves of it: for a motion of which there is no fit.
    pub(super) fn unjudged(
        walks: &Walks,
        structure: &ModelStructure,
    ) -> Result<Self, FreeBaseError> {
        let outside = vec![Vec::new(); walks.walks.len()];
        let setup = RowSetup::cad(Arc::new(structure.columns()));
        let readings = Readings::of(walks, windows_of_all(walks, &setup), &setup);
        Self::made(walks, setup, outside, readings)
    }

    /// The same with other nonlinear parameters of the same effects.
    pub(crate) fn with_sites(
        &self,
        walks: &Walks,
        sites: Vec<EffectSite>,
    ) -> Result<Self, FreeBaseError> {
        let setup = self.setup.with_columns(WalkColumns {
            robot: walks.robot.clone(),
            sites,
        });
        let (outside, readings) = (self.outside.clone(), self.readings.clone());
        Ok(Self {
            unseen: self.unseen.clone(),
            ..Self::made(walks, setup, outside, readings)?
        })
    }

    /// What parameters leave of each equation, log after log and window by window.
    pub(crate) fn left(&self, walks: &Walks, theta: &DVector<f64>) -> Vec<Vec<LeftOfWindow>> {
        self.left_with(walks, theta, (&[], 1))
    }

    /// The same with these columns of one window in `every` so many.
    pub(crate) fn left_with(
        &self,
        walks: &Walks,
        theta: &DVector<f64>,
        (columns, every): (&[usize], usize),
    ) -> Vec<Vec<LeftOfWindow>> {
        let logs = walks.walks.iter().enumerate();
        let of = |(n, (walk, stance)): (usize, &(Walk, Stance))| {
            let (mut windows, mut count) = (Vec::<LeftOfWindow>::new(), 0);
            let (at, outside) = (self.linearised(n), &self.outside[n]);
            let asked = |k: usize| theta[k] != 0.0 || columns.binary_search(&k).is_ok();
            each_row(walk, stance, at, outside, asked, |row| {
                let start_us = (row.start * 1e6).round() as u64;
                if row.rank > 0 {
                    count += 1;
                    if (count - 1) % every == 0 {
                        windows.push(LeftOfWindow {
                            start_us,
                            measured: vec![f64::NAN; walks.robot.coordinates()],
                            left: vec![f64::NAN; walks.robot.coordinates()],
                            columns: vec![Vec::new(); walks.robot.coordinates()],
                        });
                    }
                }
                let own = windows.last_mut();
                if let Some(own) = own.filter(|own| own.start_us == start_us) {
                    let chosen = columns.iter().map(|k| row.numbers[*k]);
                    own.columns[row.coordinate] = chosen.collect();
                    let measured = row.numbers[theta.len()];
                    let terms = theta.iter().zip(&*row.numbers).map(|(x, a)| x * a);
                    own.measured[row.coordinate] = measured;
                    own.left[row.coordinate] = measured - terms.sum::<f64>();
                }
            });
            windows
        };
        logs.map(of).collect()
    }

    /// The windows of log `n`.
    pub(crate) fn windows_of(&self, n: usize) -> &[WindowSamples] {
        &self.readings.windows[n]
    }

    /// What effects see of log `n`, whose walk is `corrected`; only those `wanted` by their numbers see bristles.
    pub(crate) fn joint_states<'a>(
        &'a self,
        walks: &'a Walks,
        n: usize,
        corrected: &'a Walk,
        wanted: impl Fn(usize) -> bool,
    ) -> JointStates<'a> {
        JointStates::of((corrected, &walks.walks[n].1), self.columns(), wanted)
    }

    /// What one of its windows makes of joints' torques.
    pub(crate) fn projection<'a>(
        &self,
        walks: &Walks,
        n: usize,
        states: &'a JointStates<'a>,
        window: &WindowSamples,
    ) -> Projection<'a> {
        let contact = (&self.setup, &self.setup.sensors, &walks.walks[n].1);
        Projection::of(states, contact, &window.samples, &window.resting)
    }

    /// A walk as the sensors that rows are made at read it.
    pub(crate) fn corrected(&self, walk: &Walk) -> Walk {
        self.setup.sensors.corrected(walk)
    }

    /// The parameters that its rows are made at.
    pub(super) fn made_at(&self) -> &DVector<f64> {
        &self.setup.theta
    }

    /// The columns of its rows.
    pub(crate) fn columns(&self) -> &WalkColumns {
        &self.setup.columns
    }

    /// The rows of all windows but those `outside`, at the parameters of `setup` and with these `readings`.
    pub(super) fn made(
        walks: &Walks,
        setup: RowSetup,
        outside: Vec<Vec<u64>>,
        readings: Readings,
    ) -> Result<Self, FreeBaseError> {
        let columns = setup.columns.len();
        let (mut blocks, mut windows) = (Vec::new(), Windows::default());
        for (n, (walk, stance)) in walks.walks.iter().enumerate() {
            let at = Linearised {
                setup: &setup,
                moved: &readings.moved[n],
            };
            let (own, counts) = fold(walk, stance, at, &outside[n], seconds(walk));
            let own = own.into_iter().enumerate().map(|(k, mut block)| {
                block.of = (n, k);
                block
            });
            blocks.extend(own.filter(|block| block.folded.equations > 0.0));
            windows = windows.plus(&counts);
        }
        if blocks.is_empty() {
            return Err(FreeBaseError::NoWindows(Box::new(windows)));
        }
        let (all, parts) = sums_of(columns, &blocks);
        Ok(Self {
            gravity: gravity::length_rows(&walks.walks, &setup.columns),
            all,
            parts,
            blocks,
            windows,
            setup,
            readings,
            outside,
            unseen: Vec::new(),
        })
    }

    /// The same rows made at other parameters.
    pub(super) fn setup_at(&self, theta: DVector<f64>) -> RowSetup {
        RowSetup::at(self.setup.columns.clone(), theta)
    }

    /// What these rows are made at, with other columns.
    pub(super) fn setup_with(&self, columns: &WalkColumns) -> RowSetup {
        self.setup.with_columns(columns.clone())
    }

    /// What the rows of log `n` are made at.
    pub(super) fn linearised(&self, n: usize) -> Linearised<'_> {
        Linearised {
            setup: &self.setup,
            moved: &self.readings.moved[n],
        }
    }

    /// What a user should know about the windows.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let Windows { used, outside, .. } = &self.windows;
        let all = used + outside;
        let many = *outside as f64 > MANY * all as f64;
        let told = many.then(|| {
            format!(
                "{outside} of {all} windows are left out: what remains of each is more than {LIMIT:.0} times the usual, which is no noise and none of \
                 the catalogue's effects: a push, a blow, a foot that strikes or touches unseen"
            )
        });
        let unseen = self.unseen.iter().map(UnseenFoot::words);
        told.into_iter().chain(unseen).collect()
    }

    /// Root mean square that these parameters leave, N m.
    pub(crate) fn rms(&self, theta: &DVector<f64>) -> f64 {
        (self.all.squares(theta) / self.all.equations.max(1.0)).sqrt()
    }

    /// What each of several models leaves of each coordinate's equation, with one set of parameters for each part of the time or one for
    /// all.
    pub(crate) fn by_coordinate(&self, walks: &Walks, thetas: &[Vec<&DVector<f64>>]) -> Vec<Left> {
        self.by_coordinate_and(walks, thetas, |_| ())
    }

    /// The same; `tell` hears of every equation.
    pub(crate) fn by_coordinate_and(
        &self,
        walks: &Walks,
        thetas: &[Vec<&DVector<f64>>],
        mut tell: impl FnMut(&Equation<'_>),
    ) -> Vec<Left> {
        let mut sums = vec![Sums::new(walks.robot.coordinates()); thetas.len()];
        self.each_equation(walks, thetas, |equation| {
            tell(&equation);
            for (sums, predicted) in sums.iter_mut().zip(equation.predicted) {
                sums.add(&equation, equation.measured - predicted);
            }
        });
        sums.iter().map(Sums::told).collect()
    }

    /// Which of these parameters, of each part of the time or one for all, are of a window of log n that begins then, s.
    pub(super) fn of_the_part<'a>(
        &self,
        (n, start): (usize, f64),
        walk: &Walk,
        parts: &[&'a DVector<f64>],
    ) -> &'a DVector<f64> {
        let block = (n, (start / seconds(walk)) as usize);
        let at = self.blocks.partition_point(|b| b.of < block);
        // Blocks of which nothing was used are none: what comes after the last is of the last part.
        parts[(at * parts.len() / self.blocks.len()).min(parts.len() - 1)]
    }

    /// Every equation under several models, log after log as [`Walks::starts`] puts them.
    pub(crate) fn each_equation(
        &self,
        walks: &Walks,
        thetas: &[Vec<&DVector<f64>>],
        mut tell: impl FnMut(Equation<'_>),
    ) {
        let mut predicted = vec![0.0; thetas.len()];
        let asked = |k: usize| thetas.iter().flatten().any(|theta| theta[k] != 0.0);
        for (n, ((walk, stance), start)) in walks.walks.iter().zip(walks.starts()).enumerate() {
            let (at, outside) = (self.linearised(n), &self.outside[n]);
            each_row(walk, stance, at, outside, asked, |row| {
                let scale = walks.robot.scale[row.coordinate];
                for (predicted, parts) in predicted.iter_mut().zip(thetas) {
                    let theta = self.of_the_part((n, row.start), walk, parts);
                    let terms = theta.iter().zip(&*row.numbers).map(|(x, a)| x * a);
                    *predicted = terms.sum::<f64>() / scale;
                }
                tell(Equation {
                    log: n,
                    start: row.start,
                    t: start + row.start,
                    window: stance.window_us as f64 * 1e-6,
                    coordinate: row.coordinate,
                    loaded: row.loaded,
                    measured: row.numbers[row.numbers.len() - 1] / scale,
                    predicted: &predicted,
                });
            });
        }
    }
}

/// The windows of all logs.
pub(super) type WindowsOfAll = Arc<Vec<Vec<WindowSamples>>>;

/// Log after log the windows, and what moved readings leave of them.
#[derive(Clone)]
pub(super) struct Readings {
    windows: WindowsOfAll,
    moved: Arc<Vec<MovedReadings>>,
}

impl Readings {
    /// Of these windows, at the parameters that rows are made at.
    pub(super) fn of(walks: &Walks, windows: WindowsOfAll, setup: &RowSetup) -> Self {
        let logs = walks.walks.iter().zip(&*windows);
        let moved =
            logs.map(|((walk, stance), windows)| MovedReadings::of(walk, stance, setup, windows));
        Self {
            moved: Arc::new(moved.collect()),
            windows,
        }
    }
}

pub(super) fn windows_of_all(walks: &Walks, setup: &RowSetup) -> WindowsOfAll {
    let logs = walks.walks.iter();
    let windows = logs.map(|(walk, stance)| windows_of(walk, stance, setup));
    Arc::new(windows.collect())
}

/// What parameters leave of a window's equations, as rows are scaled; not a number of an equation that is left out.
pub(crate) struct LeftOfWindow {
    /// When the window began.
    pub(crate) start_us: u64,
    pub(crate) measured: Vec<f64>,
    pub(crate) left: Vec<f64>,
    /// The columns that were asked for, in the order of that.
    pub(crate) columns: Vec<Vec<f64>>,
}

/// An equation of a window, in N m (N of forces): what is measured, and what models say.
pub(crate) struct Equation<'a> {
    /// Of which log, and when its window began there, s.
    pub(crate) log: usize,
    pub(crate) start: f64,
    /// The same as [`Walks::starts`] puts logs, s.
    pub(crate) t: f64,
    /// How long windows are there, s.
    pub(crate) window: f64,
    pub(crate) coordinate: usize,
    /// Which feet may carry a force.
    pub(crate) loaded: &'a [bool],
    pub(crate) measured: f64,
    pub(crate) predicted: &'a [f64],
}

/// What a model leaves of each coordinate's equation: moments on the base (N m), forces on it (N), torques of the joints (N m).
pub(crate) struct Left {
    /// Root mean square.
    pub(crate) rms: Vec<f64>,
    /// Correlation of windows that follow each other, and how many pairs of them tell it.
    pub(crate) correlation: Vec<f64>,
    pub(crate) pairs: Vec<u64>,
}

/// A window that begins so many lengths after another follows it; what lies between is left out else, and a correlation would be none of neighbours.
const FOLLOWS: f64 = 1.5;

#[derive(Clone)]
struct Sums {
    squares: Vec<f64>,
    windows: Vec<u64>,
    /// Of pairs of windows: products, and mean squares.
    products: Vec<f64>,
    pair_squares: Vec<f64>,
    pairs: Vec<u64>,
    /// When the last window began, s, and what was left of it.
    last: Vec<Option<(f64, f64)>>,
}

impl Sums {
    fn new(coordinates: usize) -> Self {
        let zeros = || vec![0.0; coordinates];
        Self {
            squares: zeros(),
            windows: vec![0; coordinates],
            products: zeros(),
            pair_squares: zeros(),
            pairs: vec![0; coordinates],
            last: vec![None; coordinates],
        }
    }

    fn add(&mut self, equation: &Equation<'_>, left: f64) {
        let c = equation.coordinate;
        self.squares[c] += left * left;
        self.windows[c] += 1;
        if let Some((t, before)) = self.last[c].replace((equation.t, left))
            && equation.t - t < FOLLOWS * equation.window
        {
            self.products[c] += left * before;
            self.pair_squares[c] += 0.5 * (left * left + before * before);
            self.pairs[c] += 1;
        }
    }

    fn told(&self) -> Left {
        Left {
            rms: (self.squares.iter().zip(&self.windows))
                .map(|(squares, windows)| (squares / (*windows).max(1) as f64).sqrt())
                .collect(),
            correlation: (self.products.iter().zip(&self.pair_squares))
                .map(|(products, squares)| products / squares.max(f64::MIN_POSITIVE))
                .collect(),
            pairs: self.pairs.clone(),
        }
    }
}

/// Length of a walk's blocks, s.
fn seconds(walk: &Walk) -> f64 {
    BLOCK.min(walk.duration() / LEAST_BLOCKS)
}

/// All blocks, and the parts of the time, each with the blocks that are not its neighbours: those share its noise. No parts of few blocks.
///
/// What predicts a part is put together of the others, as a whole or without the block that is the part's neighbour, and not of all blocks again.
fn sums_of(columns: usize, blocks: &[Block]) -> (Sum, Vec<Part>) {
    let count = blocks.len();
    let folded = |blocks: &[Block]| Folded::of(columns, blocks.iter().map(|block| &block.folded));
    if count < 2 * PARTS {
        return (Sum::of(folded(blocks)), Vec::new());
    }
    let begin = |part: usize| (part * count).div_ceil(PARTS);
    let made = by_number(0..PARTS, |part| {
        let (first, last) = (begin(part), begin(part + 1) - 1);
        let middle = folded(&blocks[first + 1..last]);
        let [first, last] = [first, last].map(|k| &blocks[k].folded);
        let without_last = Folded::of(columns, [&middle, first]);
        PartBlocks {
            all: Folded::of(columns, [&without_last, last]),
            without_first: Folded::of(columns, [&middle, last]),
            without_last,
        }
    });
    let parts = by_number(0..PARTS, |part| {
        let others = made.iter().enumerate().filter(|(n, _)| *n != part);
        let others = others.map(|(n, own)| match n {
            _ if n == part + 1 => &own.without_first,
            _ if n + 1 == part => &own.without_last,
            _ => &own.all,
        });
        Folded::of(columns, others)
    });
    let all = Folded::of(columns, made.iter().map(|own| &own.all));
    let parts = made.into_iter().zip(parts).map(|(own, others)| Part {
        own: Sum::of(own.all),
        others: Sum::of(others),
    });
    (Sum::of(all), parts.collect())
}

/// The blocks of a part of the time.
struct PartBlocks {
    all: Folded,
    without_first: Folded,
    without_last: Folded,
}
