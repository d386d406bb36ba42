//! Whether a leg has changed: a test on each closed block of 2 s, against the data before it.
//!
//! Of a block's windows the *innovations* are looked at, what is left of the torque by the last solution from before the block.
//! A small triangle for each joint has them beside the columns of what may have changed: the joint's own bias and friction, and
//! for every body that it moves what a load on it adds ([`LOADS`]). So at the end of the block each hypothesis's share of
//! the squared innovations follows from the triangles alone: a generalised likelihood ratio (Basseville & Nikiforov, *Detection of
//! Abrupt Changes*, ch. 4). A load is one hypothesis for all joints that feel it, each in units of its own noise.
//!
//! The residuals remember, and what a model lacks repeats itself with the motion, so that no table of χ² tells how large is too
//! large. Nor would it be right to whiten by the solution's covariance alone, which takes residuals to be independent. So
//!
//! 1. something has happened only if the least squared residual of *all* columns, candidates included, grew by far more in this block
//!    than in those before, by their own mean and spread ([`Spread`]). A motion that shows what was not known before makes
//!    innovations, and no residual;
//! 2. it is a change of one kind only if that explains most of the squared innovations. Other noise does not, nor does a change in
//!    the midst of the block: such a block is left out, and the next one decides;
//! 3. both are judged after some blocks of like motion: the noise of a leg that begins to move is not that of one that hung still.

use super::{
    Active, BASE_RANK, DEVICE_COLUMNS, DeviceFolds, FRONT, LOADS, LegBase, columns, loads_felt,
    rank,
};
use crate::Real;
use crate::estimator::LEG_INERTIAL;
use crate::factor::{Block, Factor, FactorError, ROWS, packed_len};
use crate::inertia::INERTIAL;
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::scalar::{real, sqrt};

/// A joint's own columns, by their places in [`super::COLUMNS`]: bias, coulomb, viscous.
const OWN: [usize; 3] = [3, 1, 0];
/// Columns of a joint's small triangle.
const fn tested(joint: usize) -> usize {
    OWN.len() + loads_felt(joint)
}
const TEST_LEN: usize = packed_len(tested(0)) + packed_len(tested(1)) + packed_len(tested(2));
/// Columns of the longest joint's fold.
const LONGEST: usize = columns(0);

/// Fewest windows of a block that is judged: a second.
const LEAST_WINDOWS: f64 = 50.0;
/// Blocks after which a block is judged by those before.
const LEARNT: u32 = 8;
/// Blocks that mean and spread remember: two minutes.
const REMEMBERED: u32 = 64;
/// A residual's growth is beyond what was before by so many standard deviations of a block's, and by this factor.
const SPREADS: f64 = 8.0;
const FACTOR: f64 = 2.5;
/// The least mean, N² m²: that of 0.03 N m, what a quantum of the torque may leave of a leg that hung perfectly still.
const LEAST_MEAN: f64 = 9e-4;
/// Share of the squared innovations that a hypothesis has to explain.
const SHARE: f64 = 0.5;
/// Motion is another one where the mean squared velocity is so many times what it was.
const OTHER_MOTION: f64 = 4.0;
/// What a body may have picked up, kg: the prior's standard deviation of its mass from then on.
const LOAD: f64 = 1.0;

/// What has changed at a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChangeKind {
    /// Its bias.
    Bias,
    /// Its friction: it binds, or runs freely again.
    Friction,
    /// What its body carries.
    Load,
}

/// A change that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change<T> {
    /// What has changed.
    pub kind: ChangeKind,
    /// At which joint; of a load, the joint of the body that carries it.
    pub joint: usize,
    /// By how much, roughly: N m of bias or Coulomb friction, kg on a thigh or calf, kg m about the axis of a hip.
    pub size: T,
    /// Blocks of time in which it was noticed, the present one the last: 1 or 2.
    pub blocks: u64,
}

/// What a block says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict<T> {
    /// The leg is what it was.
    Same,
    /// Something has happened that no change explains: the block is to be left out.
    Doubtful,
    /// The leg has changed: the block is to be left out, and what the change touches to be forgotten.
    Changed(Change<T>),
}

impl<T: Real> Change<T> {
    /// How many directions of a joint's parameters the change touches.
    fn touched(&self, joint: usize) -> usize {
        match self.kind {
            ChangeKind::Load if joint <= self.joint => INERTIAL,
            ChangeKind::Bias if joint == self.joint => 1,
            ChangeKind::Friction if joint == self.joint => 2,
            _ => 0,
        }
    }

