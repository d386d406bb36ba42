//! A leg's windows folded into two sets of factors.

use super::{DeviceRows, FOLD_LEN, FOLDS, ROWS_LEN, columns, entries, range};
use crate::Real;
use crate::estimator::joints::floor;
use crate::factor::{Block, Factor, FactorError, ROWS, packed_len};
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::scalar::real;

/// Length of a block of time of one fold, µs.
pub(super) const BLOCK_US: u64 = 2_000_000;

/// A leg's data in two folds, and windows that wait to be folded in together, which costs less ([`crate::factor`]).
///
/// The fold of the present block is kept as it was when the block began: a block in which the robot has changed can be
/// taken out again ([`restore`](Self::restore)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceFolds<T> {
    storage: [[T; FOLD_LEN]; FOLDS],
    windows: [[T; JOINTS_PER_LEG]; FOLDS],
    /// The rows of windows that wait, joint after joint, each number of them side by side as a block has them; zero where no window is. And
    /// how many wait.
    rows: [[T; ROWS]; ROWS_LEN],
    waiting: usize,
    /// The block of time of what waits, and the present one, once there is one.
    upcoming: u64,
    block: u64,
    begun: bool,
    /// The present block's fold before it.
    before: [T; FOLD_LEN],
    windows_before: [T; JOINTS_PER_LEG],
    /// Counts whatever changes the data before the present block.
    revision: u32,
}

impl<T: Real> DeviceFolds<T> {
    /// A constant for statics, to be [`clear`](Self::clear)ed before it is used.
    pub const fn empty() -> Self {
        Self {
            storage: [[T::ZERO; FOLD_LEN]; FOLDS],
            windows: [[T::ZERO; JOINTS_PER_LEG]; FOLDS],
            rows: [[T::ZERO; ROWS]; ROWS_LEN],
            waiting: 0,
            upcoming: 0,
            block: 0,
            begun: false,
            before: [T::ZERO; FOLD_LEN],
            windows_before: [T::ZERO; JOINTS_PER_LEG],
            revision: 0,
        }
    }

    /// Forgets all data.
    pub fn clear(&mut self) {
        self.windows = [[T::zero(); JOINTS_PER_LEG]; FOLDS];
        self.rows.as_flattened_mut().fill(T::zero());
        self.waiting = 0;
        self.begun = false;
        self.revise();
        for storage in &mut self.storage {
            for joint in 0..JOINTS_PER_LEG {
                let triangle = storage.get_mut(range!(columns, joint)).unwrap_or(&mut []);
                if let Ok(mut factor) = Factor::in_storage(columns(joint), triangle) {
                    factor.clear();
                    factor.set_floor(floor());
                }
            }
        }
    }

    /// Windows of all folds, without those that wait.
    pub fn windows(&self) -> T {
        self.windows
            .iter()
            .fold(T::zero(), |sum, fold| sum + fold[0])
    }

    /// A joint's factor in one fold: the first four effects of `COLUMNS`, the base columns, the other effects.
    pub fn joint(&self, fold: usize, joint: usize) -> Factor<T, &[T]> {
        let found = match (self.storage.get(fold), self.windows.get(fold)) {
            (Some(storage), Some(windows)) if joint < JOINTS_PER_LEG => {
                storage.get(range!(columns, joint)).and_then(|packed| {
                    Factor::from_packed(columns(joint), windows[joint], packed).ok()
                })
            }
            _ => None,
        };
        found.unwrap_or(Factor::nothing())
    }

    /// Takes in a joint's factor of one fold as another device has it, on top of what is there.
    ///
    /// # Errors
    /// [`FactorError::Length`] if there is no such joint or fold, or the factor has other columns; [`FactorError::NotFinite`].
    pub fn merge_joint(
        &mut self,
        fold: usize,
        joint: usize,
        other: &Factor<T, &[T]>,
    ) -> Result<(), FactorError> {
        let there = fold < FOLDS && joint < JOINTS_PER_LEG;
        if !there || other.columns() != columns(joint) {
            return Err(FactorError::Length(other.packed().len()));
        }
        let triangle = self.storage[fold]
            .get_mut(range!(columns, joint))
            .unwrap_or(&mut []);
        let windows = &mut self.windows[fold][joint];
        let mut factor = Factor::from_packed(columns(joint), *windows, triangle)?;
        factor.merge(other, |c| c, T::one(), &mut [T::zero(); columns(0) + 1])?;
        *windows = factor.rows();
        Ok(())
    }

