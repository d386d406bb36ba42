//! The solution of a limb in steps of bounded cost, so that a tick stays within its budget.
//!
//! The joints' triangles are stacked, each divided by its joint's noise, onto the prior's; the triangle that results is
//! solved, and its inverse gives the standard deviations.

use super::{EffectPrior, JointFactors, Layout, LimbPrior};
use crate::Real;
use crate::factor::{Factor, FactorError, ROWS, Run, block_cost, packed_len, row_start};
use crate::inertia::INERTIAL;
use crate::inertia::barrier::KnownRows;
use crate::scalar::sqrt;

/// A step ends before what would bring its cost beyond this ([`block_cost`]), but does something.
const STEP_COST: usize = 1700;

/// How many numbers a solver of `parameters` parameters keeps beside its copy of the data.
pub const fn solver_len(parameters: usize) -> usize {
    packed_len(parameters) + 4 * parameters + ROWS * (parameters + 1)
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
    /// The data alone are merged, without the bodies' prior, and not solved.
    only_data: bool,
    noise: [T; B],
    windows: T,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    // First, so that a solver which has done nothing is all zeros.
    Done,
    Merge { joint: usize, row: usize },
    Solve,
    Variance { column: usize },
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
            only_data: false,
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
        self.begin_merge(false, prior.effects().len(), |n| prior.effect(n));
        let layout = *self.layout();
        let Ok(mut parts) = Parts::of(self.storage.as_mut(), layout.parameters()) else {
            return;
        };
        // The columns follow from the layout, so that no placement can fail.
        for b in 0..layout.bodies() {
            if let Some(body) = prior.body(b) {
                let _ = parts.factor.place(layout.solver_column(INERTIAL * b), body);
            }
        }
    }

    /// Begins to merge the data that `data_mut` holds on top of what is known of each of so many effects, nothing of the bodies; when
    /// [`advance`](Self::advance) says true, [`reduced`](Self::reduced) has what they say. The values stay those of the last solution.
    pub(crate) fn merge_data(
        &mut self,
        effects: usize,
        effect: impl Fn(usize) -> Factor<T, [T; packed_len(1)]>,
    ) {
        self.begin_merge(true, effects, effect);
    }

    fn begin_merge(
        &mut self,
        only_data: bool,
        effects: usize,
        effect: impl Fn(usize) -> Factor<T, [T; packed_len(1)]>,
    ) {
        self.stage = Stage::Merge { joint: 0, row: 0 };
        self.only_data = only_data;
        let layout = *self.layout();
        let Ok(mut parts) = Parts::of(self.storage.as_mut(), layout.parameters()) else {
            return;
        };
        parts.factor.clear();
        parts.variance.fill(T::zero());
        for n in 0..effects {
            let column = layout.solver_column(layout.inertial() + n);
            let _ = parts.factor.place(column, &effect(n));
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
        while self.stage != Stage::Done && (cost == 0 || cost + self.next_cost() <= STEP_COST) {
            cost += match self.stage {
                Stage::Merge { joint, row } => self.merge(joint, row)?,
                Stage::Solve => self.solve()?,
                Stage::Variance { column } => self.add_variances(column)?,
                Stage::Done => 0,
            };
        }
        Ok(self.stage == Stage::Done)
    }

    /// What the next part costs at most.
    fn next_cost(&self) -> usize {
        let layout = self.layout();
        match self.stage {
            Stage::Done => 0,
            Stage::Merge { joint, row } => {
                block_cost((layout.columns(joint) + 1).saturating_sub(row))
            }
            Stage::Solve => layout.parameters() * layout.parameters() / 4,
            Stage::Variance { column } => variance_cost(column),
        }
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

    /// Merges the next rows of a joint's factor, a block at most; returns the cost.
    fn merge(&mut self, joint: usize, row: usize) -> Result<usize, FactorError> {
        let layout = *self.layout();
        let columns = layout.columns(joint);
        let weight = T::one() / self.data.noise(joint);
        let mut parts = Parts::of(self.storage.as_mut(), layout.parameters())?;
        let factor = self.data.joint(joint);
        let (blocks, _) = parts.scratch.as_chunks_mut::<ROWS>();
        let (mut first, mut taken, mut next, mut cost) = (row, 0, row, 0);
        while taken < ROWS && next <= columns {
            let entries = factor.row(next);
            // A row of a dependent column, where base columns were expanded, is empty whatever the data.
            if entries.iter().all(|x| *x == T::zero()) {
                cost += entries.len() / 2;
            } else {
                if taken == 0 {
                    first = next;
                    let block = blocks.get_mut(..=columns - first).unwrap_or(&mut []);
                    block.fill([T::zero(); ROWS]);
                }
                let block = blocks.get_mut(next - first..).unwrap_or(&mut []);
                for (to, x) in block.iter_mut().zip(entries) {
                    if let Some(to) = to.get_mut(taken) {
                        *to = *x * weight;
                    }
                }
                taken += 1;
            }
            next += 1;
        }
        if taken > 0 {
            let error = FactorError::Length(columns);
            let block = blocks.get_mut(..=columns - first).ok_or(error)?;
            parts
                .factor
                .fold_runs(&runs(&layout, joint, first), block)?;
            cost += block_cost(columns + 1 - first);
        }
        self.stage = if next <= columns {
            Stage::Merge { joint, row: next }
        } else if joint + 1 < layout.bodies() {
            Stage::Merge {
                joint: joint + 1,
                row: 0,
            }
        } else if self.only_data {
            Stage::Done
        } else {
            Stage::Solve
        };
        Ok(cost)
    }

    /// Of data that are merged: what they say of the bodies, the effects taken as is best with each.
    pub(crate) fn reduced(&self) -> impl Iterator<Item = T> + '_ {
        let p = self.layout().parameters();
        let start = row_start(p, p - self.layout().inertial());
        let numbers = self.storage.as_ref().get(start..packed_len(p));
        numbers.unwrap_or(&[]).iter().copied()
    }

    /// Of data that are merged: the effects that are best with the bodies that solve `bodies`, which is over their columns; both are
    /// [`step`](Self::step) then.
    pub(crate) fn step_to(&mut self, bodies: &Factor<T, &[T]>) -> Result<(), FactorError> {
        let p = self.data.layout().parameters();
        let parts = Parts::of(self.storage.as_mut(), p)?;
        let effects = p - self.data.layout().inertial();
        bodies.solve(parts.next.get_mut(effects..).unwrap_or(&mut []))?;
        parts.factor.solve_rows(effects, parts.next)
    }

    /// Parameter k of θ where [`step_to`](Self::step_to) leads.
    pub(crate) fn step(&self, k: usize) -> T {
        let p = self.layout().parameters();
        let place = packed_len(p) + 2 * p + self.layout().solver_column(k);
        self.storage
            .as_ref()
            .get(place)
            .copied()
            .unwrap_or(T::zero())
    }

    /// Of data that are merged: the sum of squared residuals, those of what is known of effects among them, at any θ.
    pub(crate) fn misfit(&mut self, theta: impl Fn(usize) -> T) -> T {
        match self.ordered(theta) {
            Ok(parts) => {
                let p = parts.factor.columns();
                let theta = parts.scratch.get(..p).unwrap_or(&[]);
                parts.factor.sum_of_squares(theta)
            }
            Err(_) => T::zero(),
        }
    }

    /// Of data that are merged: how much the cost bends over a step δθ, if `bodies` is what it is with the bodies' prior.
    pub(crate) fn bend(&mut self, bodies: &Factor<T, &[T]>, step: impl Fn(usize) -> T) -> T {
        let inertial = self.data.layout().inertial();
        match self.ordered(step) {
            Ok(parts) => {
                let p = parts.factor.columns();
                let step = parts.scratch.get(..p).unwrap_or(&[]);
                let effects = parts.factor.bend(0..p - inertial, step);
                let own = step.get(p - inertial..).unwrap_or(&[]);
                effects + bodies.bend(0..inertial, own)
            }
            Err(_) => T::zero(),
        }
    }

    /// The parts, with θ in the order of the columns in front of the scratch.
    fn ordered(&mut self, theta: impl Fn(usize) -> T) -> Result<Parts<'_, T>, FactorError> {
        let layout = *self.data.layout();
        let parts = Parts::of(self.storage.as_mut(), layout.parameters())?;
        for k in 0..layout.parameters() {
            if let Some(to) = parts.scratch.get_mut(layout.solver_column(k)) {
                *to = theta(k);
            }
        }
        Ok(parts)
    }

    /// Adds what is known of body b to data that are merged, or to a triangle over the bodies' columns.
    pub(crate) fn fold_body(
        &mut self,
        b: usize,
        known: &[KnownRows<T>],
        bodies: Option<&mut Factor<T, &mut [T]>>,
    ) -> Result<(), FactorError> {
        let layout = *self.data.layout();
        let mut parts = Parts::of(self.storage.as_mut(), layout.parameters())?;
        match bodies {
            Some(bodies) => fold_known(bodies, INERTIAL * b, known, parts.scratch),
            None => {
                let first = layout.solver_column(INERTIAL * b);
                fold_known(&mut parts.factor, first, known, parts.scratch)
            }
        }
    }

    /// Takes θ for the solution of what is merged; the next steps find its standard deviations.
    pub(crate) fn settle(&mut self, theta: impl Fn(usize) -> T) {
        let layout = *self.data.layout();
        if let Ok(parts) = Parts::of(self.storage.as_mut(), layout.parameters()) {
            parts.variance.fill(T::zero());
            for k in 0..layout.parameters() {
                if let Some(to) = parts.next.get_mut(layout.solver_column(k)) {
                    *to = theta(k);
                }
            }
        }
        self.stage = Stage::Variance { column: 0 };
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
        Ok(variance_cost(column))
    }

    fn finish(&mut self) -> Result<(), FactorError> {
        let layout = *self.layout();
        let parts = Parts::of(self.storage.as_mut(), layout.parameters())?;
        let found = parts.values.iter_mut().zip(parts.std);
        for (k, (value, std)) in found.enumerate() {
            let from = layout.solver_column(k);
            if let (Some(next), Some(variance)) = (parts.next.get(from), parts.variance.get(from)) {
                (*value, *std) = (*next, sqrt(*variance));
            }
        }
        self.noise = core::array::from_fn(|joint| self.data.noise(joint));
        self.windows = self.data.windows();
        self.stage = Stage::Done;
        Ok(())
    }
}