    /// Forgets what the data say of the n-th touched direction, counted over all joints; false if there is none.
    pub(crate) fn forget(&self, n: usize, folds: &mut DeviceFolds<T>, base: &LegBase<T>) -> bool {
        let (mut joint, mut n) = (0, n);
        while n >= self.touched(joint) {
            n -= self.touched(joint);
            joint += 1;
            if joint >= JOINTS_PER_LEG {
                return false;
            }
        }
        let mut direction = [T::zero(); LONGEST];
        if self.kind == ChangeKind::Load {
            let end = FRONT + rank(joint);
            let inertial = direction.get_mut(FRONT..end).unwrap_or(&mut []);
            base.write_direction(joint, self.joint, n, inertial);
        } else {
            let first = if self.kind == ChangeKind::Bias { 0 } else { 1 };
            if let Some(to) = OWN.get(first + n).and_then(|c| direction.get_mut(*c)) {
                *to = T::one();
            }
        }
        folds.forget_direction(joint, direction.get(..columns(joint)).unwrap_or(&[]));
        true
    }

    /// How well the CAD knows a body of this mass (kg) with a load: relative standard deviation of its mass. Nothing of other changes.
    pub(crate) fn uncertainty(&self, mass: T) -> Option<T> {
        (self.kind == ChangeKind::Load).then(|| real::<T>(LOAD) / mass)
    }
}

/// Mean and variance of what a joint's blocks left, and the motion that they were of.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Spread<T> {
    mean: T,
    variance: T,
    motion: T,
}

impl<T: Real> Spread<T> {
    const NONE: Self = Self {
        mean: T::ZERO,
        variance: T::ZERO,
        motion: T::ZERO,
    };

    /// Squared noise of a window, N² m².
    fn noise(&self) -> T {
        self.mean.max(real(LEAST_MEAN))
    }

    fn is_beyond(&self, growth: T) -> bool {
        let spread = self.mean + real::<T>(SPREADS) * sqrt(self.variance);
        growth > spread && growth > self.noise() * real(FACTOR)
    }

    fn is_of(&self, motion: T) -> bool {
        motion <= self.motion * real(OTHER_MOTION)
    }

    /// Learns from one more block after `blocks`; an outlier counts as the largest that is none.
    fn learn(&mut self, growth: T, motion: T, blocks: u32) {
        let share = T::one() / real((blocks.min(REMEMBERED - 1) + 1).into());
        let most = self.noise() * real(FACTOR);
        let growth = if blocks >= LEARNT {
            growth.min(most)
        } else {
            growth
        };
        let off = growth - self.mean;
        // Of the first block there is no spread yet.
        let square = if blocks > 0 { off * off } else { T::zero() };
        self.mean += off * share;
        self.variance += (square - self.variance) * share;
        self.motion += (motion - self.motion) * share;
    }
}

/// The test of a leg's blocks; see the module.
#[derive(Clone, Copy, Debug)]
pub struct BlockTest<T> {
    /// The solution that innovations are of, and the newest: each joint's parameters in the order of its fold's columns.
    reference: [[T; LONGEST]; JOINTS_PER_LEG],
    newest: [[T; LONGEST]; JOINTS_PER_LEG],
    /// Whether there is a newest one, and whether the reference is one.
    known: [bool; 2],
    triangles: [T; TEST_LEN],
    spreads: [Spread<T>; JOINTS_PER_LEG],
    /// Blocks learnt from.
    blocks: u32,
    /// The block before was doubtful.
    doubtful: bool,
    /// Of the windows that wait to be folded in so many were looked at.
    seen: usize,
}

impl<T: Real> BlockTest<T> {
    /// Nothing seen yet: all zeros.
    pub const fn empty() -> Self {
        Self {
            reference: [[T::ZERO; LONGEST]; JOINTS_PER_LEG],
            newest: [[T::ZERO; LONGEST]; JOINTS_PER_LEG],
            known: [false; 2],
            triangles: [T::ZERO; TEST_LEN],
            spreads: [const { Spread::NONE }; JOINTS_PER_LEG],
            blocks: 0,
            doubtful: false,
            seen: 0,
        }
    }

    /// Forgets all, in place.
    pub fn clear(&mut self) {
        self.known = [false; 2];
        self.blocks = 0;
        self.doubtful = false;
        self.seen = 0;
        self.triangles.fill(T::zero());
    }

