//! All walks' windows as factors: one per block of time, all together, and all but each part of the time.

use nalgebra::{DMatrix, DVector};
use proprio_core::tree::GRAVITY;

use super::outside;
use super::rows::{
    ACC, Block, COLUMNS, COORDINATES, Linearised, RowSetup, SCALE, WholeFactor, Windows, each_row,
    empty, fold,
};
use super::sensors::{ACC_SCALE, MovedReadings};
use super::stance::Stance;
use super::structure::ModelStructure;
use super::unseen::{self, UnseenFoot};
use super::walk::Walk;
use super::{FreeBaseError, Walks};
use crate::estimate::robot::side_by_side;

/// Length of a block of time, s, and how many blocks a short log is cut into at least.
const BLOCK: f64 = 1.0;
const LEAST_BLOCKS: f64 = 12.0;
/// Fits at most that tell which windows are outside: the first is spoilt by these.
const ROUNDS: usize = 3;
/// A larger share of windows outside is told: a log with two blows in a hundred is as usual.
pub(super) const MANY: f64 = 0.02;
/// How far gravity is from 9.81 m/s² where a robot may be: 9.78 at the equator and 9.83 at the poles (GRS 80), less on mountains.
const LOCAL_GRAVITY: f64 = 0.015;
/// Parts of the time that are predicted by the others.
pub(crate) const PARTS: usize = 5;

/// Blocks taken together.
pub(super) struct Sum {
    pub(super) factor: WholeFactor,
    /// The factor's triangle, the right-hand side last.
    pub(super) rows: DMatrix<f64>,
    pub(super) equations: f64,
}

impl Sum {
    fn of<'a>(blocks: impl Iterator<Item = &'a Block>) -> Self {
        let (mut factor, mut equations) = (empty(), 0.0);
        let mut scratch = vec![0.0; COLUMNS + 1];
        for block in blocks {
            // Same columns and finite numbers: cannot fail.
            let _ = factor.merge(&block.factor, |c| c, 1.0, &mut scratch);
            equations += block.equations;
        }
        Self {
            rows: dense(&factor),
            factor,
            equations,
        }
    }

    /// Sum of squares that these parameters leave, N² m².
    pub(super) fn squares(&self, theta: &DVector<f64>) -> f64 {
        self.factor.sum_of_squares(theta.as_slice())
    }
}

/// A part of the time, and all blocks that share no noise with it.
pub(super) struct Part {
    pub(super) own: Sum,
    pub(super) others: Sum,
}

/// What the walks say of all columns.
pub(crate) struct Data {
    /// What gravity's length tells of the accelerometer's bias, one row per walk ([`gravity_rows`]).
    pub(super) gravity: DMatrix<f64>,
    pub(super) blocks: Vec<Block>,
    pub(super) all: Sum,
    /// None of logs that are too short.
    pub(super) parts: Vec<Part>,
    pub(crate) windows: Windows,
    setup: RowSetup,
    /// What moved readings leave, log after log.
    moved: Vec<MovedReadings>,
    /// When windows begin that are left out, log after log, µs in order.
    outside: Vec<Vec<u64>>,
    /// Feet that carry a force in some of these while they are taken to be in the air.
    pub(crate) unseen: Vec<UnseenFoot>,
}

impl Data {
    /// Makes the rows twice: the sensors' columns are derivatives, at first at the model's masses, then at the fit of
    /// `structure`. Again where that fit leaves far more of some windows than of others: these spoilt it, and are left out.
    pub(crate) fn of(walks: &Walks, structure: &ModelStructure) -> Result<Self, FreeBaseError> {
        let mut setup = RowSetup::cad();
        let mut outside = vec![Vec::new(); walks.walks.len()];
        let gravity = gravity_rows(&walks.walks);
        let mut parts = None;
        for _ in 0..ROUNDS {
            let data = Self::made(walks, setup, gravity.clone(), outside.clone(), true)?;
            let fit = data.fit(structure).ok_or(FreeBaseError::Unsolvable)?;
            // Rows that were made at another fit are much the same.
            parts = data.held_out_from(structure, parts.as_deref().unwrap_or_default());
            let thetas = match &parts {
                Some(parts) => parts.iter().map(|part| &part.theta).collect(),
                None => vec![fit.theta()],
            };
            let before = std::mem::replace(&mut outside, outside::windows(walks, &data, &thetas));
            setup = RowSetup::at(fit.theta());
            if outside == before {
                break;
            }
        }
        let mut data = Self::made(walks, setup, gravity, outside, true)?;
        if data.windows.outside > 0 {
            let fit = data.fit(structure).ok_or(FreeBaseError::Unsolvable)?;
            data.unseen = unseen::feet(walks, &data, fit.theta());
        }
        Ok(data)
    }

