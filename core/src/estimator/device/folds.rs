//! A leg's windows folded into two sets of factors.

use super::{DeviceRows, FOLD_LEN, FOLDS, FRONT, LegBase, ROWS_LEN, columns, range, rank};
use crate::Real;
use crate::estimator::joints::floor;
use crate::factor::{Factor, FactorError, ROWS, packed_len};
use crate::go2::JOINTS_PER_LEG;
use crate::inertia::INERTIAL;
use crate::scalar::real;

/// Length of a block of time of one fold, µs.
const BLOCK_US: u64 = 2_000_000;

/// A leg's data in two folds, and windows that wait to be folded in together, which costs less ([`crate::factor`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceFolds<T> {
    storage: [[T; FOLD_LEN]; FOLDS],
    windows: [[T; JOINTS_PER_LEG]; FOLDS],
    /// The joints' rows of windows that wait; how many they are, and the fold that they go to.
    rows: [[T; ROWS_LEN]; ROWS],
    waiting: usize,
    next: usize,
}

impl<T: Real> DeviceFolds<T> {
    /// A constant for statics, to be [`clear`](Self::clear)ed before it is used.
    pub const fn empty() -> Self {
        Self {
            storage: [[T::ZERO; FOLD_LEN]; FOLDS],
            windows: [[T::ZERO; JOINTS_PER_LEG]; FOLDS],
            rows: [[T::ZERO; ROWS_LEN]; ROWS],
            waiting: 0,
            next: 0,
        }
    }

    /// Forgets all data.
    pub fn clear(&mut self) {
        self.windows = [[T::zero(); JOINTS_PER_LEG]; FOLDS];
        self.waiting = 0;
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
    pub fn take(&mut self, rows: &DeviceRows<T>, base: &LegBase<T>) -> Result<(), FactorError> {
        let slot = self.waiting;
        let Some(waiting) = self.rows.get_mut(slot) else {
            return Err(FactorError::Length(slot));
        };
        for joint in 0..JOINTS_PER_LEG {
            let independent = base.independent[joint].get(..rank(joint)).unwrap_or(&[]);
            let row = waiting.get_mut(entries(joint)).unwrap_or(&mut []);
            rows.write_base_row(joint, independent, row);
        }
        // x·0 is NaN exactly for the numbers that must not enter.
        let probe = waiting
            .iter()
            .fold(T::zero(), |sum, x| sum + *x * T::zero());
        if probe != T::zero() {
            return Err(FactorError::NotFinite);
        }
        let fold = (rows.span_us[0] / BLOCK_US) as usize % FOLDS;
        self.next = if slot == 0 { fold } else { self.next };
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

    /// Folds in the windows that wait, into the fold of the first one's block of time.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn fold(&mut self) -> Result<(), FactorError> {
        let waiting = core::mem::take(&mut self.waiting);
        let (Some(storage), Some(windows)) = (
            self.storage.get_mut(self.next),
            self.windows.get_mut(self.next),
        ) else {
            return Err(FactorError::Length(self.next));
        };
        for (joint, windows) in windows.iter_mut().enumerate() {
            let triangle = storage.get_mut(range!(columns, joint)).unwrap_or(&mut []);
            let mut factor = Factor::in_storage(columns(joint), triangle)?;
            let mut block = [[T::zero(); ROWS]; columns(0) + 1];
            let block = block.get_mut(..=columns(joint)).unwrap_or(&mut []);
            for (slot, rows) in self.rows.iter().take(waiting).enumerate() {
                let row = rows.get(entries(joint)).unwrap_or(&[]);
                for (to, x) in block.iter_mut().zip(row) {
                    if let Some(to) = to.get_mut(slot) {
                        *to = *x;
                    }
                }
            }
            factor.fold_block(0, block)?;
            *windows += real(waiting as f64);
        }
        Ok(())
    }
}

/// Where a joint's entries lie in what waits of a window.
fn entries(joint: usize) -> core::ops::Range<usize> {
    let start = (0..joint).map(|joint| columns(joint) + 1).sum();
    start..start + columns(joint) + 1
}

impl<T: Real> DeviceRows<T> {
    /// Joint b's row as a fold takes it: effects, base columns, other effects, torque.
    fn write_base_row(&self, joint: usize, independent: &[u8], row: &mut [T]) {
        let (effects, entries) = (&self.effects[joint], self.inertial.as_slice());
        let (front, rest) = row.split_at_mut(row.len().min(FRONT));
        let (base, rest) = rest.split_at_mut(rest.len().min(independent.len()));
        for (to, from) in front.iter_mut().zip(effects) {
            *to = *from;
        }
        // Column after column, one entry per joint.
        let first = JOINTS_PER_LEG * INERTIAL * joint + joint;
        for (to, column) in base.iter_mut().zip(independent) {
            let entry = entries.get(first + JOINTS_PER_LEG * usize::from(*column));
            *to = entry.copied().unwrap_or(T::zero());
        }
        let back = effects.get(FRONT..).unwrap_or(&[]);
        for (to, from) in rest
            .iter_mut()
            .zip(back.iter().chain([&self.torque[joint]]))
        {
            *to = *from;
        }
    }
}
