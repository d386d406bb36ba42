//! The base parameters of a leg's joints, found once.

use super::{BASE_LEN, BASE_RANK, DevicePrior, MARGINAL_LEN, range, rank, standard};
use crate::Real;
use crate::base_parameters::BaseParameters;
use crate::estimator::LEG_INERTIAL;
use crate::factor::{Factor, FactorError, packed_len};
use crate::go2::{JOINTS_PER_LEG, Leg, leg};
use crate::inertia::INERTIAL;

/// The base parameters of a leg's joints, and the CAD prior on them.
#[derive(Clone, Copy, Debug)]
pub struct LegBase<T> {
    reduced: [T; BASE_LEN],
    marginal: [T; MARGINAL_LEN],
    /// Each joint's independent columns; found once, for they are read for every window.
    pub(super) independent: [[u8; BASE_RANK[0]]; JOINTS_PER_LEG],
    known: bool,
}

impl<T: Real> LegBase<T> {
    /// Not analysed yet.
    pub const fn empty() -> Self {
        Self {
            reduced: [T::ZERO; BASE_LEN],
            marginal: [T::ZERO; MARGINAL_LEN],
            independent: [[0; BASE_RANK[0]]; JOINTS_PER_LEG],
            known: false,
        }
    }

    /// Analyses the leg, once. `work` is any 1100 numbers.
    ///
    /// # Errors
    /// [`FactorError::Length`] if the work space is too small.
    pub fn analyse(
        &mut self,
        which: Leg,
        prior: &DevicePrior<T>,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        if self.known {
            return Ok(());
        }
        for joint in 0..JOINTS_PER_LEG {
            self.analyse_joint(which, joint, work)?;
            self.write_marginal(joint, prior, work)?;
        }
        self.known = true;
        Ok(())
    }

    #[inline(never)]
    fn analyse_joint(
        &mut self,
        which: Leg,
        joint: usize,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        let error = FactorError::Length(work.len());
        let row = work.get_mut(..=standard(joint)).ok_or(error)?;
        let storage = self.reduced.get_mut(range!(standard, joint)).ok_or(error)?;
        let tree = leg(which);
        let base = BaseParameters::of_joint::<JOINTS_PER_LEG, JOINTS_PER_LEG, LEG_INERTIAL>(
            &tree, joint, storage, row,
        )?;
        let columns = base.independent_columns();
        for (to, from) in self.independent[joint].iter_mut().zip(columns) {
            *to = from as u8;
        }
        Ok(())
    }

    #[inline(never)]
    fn write_marginal(
        &mut self,
        joint: usize,
        prior: &DevicePrior<T>,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        let columns = standard(joint);
        let error = FactorError::Length(work.len());
        let (row, rest) = work.split_at_mut_checked(columns + 1).ok_or(error)?;
        let (bodies, rest) = rest
            .split_at_mut_checked(packed_len(columns))
            .ok_or(error)?;
        let rest = rest.get_mut(..packed_len(columns)).ok_or(error)?;
        let mut bodies = Factor::in_storage(columns, bodies)?;
        bodies.clear();
        for b in joint..JOINTS_PER_LEG {
            if let Some(body) = prior.body(b) {
                bodies.place(INERTIAL * (b - joint), body)?;
            }
        }
        let packed = self.reduced.get(range!(standard, joint)).ok_or(error)?;
        let base = BaseParameters::from_packed(columns, rank(joint), packed)?;
        let marginal = self.marginal.get_mut(range!(rank, joint)).ok_or(error)?;
        let mut marginal = Factor::in_storage(rank(joint), marginal)?;
        base.marginal(&bodies, &mut marginal, rest, row)
    }

    /// The base parameters of a joint; of no columns before the analysis.
    pub fn joint(&self, joint: usize) -> Option<BaseParameters<T, &[T]>> {
        let known = self.known && joint < JOINTS_PER_LEG;
        let packed = known.then(|| self.reduced.get(range!(standard, joint)))??;
        BaseParameters::from_packed(standard(joint), rank(joint), packed).ok()
    }

    /// The CAD prior on a joint's base parameters, as a factor.
    pub(crate) fn marginal(&self, joint: usize) -> Option<Factor<T, &[T]>> {
        let known = self.known && joint < JOINTS_PER_LEG;
        let packed = known.then(|| self.marginal.get(range!(rank, joint)))??;
        Factor::in_storage(rank(joint), packed).ok()
    }
}