    /// Takes the rows of one window, which wait to be folded in together ([`fold`](Self::fold)).
    ///
    /// # Errors
    /// [`FactorError::NotFinite`], and then nothing of the window is taken; [`FactorError::Length`] if there is no room.
    pub fn take(&mut self, rows: &DeviceRows<T>) -> Result<(), FactorError> {
        let slot = self.waiting;
        if slot >= ROWS {
            return Err(FactorError::Length(slot));
        }
        // x·0 is NaN exactly for the numbers that must not enter.
        let mut probe = T::zero();
        for (to, from) in self.rows.iter_mut().zip(&rows.numbers) {
            probe += *from * T::zero();
            to[slot] = *from;
        }
        if probe != T::zero() {
            self.rows.iter_mut().for_each(|to| to[slot] = T::zero());
            return Err(FactorError::NotFinite);
        }
        // Divided for every window: the same instructions for each.
        let block = rows.span_us[0] / BLOCK_US;
        self.upcoming = if slot == 0 { block } else { self.upcoming };
        self.waiting = slot + 1;
        Ok(())
    }

    /// Windows that wait to be folded in.
    pub fn waiting(&self) -> usize {
        self.waiting
    }

    /// Whether no further window finds room.
    pub fn is_full(&self) -> bool {
        self.waiting >= ROWS
    }

    /// Whether what waits is of another block of time than the present one.
    pub fn is_new_block(&self) -> bool {
        self.waiting > 0 && !(self.begun && self.upcoming == self.block)
    }

    /// Begins the block of what waits: the data before it are weighed down to `retention` (1: they are not), and kept as they are.
    ///
    /// What the prior knows is not here and so not forgotten; nor is the floor under what nothing is known of.
    pub fn begin_block(&mut self, retention: T) {
        (self.block, self.begun) = (self.upcoming, true);
        self.revise();
        if retention < T::one() {
            self.forget(retention);
        }
        let fold = self.fold_of_block();
        if let (Some(storage), Some(windows)) = (self.storage.get(fold), self.windows.get(fold)) {
            copy(storage, &mut self.before);
            self.windows_before = *windows;
        }
    }

    /// Weighs all data so far down to `retention` (0 to 1).
    pub fn forget(&mut self, retention: T) {
        self.each_factor(|_, factor| {
            factor.forget(retention);
            factor.keep_floor(floor());
            Ok(())
        });
    }

    /// Leaves out the windows that wait; how many they were.
    pub fn drop_waiting(&mut self) -> usize {
        self.rows.as_flattened_mut().fill(T::zero());
        core::mem::take(&mut self.waiting)
    }

    /// Takes the present block's windows out again; how many they were.
    pub fn restore(&mut self) -> T {
        if !self.begun {
            return T::zero();
        }
        let fold = self.fold_of_block();
        let windows = self.block_windows();
        if let (Some(storage), Some(now)) = (self.storage.get_mut(fold), self.windows.get_mut(fold))
        {
            copy(&self.before, storage);
            *now = self.windows_before;
        }
        windows
    }

    /// Forgets what all data say of a joint's parameters along `direction`, and nothing else.
    pub(crate) fn forget_direction(&mut self, joint: usize, direction: &[T]) {
        self.revise();
        self.each_factor(|of, factor| {
            if of != joint {
                return Ok(());
            }
            let mut scratch = [T::zero(); 2 * columns(0) + 1];
            factor.forget_direction(direction, floor(), &mut scratch)
        });
    }

    fn revise(&mut self) {
        self.revision = self.revision.wrapping_add(1);
    }

    /// Another number after anything that changes the [`settled`](Self::settled) numbers.
    pub(crate) fn revision(&self) -> u32 {
        self.revision
    }

    /// The n-th of the [`SETTLED`](Self::SETTLED) numbers that say all that was folded in before the present block, which has not been
    /// judged yet: both folds' triangles, then each joint's windows. They stay what they are as long as the block lasts.
    pub(crate) fn settled(&self, n: usize) -> Option<T> {
        let fold = n / FOLD_LEN;
        if fold < FOLDS {
            let present = self.begun && fold == self.fold_of_block();
            let storage = match present {
                true => &self.before,
                false => self.storage.get(fold)?,
            };
            return storage.get(n % FOLD_LEN).copied();
        }
        let (fold, joint) = windows_place(n);
        let present = self.begun && fold == self.fold_of_block();
        let windows = match present {
            true => &self.windows_before,
            false => self.windows.get(fold)?,
        };
        windows.get(joint).copied()
    }

