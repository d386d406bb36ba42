//! The solution of a limb in steps of bounded cost, so that a tick stays within its budget.
//!
//! The joints' triangles are stacked, each divided by its joint's noise, onto the prior's; the triangle that results is
//! solved, and its inverse gives the standard deviations.

use super::{EffectPrior, JointFactors, Layout, LimbPrior};
use crate::Real;
use crate::factor::{Factor, FactorError, packed_len};
use crate::inertia::INERTIAL;

/// Cost that one step may reach: numbers touched, about a dozen instructions each.
const STEP_COST: usize = 3000;

/// How many numbers a solver of `parameters` parameters keeps beside its copy of the data.
pub const fn solver_len(parameters: usize) -> usize {
    packed_len(parameters) + 5 * parameters + 1
}

/// The solver's storage, taken apart.
struct Parts<'a, T> {
    factor: Factor<T, &'a mut [T]>,
    values: &'a mut [T],
    std: &'a mut [T],
    next: &'a mut [T],
    variance: &'a mut [T],
    scratch: &'a mut [T],
}

impl<'a, T: Real> Parts<'a, T> {
    fn of(storage: &'a mut [T], p: usize) -> Result<Self, FactorError> {
        let error = FactorError::Length(storage.len());
        let (triangle, rest) = storage.split_at_mut_checked(packed_len(p)).ok_or(error)?;
        let (values, rest) = rest.split_at_mut_checked(p).ok_or(error)?;
        let (std, rest) = rest.split_at_mut_checked(p).ok_or(error)?;
        let (next, rest) = rest.split_at_mut_checked(p).ok_or(error)?;
        let (variance, scratch) = rest.split_at_mut_checked(p).ok_or(error)?;
        Ok(Self {
            factor: Factor::in_storage(p, triangle)?,
            values,
            std,
            next,
            variance,
            scratch,
        })
    }
}

/// The weighted least-squares solution of a limb; see the module.
///
/// `D` stores the joints' factors, `S` the [`solver_len`] numbers of the solver.
#[derive(Clone, Copy, Debug)]
pub struct Solver<T, D, S, const B: usize> {
    data: JointFactors<T, D, B>,
    storage: S,
    stage: Stage,
    noise: [T; B],
    windows: T,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Merge { joint: usize, row: usize },
    Solve,
    Variance { column: usize },
    Done,
}