/// Folds what is known of a body, whose columns begin at `first`, into a triangle.
fn fold_known<T: Real>(
    factor: &mut Factor<T, &mut [T]>,
    first: usize,
    known: &[KnownRows<T>],
    scratch: &mut [T],
) -> Result<(), FactorError> {
    let (blocks, _) = scratch.as_chunks_mut::<ROWS>();
    let width = (factor.columns() + 1).saturating_sub(first);
    for rows in known {
        let block = blocks.get_mut(..width).unwrap_or(&mut []);
        block.fill([T::zero(); ROWS]);
        if let ([own @ .., right], Some((last, body))) = (rows, block.split_last_mut()) {
            body.iter_mut().zip(own).for_each(|(to, from)| *to = *from);
            *last = *right;
        }
        factor.fold_block(first, block)?;
    }
    Ok(())
}

/// A number of a dot product costs half of one that is rotated; each dot product, some more.
const fn variance_cost(column: usize) -> usize {
    (column + 1) * (column + 2) / 4 + 3 * (column + 1)
}

/// Where the columns of a joint's factor from `first` on, and its right-hand side, lie among the solver's: its effects, its bodies.
fn runs<const B: usize>(layout: &Layout<B>, joint: usize, first: usize) -> [Run; 3] {
    let effects = layout.effects(joint);
    let skipped = first.saturating_sub(effects);
    let first_effect = layout.solver_column(layout.effect_index(joint, 0));
    let first_body = layout.solver_column(INERTIAL * joint);
    [
        Run {
            first: first_effect + first.min(effects),
            length: effects.saturating_sub(first),
        },
        Run {
            first: first_body + skipped,
            length: (layout.columns(joint) - effects).saturating_sub(skipped),
        },
        Run {
            first: layout.parameters(),
            length: 1,
        },
    ]
}