    /// The rows of all windows at the CAD's bodies, none left out for what a fit leaves of it: for a motion of which there is no fit.
    pub(super) fn unjudged(walks: &Walks) -> Result<Self, FreeBaseError> {
        let outside = vec![Vec::new(); walks.walks.len()];
        let gravity = gravity_rows(&walks.walks);
        Self::made(walks, RowSetup::cad(), gravity, outside, false)
    }

    fn made(
        walks: &Walks,
        setup: RowSetup,
        gravity: DMatrix<f64>,
        outside: Vec<Vec<u64>>,
        parts: bool,
    ) -> Result<Self, FreeBaseError> {
        let (mut blocks, mut windows) = (Vec::new(), Windows::default());
        let logs = walks.walks.iter();
        let moved: Vec<MovedReadings> = logs
            .map(|(walk, stance)| MovedReadings::of(walk, stance, &setup))
            .collect();
        for (n, (walk, stance)) in walks.walks.iter().enumerate() {
            let at = Linearised {
                setup: &setup,
                moved: &moved[n],
            };
            let (own, counts) = fold(walk, stance, at, &outside[n], seconds(walk));
            let own = own.into_iter().enumerate().map(|(k, mut block)| {
                block.of = (n, k);
                block
            });
            blocks.extend(own.filter(|block| block.equations > 0.0));
            windows = windows.plus(&counts);
        }
        if blocks.is_empty() {
            return Err(FreeBaseError::NoWindows(Box::new(windows)));
        }
        Ok(Self {
            gravity,
            all: Sum::of(blocks.iter()),
            parts: if parts { parts_of(&blocks) } else { Vec::new() },
            blocks,
            windows,
            setup,
            moved,
            outside,
            unseen: Vec::new(),
        })
    }