impl<T, D, S, const B: usize> Solver<T, D, S, B>
where
    T: Real,
    D: AsRef<[T]> + AsMut<[T]> + Clone,
    S: AsRef<[T]> + AsMut<[T]>,
{
    /// A solver that has solved nothing yet, for data like `data`, in `storage` of [`solver_len`] zeros; with another
    /// length, every use is an error of length.
    pub fn new(data: JointFactors<T, D, B>, storage: S) -> Self {
        let (noise, windows) = ([T::zero(); B], T::zero());
        Self {
            data,
            storage,
            stage: Stage::Done,
            noise,
            windows,
        }
    }

    /// Begins the solution for `data` (copied: it may go on changing) on top of `prior`.
    pub fn start<E>(&mut self, prior: &LimbPrior<T, E, B>, data: &JointFactors<T, D, B>)
    where
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        self.data.clone_from(data);
        self.stage = Stage::Merge { joint: 0, row: 0 };
        let layout = *self.layout();
        let Ok(mut parts) = Parts::of(self.storage.as_mut(), layout.parameters()) else {
            return;
        };
        parts.factor.clear();
        parts.variance.fill(T::zero());
        // The columns follow from the layout, so that no placement can fail.
        for b in 0..layout.bodies() {
            if let Some(body) = prior.body(b) {
                let _ = parts.factor.place(layout.solver_column(INERTIAL * b), body);
            }
        }
        for n in 0..prior.effects().len() {
            let column = layout.solver_column(layout.inertial() + n);
            let _ = parts.factor.place(column, &prior.effect(n));
        }
    }

    /// Does the next step; true when the solution is new, and from then on.
    ///
    /// The number of steps and each step's instructions are the same whatever the data.
    ///
    /// # Errors
    /// [`FactorError`] if the prior leaves something open or the data are not finite; the solution stays the last one.
    pub fn advance(&mut self) -> Result<bool, FactorError> {
        self.stage = match self.stage {
            Stage::Merge { joint, row } => self.merge(joint, row)?,
            Stage::Solve => self.solve()?,
            Stage::Variance { column } => self.add_variances(column)?,
            Stage::Done => Stage::Done,
        };
        Ok(self.stage == Stage::Done)
    }

    /// Which column is what.
    pub fn layout(&self) -> &Layout<B> {
        self.data.layout()
    }

    /// The copied data.
    pub fn data(&self) -> &JointFactors<T, D, B> {
        &self.data
    }

    /// θ of the last finished solution, SI; zeros before the first.
    pub fn values(&self) -> &[T] {
        self.part(0)
    }

    /// Standard deviations of the last finished solution under independent residuals, in the units of the values.
    pub fn std(&self) -> &[T] {
        self.part(1)
    }

    /// Each joint's noise that the weights used: standard deviation of a window's mean torque, N m.
    pub fn noise(&self) -> &[T; B] {
        &self.noise
    }

    /// Windows that the last finished solution used.
    pub fn windows(&self) -> T {
        self.windows
    }

    fn part(&self, n: usize) -> &[T] {
        let p = self.layout().parameters();
        let start = packed_len(p) + n * p;
        self.storage.as_ref().get(start..start + p).unwrap_or(&[])
    }

    fn merge(&mut self, joint: usize, row: usize) -> Result<Stage, FactorError> {
        let layout = *self.layout();
        let columns = layout.columns(joint);
        let data = self.data.joint(joint);
        let weight = T::one() / self.data.noise(joint);
        let effects = layout.effects(joint);
        let first_effect = layout.solver_column(layout.effect_index(joint, 0));
        let first_body = layout.solver_column(INERTIAL * joint);
        let place = |c| {
            if c < effects {
                first_effect + c
            } else {
                first_body + c - effects
            }
        };
        let mut parts = Parts::of(self.storage.as_mut(), layout.parameters())?;
        let mut cost = 0;
        for k in row..=columns {
            if cost > STEP_COST {
                return Ok(Stage::Merge { joint, row: k });
            }
            parts
                .factor
                .merge_row(&data, k, place, weight, parts.scratch)?;
            cost += (columns + 1 - k) * (columns + 2 - k) / 2;
        }
        if joint + 1 < layout.bodies() {
            Ok(Stage::Merge {
                joint: joint + 1,
                row: 0,
            })
        } else {
            Ok(Stage::Solve)
        }
    }

    fn solve(&mut self) -> Result<Stage, FactorError> {
        let parts = Parts::of(self.storage.as_mut(), self.data.layout().parameters())?;
        parts.factor.solve(parts.next)?;
        Ok(Stage::Variance { column: 0 })
    }

    fn add_variances(&mut self, column: usize) -> Result<Stage, FactorError> {
        let layout = *self.layout();
        let p = layout.parameters();
        let parts = Parts::of(self.storage.as_mut(), p)?;
        let (scratch, mut cost) = (parts.scratch.get_mut(..p).unwrap_or(&mut []), 0);
        for j in column..p {
            if cost > STEP_COST {
                return Ok(Stage::Variance { column: j });
            }
            parts
                .factor
                .add_variance_column(j, parts.variance, scratch)?;
            cost += (j + 1) * (j + 2) / 2;
        }
        for k in 0..p {
            let from = layout.solver_column(k);
            parts.values[k] = parts.next[from];
            parts.std[k] = parts.variance[from].sqrt();
        }
        self.noise = core::array::from_fn(|joint| self.data.noise(joint));
        self.windows = self.data.windows();
        Ok(Stage::Done)
    }
}
