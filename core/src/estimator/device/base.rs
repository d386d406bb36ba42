//! The base parameters of a leg's joints, found once.

use super::{
    BASE_LEN, BASE_RANK, DevicePrior, LOADS, LOADS_LEN, MARGINAL_LEN, loads_before, loads_felt,
    range, rank, standard,
};
use crate::Real;
use crate::base_parameters::BaseParameters;
use crate::estimator::joints::floor;
use crate::estimator::{CAD_UNCERTAINTY, EFFECTS, JointFactors, LEG, LEG_INERTIAL, LegFactors};
use crate::factor::{Factor, FactorError, packed_len};
use crate::inertia::INERTIAL;
use crate::regressor::leg::JOINTS_PER_LEG;
use crate::robot::Robot;
use crate::scalar::real;

/// The base parameters of a leg's joints, and the CAD prior on them.
#[derive(Clone, Copy, Debug)]
pub struct LegBase<T> {
    reduced: [T; BASE_LEN],
    marginal: [T; MARGINAL_LEN],
    /// What is left of the prior's information on each joint's bodies, 0 to 1.
    trust: [T; JOINTS_PER_LEG],
    loads: [T; LOADS_LEN],
    /// Each joint's independent columns: what a snapshot's numbers are of.
    pub(crate) independent: [[u8; BASE_RANK[0]]; JOINTS_PER_LEG],
    known: bool,
}

impl<T: Real> LegBase<T> {
    /// Not analysed yet.
    pub const fn empty() -> Self {
        Self {
            reduced: [T::ZERO; BASE_LEN],
            marginal: [T::ZERO; MARGINAL_LEN],
            trust: [T::ZERO; JOINTS_PER_LEG],
            loads: [T::ZERO; LOADS_LEN],
            independent: [[0; BASE_RANK[0]]; JOINTS_PER_LEG],
            known: false,
        }
    }

    /// Analyses the leg, once. `work` is any 1100 numbers.
    ///
    /// # Errors
    /// [`FactorError::Length`] if the work space is too small.
    pub fn analyse<R: Robot<JOINTS_PER_LEG>>(
        &mut self,
        which: R,
        prior: &DevicePrior<T>,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        self.trust = [T::one(); JOINTS_PER_LEG];
        if self.known {
            return Ok(());
        }
        for joint in 0..JOINTS_PER_LEG {
            self.analyse_joint(which, joint, work)?;
            self.write_marginal(joint, prior, work)?;
        }
        self.known = true;
        for joint in 0..JOINTS_PER_LEG {
            self.write_loads(joint);
        }
        Ok(())
    }

