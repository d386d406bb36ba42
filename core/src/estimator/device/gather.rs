//! From two folds to the factors of a model's columns.

use super::{
    Active, DEFAULT_ACTIVE, DEVICE_COLUMNS, DeviceFolds, DeviceSolver, FOLDS, FRONT, LegBase,
    columns, rank,
};
use crate::Real;
use crate::factor::{Factor, FactorError, ROWS, block_cost, packed_len};
use crate::regressor::leg::JOINTS_PER_LEG;

/// Turns a leg's folds into its solver's data, in steps of bounded cost.
#[derive(Clone, Copy, Debug)]
pub struct Gather<T> {
    work: [T; packed_len(columns(0))],
    active: Active,
    joint: usize,
    fold: usize,
    row: usize,
}

impl<T: Real> Gather<T> {
    /// Nothing gathered yet: all zeros.
    pub const fn new() -> Self {
        Self {
            work: [T::ZERO; packed_len(columns(0))],
            active: Active::NONE,
            joint: 0,
            fold: 0,
            row: 0,
        }
    }

    /// Begins with the data of `folds`, for a model with the effects of `active`.
    pub fn start(&mut self, active: &Active, folds: &DeviceFolds<T>, solver: &mut DeviceSolver<T>) {
        self.active = *active;
        (self.joint, self.fold, self.row) = (0, 0, 0);
        self.work.fill(T::zero());
        solver.data_mut().reset_to(active.layout(), folds.windows());
    }

    /// The effects of the model that is gathered.
    pub fn active(&self) -> &Active {
        &self.active
    }

    /// Whether the solver has all data.
    pub fn is_done(&self) -> bool {
        self.joint == JOINTS_PER_LEG
    }

    /// Goes on until `budget` numbers are rotated; true when the solver has all data.
    ///
    /// # Errors
    /// [`FactorError`] if the data are not finite.
    pub fn advance(
        &mut self,
        budget: usize,
        folds: &DeviceFolds<T>,
        base: &LegBase<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<bool, FactorError> {
        let mut cost = 0;
        while cost < budget && self.joint < JOINTS_PER_LEG {
            let joint = self.joint;
            let kept = self.active.0[joint].count_ones() as usize + rank(joint);
            if self.fold < FOLDS {
                cost += self.fold_rows(joint, kept, &folds.joint(self.fold, joint))?;
                if self.row > columns(joint) {
                    self.row = 0;
                    self.fold += 1;
                }
                continue;
            }
            cost += self.expand_row(joint, kept, base, solver)?;
            self.row += 1;
            if self.row > kept {
                (self.fold, self.row) = (0, 0);
                self.joint += 1;
                self.work.fill(T::zero());
            }
        }
        Ok(self.is_done())
    }

    /// Folds the kept columns of the next rows, a block at most; returns the cost.
    fn fold_rows(
        &mut self,
        joint: usize,
        kept: usize,
        from: &Factor<T, &[T]>,
    ) -> Result<usize, FactorError> {
        let storage = self.work.get_mut(..packed_len(kept)).unwrap_or(&mut []);
        let mut work = Factor::in_storage(kept, storage)?;
        if self.fold == 0 && self.row == 0 && self.active.0[joint] == DEFAULT_ACTIVE.0[joint] {
            // The front of the first fold's triangle is this model's already.
            for k in 0..kept {
                let row = from.row(k);
                let front = row.iter().take(kept - k).chain(row.last());
                work.write_row(k, front.copied())?;
            }
            self.row = kept;
            return Ok(kept * kept / 2);
        }
        let mut block = [[T::zero(); ROWS]; columns(0) + 1];
        let (mut start, end) = (kept, (self.row + ROWS).min(columns(joint) + 1));
        for (slot, k) in (self.row..end).enumerate() {
            for (n, x) in from.row(k).iter().enumerate() {
                let Some(place) = place(&self.active, joint, kept, k + n) else {
                    continue;
                };
                if let Some(to) = block.get_mut(place).and_then(|to| to.get_mut(slot)) {
                    *to = *x;
                    start = start.min(place);
                }
            }
        }
        self.row = end;
        let block = block.get_mut(start..=kept).unwrap_or(&mut []);
        let len = block.len();
        work.fold_block(start, block)?;
        Ok(block_cost(len) + 8 * columns(joint))
    }

    /// Writes the next row of R P, which is over all standard columns, into the solver's data; returns the cost.
    fn expand_row(
        &self,
        joint: usize,
        kept: usize,
        base: &LegBase<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<usize, FactorError> {
        let storage = self.work.get(..packed_len(kept)).unwrap_or(&[]);
        let gathered = Factor::in_storage(kept, storage)?;
        base.expand_row(joint, &gathered, self.row, solver.data_mut())
    }
}

/// Where column c of a joint's fold stands in the triangle of a model with `kept` columns, if the model has it.
fn place(active: &Active, joint: usize, kept: usize, c: usize) -> Option<usize> {
    let effect = |n: usize| {
        let before = active.0[joint] & ((1 << n) - 1);
        active.has(joint, n).then_some(before.count_ones() as usize)
    };
    let rank = rank(joint);
    match c {
        c if c < FRONT => effect(c),
        c if c < FRONT + rank => Some(kept - rank + c - FRONT),
        c if c < DEVICE_COLUMNS + rank => effect(c - rank),
        _ => Some(kept),
    }
}

impl<T: Real> Default for Gather<T> {
    fn default() -> Self {
        Self::new()
    }
}
