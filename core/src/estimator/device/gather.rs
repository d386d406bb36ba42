//! From two folds to the factors of a model's columns.

use super::{
    Active, DEFAULT_ACTIVE, DEVICE_COLUMNS, DeviceFolds, DeviceSolver, FOLDS, FRONT, LegBase,
    columns, rank, standard,
};
use crate::Real;
use crate::estimator::LEG_INERTIAL;
use crate::factor::{Factor, FactorError, packed_len};
use crate::go2::JOINTS_PER_LEG;

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
    /// Nothing to gather.
    pub const fn new() -> Self {
        Self {
            work: [T::ZERO; packed_len(columns(0))],
            active: DEFAULT_ACTIVE,
            joint: JOINTS_PER_LEG,
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
                cost += self.fold_row(joint, kept, &folds.joint(self.fold, joint))?;
                self.row += 1;
                if self.row > columns(joint) {
                    self.row = 0;
                    self.fold += 1;
                }
                continue;
            }
            // A product of rows costs a quarter of a rotation per number.
            let expansion = kept * rank(joint) * standard(joint) / 8;
            if cost > 0 && cost + expansion > budget {
                break;
            }
            self.expand(joint, kept, base, solver)?;
            cost += expansion;
            self.fold = 0;
            self.joint += 1;
            self.work.fill(T::zero());
        }
        Ok(self.joint == JOINTS_PER_LEG)
    }

    /// Folds the kept columns of one row; returns the cost.
    fn fold_row(
        &mut self,
        joint: usize,
        kept: usize,
        from: &Factor<T, &[T]>,
    ) -> Result<usize, FactorError> {
        let (k, rank) = (self.row, rank(joint));
        let mut row = [T::zero(); columns(0) + 1];
        let mut start = kept;
        for (n, x) in from.row(k).iter().enumerate() {
            let place = match k + n {
                c if c < FRONT => self.place(joint, c),
                c if c < FRONT + rank => Some(kept - rank + c - FRONT),
                c if c < DEVICE_COLUMNS + rank => self.place(joint, c - rank),
                _ => Some(kept),
            };
            if let Some(to) = place.and_then(|place| row.get_mut(place)) {
                *to = *x;
                start = start.min(place.unwrap_or(kept));
            }
        }
        let storage = self.work.get_mut(..packed_len(kept)).unwrap_or(&mut []);
        let mut work = Factor::in_storage(kept, storage)?;
        let row = row.get_mut(start..=kept).unwrap_or(&mut []);
        let len = row.len();
        if self.fold == 0 && k < kept && self.active.0[joint] == DEFAULT_ACTIVE.0[joint] {
            // The front of the first fold's triangle is this model's already.
            work.write_row(k, row.iter().copied())?;
            return Ok(len);
        }
        work.fold_from(start, row)?;
        Ok(len * (len + 1) / 2)
    }

    /// Where effect n stands among a joint's active ones.
    fn place(&self, joint: usize, n: usize) -> Option<usize> {
        let before = self.active.0[joint] & ((1 << n) - 1);
        self.active
            .has(joint, n)
            .then_some(before.count_ones() as usize)
    }

    /// Writes R P, the rows over all standard columns, into the solver's data.
    fn expand(
        &self,
        joint: usize,
        kept: usize,
        base: &LegBase<T>,
        solver: &mut DeviceSolver<T>,
    ) -> Result<(), FactorError> {
        let base = base.joint(joint).ok_or(FactorError::Length(0))?;
        let effects = kept - rank(joint);
        let storage = self.work.get(..packed_len(kept)).unwrap_or(&[]);
        let gathered = Factor::in_storage(kept, storage)?;
        let all = effects + standard(joint);
        solver.data_mut().with_joint(joint, |factor| {
            for k in 0..=kept {
                let Some((z, r)) = gathered.row(k).split_last() else {
                    continue;
                };
                let (first, r) = match k.checked_sub(effects) {
                    None => (0, r.get(effects - k..).unwrap_or(&[])),
                    Some(first) => (first, r),
                };
                let mut row = [T::zero(); LEG_INERTIAL];
                let inertial = row.get_mut(..standard(joint)).unwrap_or(&mut []);
                base.expand(first, r, inertial);
                let place = match k.checked_sub(effects) {
                    None => k,
                    Some(first) if first < base.rank() => {
                        effects + base.independent(first).unwrap_or(0)
                    }
                    Some(_) => all,
                };
                let own = gathered
                    .row(k)
                    .get(..effects.saturating_sub(k))
                    .unwrap_or(&[]);
                let skipped = place.saturating_sub(effects);
                let inertial = inertial.get(skipped..).unwrap_or(&[]);
                let entries = own.iter().chain(inertial).chain([z]);
                factor.write_row(place, entries.copied())?;
            }
            Ok(())
        })
    }
}

impl<T: Real> Default for Gather<T> {
    fn default() -> Self {
        Self::new()
    }
}