    /// What the rows of log `n` are made at.
    pub(super) fn linearised(&self, n: usize) -> Linearised<'_> {
        Linearised {
            setup: &self.setup,
            moved: &self.moved[n],
        }
    }

    /// When the windows of log `n` begin that are left out, µs in order.
    pub(super) fn outside(&self, n: usize) -> &[u64] {
        &self.outside[n]
    }

    /// What a user should know about the windows.
    pub(crate) fn warnings(&self) -> Vec<String> {
        let Windows { used, outside, .. } = self.windows;
        let all = used + outside;
        let many = outside as f64 > MANY * all as f64;
        let told = many.then(|| {
            format!(
                "{outside} of {all} windows are left out: what remains of each is more than {:.0} times the usual, which is no noise and none of \
                 the catalogue's effects: a push, a blow, a foot that strikes or touches unseen",
                outside::LIMIT
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
        let mut sums = vec![Sums::default(); thetas.len()];
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
    fn each_equation(
        &self,
        walks: &Walks,
        thetas: &[Vec<&DVector<f64>>],
        mut tell: impl FnMut(Equation<'_>),
    ) {
        let mut predicted = vec![0.0; thetas.len()];
        for (n, ((walk, stance), start)) in walks.walks.iter().zip(walks.starts()).enumerate() {
            each_row(walk, stance, self.linearised(n), &self.outside[n], |row| {
                let scale = SCALE[row.coordinate];
                for (predicted, parts) in predicted.iter_mut().zip(thetas) {
                    let theta = self.of_the_part((n, row.start), walk, parts);
                    let terms = theta.iter().zip(&*row.numbers).map(|(x, a)| x * a);
                    *predicted = terms.sum::<f64>() / scale;
                }
                tell(Equation {
                    t: start + row.start,
                    window: stance.window_us as f64 * 1e-6,
                    coordinate: row.coordinate,
                    measured: row.numbers[COLUMNS] / scale,
                    predicted: &predicted,
                });
            });
        }
    }
}

/// An equation of a window, in N m (N of forces): what is measured, and what models say.
pub(crate) struct Equation<'a> {
    /// When its window began, s.
    pub(crate) t: f64,
    /// How long windows are there, s.
    window: f64,
    pub(crate) coordinate: usize,
    pub(crate) measured: f64,
    pub(crate) predicted: &'a [f64],
}

/// What a model leaves of each coordinate's equation: moments on the base (N m), forces on it (N), torques of the joints (N m).
pub(crate) struct Left {
    /// Root mean square.
    pub(crate) rms: [f64; COORDINATES],
    /// Correlation of windows that follow each other, and how many pairs of them tell it.
    pub(crate) correlation: [f64; COORDINATES],
    pub(crate) pairs: [u64; COORDINATES],
}

/// A window that begins so many lengths after another follows it; what lies between is left out else, and a correlation would be none of neighbours.
const FOLLOWS: f64 = 1.5;

#[derive(Clone, Default)]
struct Sums {
    squares: [f64; COORDINATES],
    windows: [u64; COORDINATES],
    /// Of pairs of windows: products, and mean squares.
    products: [f64; COORDINATES],
    pair_squares: [f64; COORDINATES],
    pairs: [u64; COORDINATES],
    /// When the last window began, s, and what was left of it.
    last: [Option<(f64, f64)>; COORDINATES],
}

impl Sums {
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
            rms: std::array::from_fn(|c| (self.squares[c] / self.windows[c].max(1) as f64).sqrt()),
            correlation: std::array::from_fn(|c| {
                self.products[c] / self.pair_squares[c].max(f64::MIN_POSITIVE)
            }),
            pairs: self.pairs,
        }
    }
}

/// Length of a walk's blocks, s.
fn seconds(walk: &Walk) -> f64 {
    BLOCK.min(walk.duration() / LEAST_BLOCKS)
}

/// The parts of the time, each with the blocks that are not its neighbours: those share its noise.
fn parts_of(blocks: &[Block]) -> Vec<Part> {
    let count = blocks.len();
    if count < 2 * PARTS {
        return Vec::new();
    }
    let parts: Vec<usize> = (0..PARTS).collect();
    side_by_side(&parts, |&part| {
        let own = |k: usize| k * PARTS / count == part;
        let near = |k: usize| own(k) || own(k + 1) || (k > 0 && own(k - 1));
        let chosen = |which: &dyn Fn(usize) -> bool| {
            let blocks = blocks.iter().enumerate();
            Sum::of(blocks.filter(|(k, _)| which(*k)).map(|(_, block)| block))
        };
        Part {
            own: chosen(&own),
            others: chosen(&|k| !near(k)),
        }
    })
}

/// What gravity's length tells of the accelerometer's bias: a row per walk, of all columns and the right-hand side, in units of its deviation. All walks
/// are taken to be of one place, whose gravity nobody has measured.
fn gravity_rows(walks: &[(Walk, Stance)]) -> DMatrix<f64> {
    let told = walks.iter();
    let told = told.filter_map(|(walk, stance)| walk.gravity(stance.held.contains(&true)));
    let told: Vec<_> = told.collect();
    let mut rows = DMatrix::zeros(told.len(), COLUMNS + 1);
    for (r, gravity) in told.iter().enumerate() {
        for n in 0..3 {
            rows[(r, ACC + n)] = gravity.up[n];
        }
        rows[(r, ACC + ACC_SCALE)] = GRAVITY;
        rows[(r, COLUMNS)] = gravity.excess;
    }
    let covariance = DMatrix::from_fn(told.len(), told.len(), |r, c| {
        let own = if r == c { told[r].std.powi(2) } else { 0.0 };
        own + LOCAL_GRAVITY.powi(2)
    });
    // Each has a deviation of its own, so there is a root.
    let root = covariance.cholesky();
    root.and_then(|root| root.l().solve_lower_triangular(&rows))
        .unwrap_or_else(|| DMatrix::zeros(0, COLUMNS + 1))
}

/// A factor's triangle as a matrix, the right-hand side last.
pub(super) fn dense(factor: &WholeFactor) -> DMatrix<f64> {
    let n = factor.columns();
    let mut rows = DMatrix::zeros(n, n + 1);
    for k in 0..n {
        for (c, x) in factor.row(k).iter().enumerate() {
            rows[(k, k + c)] = *x;
        }
    }
    rows
}