    /// Takes note of a solution, θ of the leg with these effects; it counts from the next block on.
    pub fn learn(&mut self, values: &[T], active: &Active, base: &LegBase<T>) {
        for (joint, to) in self.newest.iter_mut().enumerate() {
            to.fill(T::zero());
            let Some(of_joint) = base.joint(joint) else {
                return;
            };
            let standard = values.get(INERTIAL * joint..LEG_INERTIAL).unwrap_or(&[]);
            let inertial = to.get_mut(FRONT..FRONT + rank(joint)).unwrap_or(&mut []);
            of_joint.base_of(standard, inertial);
        }
        let effects = values.get(LEG_INERTIAL..).unwrap_or(&[]);
        for ((joint, n), value) in active.effects().zip(effects) {
            let place = if n < FRONT { n } else { n + rank(joint) };
            if let Some(to) = self.newest.get_mut(joint).and_then(|to| to.get_mut(place)) {
                *to = *value;
            }
        }
        self.known[0] = true;
    }

    /// Begins a block.
    pub fn begin_block(&mut self) {
        for (to, from) in self.reference.iter_mut().zip(&self.newest) {
            to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
        }
        self.known[1] = self.known[0];
        self.triangles.fill(T::zero());
        // What waits may have been left out.
        self.seen = 0;
    }

    /// Whether it has looked at all windows that wait.
    pub fn has_seen(&self, folds: &DeviceFolds<T>) -> bool {
        self.seen == folds.waiting()
    }

    /// Looks at the windows that wait and that it has not seen yet.
    pub fn look(&mut self, folds: &DeviceFolds<T>, base: &LegBase<T>) {
        for joint in 0..JOINTS_PER_LEG {
            // Finite numbers, as the folds have found, and of the right length.
            let _ = self.see(joint, folds.waiting_rows(joint), base.loads(joint));
        }
        self.seen = folds.waiting();
    }

    /// Folds in the windows that wait, once it has looked at them.
    ///
    /// # Errors
    /// As [`DeviceFolds::fold`].
    pub fn fold(
        &mut self,
        folds: &mut DeviceFolds<T>,
        base: &LegBase<T>,
    ) -> Result<(), FactorError> {
        if !self.has_seen(folds) {
            self.look(folds, base);
        }
        self.seen = 0;
        folds.fold()
    }

    fn see(&mut self, joint: usize, rows: &Block<T>, loads: &[T]) -> Result<(), FactorError> {
        let error = FactorError::Length(joint);
        let (torque, columns) = rows.split_last().ok_or(error)?;
        let mut innovation = *torque;
        let reference = self.reference.get(joint).ok_or(error)?;
        for (column, value) in columns.iter().zip(reference) {
            add(&mut innovation, column, -*value);
        }
        let mut block = [[T::zero(); ROWS]; tested(0) + 1];
        for (to, place) in block.iter_mut().zip(OWN) {
            *to = *columns.get(place).ok_or(error)?;
        }
        let base = columns.get(FRONT..FRONT + rank(joint)).ok_or(error)?;
        for (to, direction) in block
            .iter_mut()
            .skip(OWN.len())
            .zip(loads.chunks_exact(rank(joint)))
        {
            for (column, share) in base.iter().zip(direction) {
                add(to, column, *share);
            }
        }
        let last = tested(joint);
        *block.get_mut(last).ok_or(error)? = innovation;
        // Windows that were looked at before are in the triangle already.
        for column in &mut block {
            let seen = column.iter_mut().take(self.seen);
            seen.for_each(|x| *x = T::zero());
        }
        let triangle = self.triangles.get_mut(place(joint)).ok_or(error)?;
        let mut factor = Factor::in_storage(last, triangle)?;
        factor.fold_block(0, block.get_mut(..=last).ok_or(error)?)
    }

    /// Judges the present block of `folds`, which is at its end. What is computed does not depend on the data, only what is made of it: a
    /// verdict takes 85 instructions more or less.
    pub fn judge(&mut self, folds: &DeviceFolds<T>) -> Verdict<T> {
        let growth: [T; JOINTS_PER_LEG] = core::array::from_fn(|joint| folds.growth(joint));
        let windows = folds.block_windows();
        let motion: [T; JOINTS_PER_LEG] =
            core::array::from_fn(|joint| self.motion(joint) / windows.max(T::one()));
        let best = self.best();
        if windows < real(LEAST_WINDOWS) || !self.known[1] {
            return Verdict::Same;
        }
        let joints = || self.spreads.iter().zip(growth.iter().zip(&motion));
        if joints().any(|(spread, (_, motion))| !spread.is_of(*motion)) {
            self.blocks = 0;
        }
        let beyond = joints().any(|(spread, (growth, _))| spread.is_beyond(*growth));
        if self.blocks >= LEARNT && beyond {
            let again = core::mem::replace(&mut self.doubtful, best.is_none());
            match (best, again) {
                (Some(change), again) => {
                    // Other friction leaves other errors: how much a block usually leaves is to be learnt anew.
                    self.blocks = 0;
                    let blocks = 1 + u64::from(again);
                    return Verdict::Changed(Change { blocks, ..change });
                }
                (None, false) => return Verdict::Doubtful,
                // It is what the leg is like from now on.
                (None, true) => self.blocks = 0,
            }
        }
        self.doubtful = false;
        let blocks = self.blocks;
        let seen = growth.iter().zip(&motion);
        for (spread, (growth, motion)) in self.spreads.iter_mut().zip(seen) {
            spread.learn(*growth, *motion, blocks);
        }
        self.blocks = blocks.saturating_add(1);
        Verdict::Same
    }

