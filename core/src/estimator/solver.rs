//! The solution of a limb in steps of bounded cost, so that a tick stays within its budget.
//!
//! The joints' triangles are stacked, each divided by its joint's noise, onto the prior's; the triangle that results is
//! solved, and its inverse gives the standard deviations.

use super::{EffectPrior, JointFactors, Layout, LimbPrior};
use crate::Real;
use crate::factor::{Factor, FactorError, packed_len};
use crate::inertia::INERTIAL;
use crate::scalar::sqrt;

/// A step ends at the first row that brings its cost here: numbers rotated, 20 to 35 instructions each on a Cortex-M7.
const STEP_COST: usize = 1200;

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
    pub const fn new(data: JointFactors<T, D, B>, storage: S) -> Self {
        Self {
            data,
            storage,
            stage: Stage::Done,
            noise: [T::ZERO; B],
            windows: T::ZERO,
        }
    }

    /// Begins the solution for `data` (copied: it may go on changing) on top of `prior`.
    pub fn start<E>(&mut self, prior: &LimbPrior<T, E, B>, data: &JointFactors<T, D, B>)
    where
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
        self.data.copy_from(data);
        self.restart(prior);
    }

    /// Begins the solution for the data that `data_mut` holds.
    pub fn restart<E>(&mut self, prior: &LimbPrior<T, E, B>)
    where
        E: AsRef<[EffectPrior]> + AsMut<[EffectPrior]>,
    {
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
        let mut cost = 0;
        while cost < STEP_COST && self.stage != Stage::Done {
            cost += match self.stage {
                Stage::Merge { joint, row } => self.merge(joint, row)?,
                Stage::Solve => self.solve()?,
                Stage::Variance { column } => self.add_variances(column)?,
                Stage::Done => 0,
            };
        }
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

    /// The copied data, to be written by who has them in another form; a solution under way is void.
    pub(crate) fn data_mut(&mut self) -> &mut JointFactors<T, D, B> {
        self.stage = Stage::Done;
        &mut self.data
    }

    /// The solver's own storage, for other work as long as no solution is under way or wanted.
    pub(crate) fn storage_mut(&mut self) -> &mut [T] {
        self.storage.as_mut()
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

    /// Merges one row of a joint's factor; returns the cost.
    fn merge(&mut self, joint: usize, row: usize) -> Result<usize, FactorError> {
        let layout = *self.layout();
        let columns = layout.columns(joint);
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
        let factor = self.data.joint(joint);
        // A row of a dependent column, where base columns were expanded, is empty whatever the data.
        let empty = factor.row(row).iter().all(|x| *x == T::zero());
        if !empty {
            parts
                .factor
                .merge_row(&factor, row, place, weight, parts.scratch)?;
        }
        self.stage = if row < columns {
            Stage::Merge {
                joint,
                row: row + 1,
            }
        } else if joint + 1 < layout.bodies() {
            Stage::Merge {
                joint: joint + 1,
                row: 0,
            }
        } else {
            Stage::Solve
        };
        let length = columns + 1 - row;
        Ok(if empty {
            length
        } else {
            length * (length + 1) / 2
        })
    }

    /// Solves the triangle; returns the cost.
    fn solve(&mut self) -> Result<usize, FactorError> {
        let p = self.data.layout().parameters();
        let parts = Parts::of(self.storage.as_mut(), p)?;
        parts.factor.solve(parts.next)?;
        self.stage = Stage::Variance { column: 0 };
        Ok(p * p / 4)
    }

    /// Adds one column of the inverse to the variances, and ends with the last; returns the cost.
    fn add_variances(&mut self, column: usize) -> Result<usize, FactorError> {
        let p = self.data.layout().parameters();
        let parts = Parts::of(self.storage.as_mut(), p)?;
        let scratch = parts.scratch.get_mut(..p).unwrap_or(&mut []);
        parts
            .factor
            .add_variance_column(column, parts.variance, scratch)?;
        self.stage = Stage::Variance { column: column + 1 };
        if column + 1 == p {
            self.finish()?;
        }
        // A number of a dot product costs half of one that is rotated.
        Ok((column + 1) * (column + 2) / 4)
    }

    fn finish(&mut self) -> Result<(), FactorError> {
        let layout = *self.layout();
        let parts = Parts::of(self.storage.as_mut(), layout.parameters())?;
        for k in 0..layout.parameters() {
            let from = layout.solver_column(k);
            parts.values[k] = parts.next[from];
            parts.std[k] = sqrt(parts.variance[from]);
        }
        self.noise = core::array::from_fn(|joint| self.data.noise(joint));
        self.windows = self.data.windows();
        self.stage = Stage::Done;
        Ok(())
    }
}