    #[inline(never)]
    fn analyse_joint<R: Robot<JOINTS_PER_LEG>>(
        &mut self,
        which: R,
        joint: usize,
        work: &mut [T],
    ) -> Result<(), FactorError> {
        let error = FactorError::Length(work.len());
        let row = work.get_mut(..=standard(joint)).ok_or(error)?;
        let storage = self.reduced.get_mut(range!(standard, joint)).ok_or(error)?;
        let tree = which.tree();
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

    fn write_loads(&mut self, joint: usize) {
        let felt = LOADS.iter().skip(LOADS.len() - loads_felt(joint));
        for (n, (body, parameter)) in felt.enumerate() {
            let mut direction = [T::zero(); BASE_RANK[0]];
            self.write_direction(joint, *body, *parameter, &mut direction);
            let start = loads_before(joint) + n * rank(joint);
            let to = self.loads.get_mut(start..).unwrap_or(&mut []);
            to.iter_mut()
                .zip(direction.iter().take(rank(joint)))
                .for_each(|(to, from)| *to = *from);
        }
    }

    /// By how much a joint's base parameters grow with a standard parameter of a body, per unit of it: a column of P.
    pub(crate) fn write_direction(
        &self,
        joint: usize,
        body: usize,
        parameter: usize,
        direction: &mut [T],
    ) {
        let (Some(base), Some(before)) = (self.joint(joint), body.checked_sub(joint)) else {
            return direction.fill(T::zero());
        };
        let column = INERTIAL * before + parameter;
        for (r, to) in direction.iter_mut().enumerate() {
            let share = column
                .checked_sub(r)
                .and_then(|n| base.combination(r).get(n));
            *to = share.copied().unwrap_or(T::zero());
        }
    }

    /// The directions that a joint's loads give its base parameters, one after the other.
    pub(super) fn loads(&self, joint: usize) -> &[T] {
        let start = loads_before(joint);
        self.loads
            .get(start..loads_before(joint + 1))
            .unwrap_or(&[])
    }

    /// Takes the bodies to be known so well, relative to the CAD's. For a joint the prior is worth less by each body that it moves and that is
    /// known less than when the leg was analysed; one that is known better makes it worth no more, for it is one of several.
    pub(crate) fn set_uncertainty(&mut self, uncertainty: &[T; JOINTS_PER_LEG]) {
        let mut left = T::one();
        for (trust, uncertainty) in self.trust.iter_mut().zip(uncertainty).rev() {
            let share = (real::<T>(CAD_UNCERTAINTY) / *uncertainty).min(T::one());
            left *= share * share;
            *trust = left;
        }
    }

    /// What is left of the prior's information on a joint's bodies, 0 to 1.
    pub(crate) fn trust(&self, joint: usize) -> T {
        self.trust.get(joint).copied().unwrap_or(T::zero())
    }

    /// The base parameters of a joint; of no columns before the analysis.
    pub fn joint(&self, joint: usize) -> Option<BaseParameters<T, &[T]>> {
        let known = self.known && joint < JOINTS_PER_LEG;
        let packed = known.then(|| self.reduced.get(range!(standard, joint)))??;
        BaseParameters::from_packed(standard(joint), rank(joint), packed).ok()
    }

    /// Writes row k of R P, which is over all standard columns, into `data`: R is a joint's factor of effects and base columns; returns
    /// the cost.
    pub(super) fn expand_row<D>(
        &self,
        joint: usize,
        factor: &Factor<T, &[T]>,
        k: usize,
        data: &mut JointFactors<T, D, JOINTS_PER_LEG>,
    ) -> Result<usize, FactorError>
    where
        D: AsRef<[T]> + AsMut<[T]>,
    {
        let base = self.joint(joint).ok_or(FactorError::Length(0))?;
        let effects = factor.columns().saturating_sub(rank(joint));
        let Some((z, entries)) = factor.row(k).split_last() else {
            return Err(FactorError::Length(k));
        };
        let (own, entries) = entries.split_at(effects.saturating_sub(k).min(entries.len()));
        let first = k.saturating_sub(effects);
        let mut row = [T::zero(); LEG_INERTIAL];
        let inertial = row.get_mut(..standard(joint)).unwrap_or(&mut []);
        base.expand(first, entries, inertial);
        let place = if k < effects {
            k
        } else {
            effects + base.independent(first).unwrap_or(standard(joint))
        };
        let inertial = inertial.get(place.saturating_sub(effects)..).unwrap_or(&[]);
        let row = own.iter().chain(inertial).chain([z]);
        data.with_joint(joint, |factor| factor.write_row(place, row.copied()))?;
        Ok(entries.len() * standard(joint) / 2 + 2 * standard(joint))
    }

    /// The factors of [`EFFECTS`] and all standard parameters from each joint's of the same effects and its base columns, which say as much.
    /// Where the data leave a combination to rounding, the floor that all factors have keeps it from taking errors away.
    ///
    /// # Errors
    /// [`FactorError::Length`] before the analysis, or if a factor has other columns.
    pub fn standard_factors(
        &self,
        joints: [Factor<T, &mut [T]>; JOINTS_PER_LEG],
    ) -> Result<LegFactors<T>, FactorError> {
        let mut factors = LegFactors::default();
        factors.reset_to(LEG, joints[0].rows());
        for (joint, mut factor) in joints.into_iter().enumerate() {
            let columns = factor.columns();
            if columns != EFFECTS.len() + rank(joint) {
                return Err(FactorError::Length(columns));
            }
            let mut scratch = [T::zero(); EFFECTS.len() + BASE_RANK[0] + 1];
            let scratch = scratch.get_mut(..=columns).unwrap_or(&mut []);
            for column in 0..columns {
                factor.add_prior(column, T::zero(), T::one() / floor(), scratch)?;
            }
            for k in 0..=columns {
                self.expand_row(joint, &factor.view(), k, &mut factors)?;
            }
        }
        Ok(factors)
    }

    /// The CAD prior on a joint's base parameters, as a factor.
    pub(crate) fn marginal(&self, joint: usize) -> Option<Factor<T, &[T]>> {
        let known = self.known && joint < JOINTS_PER_LEG;
        let packed = known.then(|| self.marginal.get(range!(rank, joint)))??;
        Factor::in_storage(rank(joint), packed).ok()
    }
}
