//! A leg's windows folded into two sets of factors.

use super::{DeviceRows, FOLD_LEN, FOLDS, FRONT, LegBase, columns, range, rank};
use crate::Real;
use crate::estimator::LEG_INERTIAL;
use crate::estimator::joints::floor;
use crate::factor::{Factor, FactorError, packed_len};
use crate::go2::JOINTS_PER_LEG;
use crate::inertia::INERTIAL;

/// Length of a block of time of one fold, µs.
const BLOCK_US: u64 = 2_000_000;

/// A leg's data in two folds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeviceFolds<T> {
    storage: [[T; FOLD_LEN]; FOLDS],
    windows: [[T; JOINTS_PER_LEG]; FOLDS],
}

impl<T: Real> DeviceFolds<T> {
    /// A constant for statics, to be [`clear`](Self::clear)ed before it is used.
    pub const fn empty() -> Self {
        Self {
            storage: [[T::ZERO; FOLD_LEN]; FOLDS],
            windows: [[T::ZERO; JOINTS_PER_LEG]; FOLDS],
        }
    }

    /// Forgets all data.
    pub fn clear(&mut self) {
        self.windows = [[T::zero(); JOINTS_PER_LEG]; FOLDS];
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

    /// Windows of all folds.
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

    /// Folds in the rows of one window, into the fold of its block of time.
    ///
    /// # Errors
    /// [`FactorError::NotFinite`], and then nothing of the joint that holds such a number is folded in.
    pub fn fold_window(
        &mut self,
        rows: &DeviceRows<T>,
        base: &LegBase<T>,
    ) -> Result<(), FactorError> {
        let fold = (rows.span_us[0] / BLOCK_US) as usize % FOLDS;
        let mut buffer = [T::zero(); columns(0) + 1];
        for joint in 0..JOINTS_PER_LEG {
            let independent = base.independent[joint].get(..rank(joint)).unwrap_or(&[]);
            let row = buffer.get_mut(..=columns(joint)).unwrap_or(&mut []);
            rows.write_base_row(joint, independent, row);
            let triangle = self.storage[fold]
                .get_mut(range!(columns, joint))
                .unwrap_or(&mut []);
            let windows = &mut self.windows[fold][joint];
            let mut factor = Factor::from_packed(columns(joint), *windows, triangle)?;
            factor.update(row)?;
            *windows = factor.rows();
        }
        Ok(())
    }
}

impl<T: Real> DeviceRows<T> {
    /// Joint b's row as a fold takes it: effects, base columns, other effects, torque.
    fn write_base_row(&self, joint: usize, independent: &[u8], row: &mut [T]) {
        let first = INERTIAL * joint;
        let inertial = independent
            .iter()
            .map(|&c| self.inertial[(joint, (first + usize::from(c)) % LEG_INERTIAL)]);
        let (front, back) = self.effects[joint].split_at(FRONT);
        let entries = front
            .iter()
            .copied()
            .chain(inertial)
            .chain(back.iter().copied());
        for (to, from) in row.iter_mut().zip(entries.chain([self.torque[joint]])) {
            *to = from;
        }
    }
}