    /// Takes the n-th of the [`SETTLED`](Self::SETTLED) numbers of another device's, into folds that were [`clear`](Self::clear)ed.
    pub(crate) fn settle(&mut self, n: usize, number: T) {
        let (fold, joint) = windows_place(n);
        let place = match self.storage.get_mut(n / FOLD_LEN) {
            Some(storage) => storage.get_mut(n % FOLD_LEN),
            None => self.windows.get_mut(fold).and_then(|of| of.get_mut(joint)),
        };
        if let Some(place) = place {
            *place = number;
        }
    }

    /// How many numbers [`settled`](Self::settled) has.
    pub(crate) const SETTLED: usize = FOLDS * (FOLD_LEN + JOINTS_PER_LEG);

    /// Windows of the present block.
    pub fn block_windows(&self) -> T {
        let now = self.windows.get(self.fold_of_block());
        now.map_or(T::zero(), |now| now[0] - self.windows_before[0])
    }

    /// The first instant of the present block, and of the one after it, µs.
    pub fn block_span(&self) -> [u64; 2] {
        [self.block, self.block + 1].map(|block| block.saturating_mul(BLOCK_US))
    }

    /// By how much a joint's least sum of squared residuals has grown in the present block, for each of its windows: N² m² of
    /// mean torques over windows.
    ///
    /// It is the block's error as foretold by the data before it, in units that make up for how well they foretell it: a motion
    /// that shows something new makes parameters known, and no residual.
    pub(super) fn growth(&self, joint: usize) -> T {
        let before = self.before.get(range!(columns, joint)).unwrap_or(&[]);
        let before = Factor::in_storage(columns(joint), before).map_or(T::zero(), |f| f.residual());
        let now = self.joint(self.fold_of_block(), joint).residual();
        (now - before).max(T::zero()) / self.block_windows().max(T::one())
    }

    fn fold_of_block(&self) -> usize {
        (self.block % FOLDS as u64) as usize
    }

    /// Folds in the windows that wait, into the fold of the first one's block of time.
    ///
    /// # Errors
    /// [`FactorError::Length`] of a storage of the wrong length, which there is not.
    pub fn fold(&mut self) -> Result<(), FactorError> {
        if self.is_new_block() {
            self.begin_block(T::one());
        }
        let (waiting, fold) = (core::mem::take(&mut self.waiting), self.fold_of_block());
        let (Some(storage), Some(windows)) =
            (self.storage.get_mut(fold), self.windows.get_mut(fold))
        else {
            return Err(FactorError::Length(fold));
        };
        for (joint, windows) in windows.iter_mut().enumerate() {
            let triangle = storage.get_mut(range!(columns, joint)).unwrap_or(&mut []);
            let mut factor = Factor::in_storage(columns(joint), triangle)?;
            let block = self.rows.get_mut(entries(joint)).unwrap_or(&mut []);
            factor.reflect_in(0, block)?;
            *windows += real(waiting as f64);
        }
        self.rows.as_flattened_mut().fill(T::zero());
        Ok(())
    }

    /// A joint's rows of the windows that wait: columns in the order of [`joint`](Self::joint), torque; zero where there is no window.
    pub(super) fn waiting_rows(&self, joint: usize) -> &Block<T> {
        self.rows.get(entries(joint)).unwrap_or(&[])
    }

    /// Does something with every joint's factor in every fold. The only error is a storage of the wrong length, which there is not.
    fn each_factor(
        &mut self,
        mut work: impl FnMut(usize, &mut Factor<T, &mut [T]>) -> Result<(), FactorError>,
    ) {
        for (storage, windows) in self.storage.iter_mut().zip(&mut self.windows) {
            for (joint, windows) in windows.iter_mut().enumerate() {
                let triangle = storage.get_mut(range!(columns, joint)).unwrap_or(&mut []);
                if let Ok(mut factor) = Factor::from_packed(columns(joint), *windows, triangle) {
                    let _ = work(joint, &mut factor);
                    *windows = factor.rows();
                }
            }
        }
    }
}

/// Which fold's and joint's windows the n-th of the settled numbers is, of those behind the triangles.
fn windows_place(n: usize) -> (usize, usize) {
    let n = n.saturating_sub(FOLDS * FOLD_LEN);
    (n / JOINTS_PER_LEG, n % JOINTS_PER_LEG)
}

/// Copies as many numbers as both have.
fn copy<T: Real>(from: &[T], to: &mut [T]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
}