    /// The hypothesis that explains most, if that is enough.
    fn best(&self) -> Option<Change<T>> {
        let (mut best, mut most) = (None, T::zero());
        for joint in 0..JOINTS_PER_LEG {
            for kind in [ChangeKind::Bias, ChangeKind::Friction, ChangeKind::Load] {
                let (explained, size, all) = self.try_change(kind, joint);
                if explained > most {
                    most = explained;
                    let enough = explained > all * real(SHARE);
                    best = enough.then_some(Change {
                        kind,
                        joint,
                        size,
                        blocks: 1,
                    });
                }
            }
        }
        best
    }

    /// What a hypothesis explains of the squared innovations of the joints that it touches, how large the change would be, and all of
    /// them: in units of each joint's noise.
    fn try_change(&self, kind: ChangeKind, joint: usize) -> (T, T, T) {
        let first = if kind == ChangeKind::Load { 0 } else { joint };
        let mut small = Factor::<T, [T; packed_len(2)]>::new::<2>();
        let mut all = T::zero();
        for of in first..=joint {
            let spread = self.spreads.get(of);
            let weight = spread.map_or(T::zero(), |spread| spread.noise().inverse_sqrt());
            let columns = match kind {
                ChangeKind::Bias => [Some(0), None],
                ChangeKind::Friction => [Some(1), Some(2)],
                ChangeKind::Load => [2 * joint, 2 * joint + 1].map(|n| felt(of, n)),
            };
            let test = self.triangle(of);
            all += test.sum_of_squares(&[]) * weight * weight;
            for row in (0..=test.columns()).step_by(ROWS) {
                let columns = [columns[0], columns[1], Some(test.columns())];
                let mut block = columns
                    .map(|c| core::array::from_fn(|slot| entry(&test, row + slot, c) * weight));
                // Finite numbers of the right length.
                let _ = small.fold_block(0, &mut block);
            }
        }
        // Where a joint cannot feel a load, there is nothing but the floor.
        small.keep_floor(T::default_epsilon());
        let mut values = [T::zero(); 2];
        let _ = small.solve(&mut values);
        let right = |k: usize| small.row(k).last().copied().unwrap_or(T::zero());
        (right(0) * right(0) + right(1) * right(1), values[0], all)
    }

    /// A joint's squared velocity over the block, in the column of viscous friction.
    fn motion(&self, joint: usize) -> T {
        let test = self.triangle(joint);
        (0..=2).fold(T::zero(), |sum, k| {
            let entry = entry(&test, k, Some(2));
            sum + entry * entry
        })
    }

    fn triangle(&self, joint: usize) -> Factor<T, &[T]> {
        let packed = self.triangles.get(place(joint)).unwrap_or(&[]);
        Factor::in_storage(tested(joint), packed).unwrap_or(Factor::nothing())
    }
}

/// Which column of a joint's small triangle the n-th of [`LOADS`] is, if the joint feels it.
fn felt(joint: usize, n: usize) -> Option<usize> {
    let first = LOADS.len() - loads_felt(joint);
    n.checked_sub(first).map(|n| OWN.len() + n)
}

/// Where a joint's small triangle lies.
fn place(joint: usize) -> core::ops::Range<usize> {
    let start: usize = (0..joint).map(|joint| packed_len(tested(joint))).sum();
    start..start + packed_len(tested(joint))
}

/// Entry (k, c) of a triangle; zero where there is none.
fn entry<T: Real>(factor: &Factor<T, &[T]>, k: usize, c: Option<usize>) -> T {
    let entry = c
        .and_then(|c| c.checked_sub(k))
        .and_then(|n| factor.row(k).get(n));
    entry.copied().unwrap_or(T::zero())
}

fn add<T: Real>(to: &mut [T; ROWS], column: &[T; ROWS], share: T) {
    to.iter_mut()
        .zip(column)
        .for_each(|(to, x)| *to += *x * share);
}

const _: () = assert!(BASE_RANK[0] + DEVICE_COLUMNS == LONGEST);
