//! A leg's parameters from its windows: one factor per joint, a prior, and a solution in bounded steps.
//!
//! A joint's torque depends on the bodies it moves and on its own effects, so each joint has a factor of just those
//! columns ([`LegFactors`]): 34 for the hip, 24 for the thigh, 14 for the calf, instead of three rows of 42. Each joint's
//! noise then follows from its own ρ, and weighted least squares needs no second pass over the data: the three triangles
//! are stacked, each divided by its joint's noise, onto the prior's ([`Solver`]).
//!
//! Columns of a joint's factor: its effects, then the ten parameters of each body from its own outwards. The solution
//! ([`Solution`]) has the order of θ in `design.md` §1: inertial blocks of hip, thigh and calf, then their effects.

use crate::effect::{EffectKind, Prior};
use crate::factor::{BodyFactor, Factor, FactorError, packed_len};
use crate::go2::{ACTUATORS, Actuator, JOINTS_PER_LEG, Leg, leg, position_limits};
use crate::inertia::INERTIAL;
use crate::spatial::Transform;
use crate::window::{Plausible, Push, Rows, Sample, Settings, Window};
use crate::{Real, scalar::real};

/// The effects that are estimated at every joint, in column order.
pub const EFFECTS: [EffectKind; 4] = [
    EffectKind::Viscous,
    EffectKind::Coulomb,
    EffectKind::Armature,
    EffectKind::Bias,
];

/// Inertial parameters of a leg.
pub const LEG_INERTIAL: usize = INERTIAL * JOINTS_PER_LEG;

/// All parameters of a leg.
pub const LEG_PARAMETERS: usize = LEG_INERTIAL + EFFECTS.len() * JOINTS_PER_LEG;

/// Relative standard deviation of the CAD's inertias; see [`crate::inertia::InertialParameters::prior`].
pub const CAD_UNCERTAINTY: f64 = 0.1;

/// The window of a leg.
pub type LegWindow<T> = Window<T, JOINTS_PER_LEG, LEG_INERTIAL, { EFFECTS.len() }>;
/// The rows of a leg's window.
pub type LegRows<T> = Rows<T, JOINTS_PER_LEG, LEG_INERTIAL, { EFFECTS.len() }>;
/// One number per parameter of a leg, in the order of θ.
pub type LegVector<T> = [T; LEG_PARAMETERS];

/// Where the effects of `joint` start in a leg's θ.
pub const fn effect_index(joint: usize, effect: usize) -> usize {
    LEG_INERTIAL + EFFECTS.len() * joint + effect
}

/// Columns of a joint's factor.
const fn joint_columns(joint: usize) -> usize {
    EFFECTS.len() + INERTIAL * (JOINTS_PER_LEG - joint)
}

/// Where column c of a joint's factor stands in a leg's θ.
const fn parameter_index(joint: usize, column: usize) -> usize {
    if column < EFFECTS.len() {
        effect_index(joint, column)
    } else {
        INERTIAL * joint + column - EFFECTS.len()
    }
}

/// Where parameter k of θ stands in the solver's factor: effects first, since no two joints share one.
const fn solver_column(parameter: usize) -> usize {
    (parameter + LEG_PARAMETERS - LEG_INERTIAL) % LEG_PARAMETERS
}

/// All that a leg's data say: one factor per joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegFactors<T: Real> {
    hip: Factor<T, [T; packed_len(joint_columns(0))]>,
    thigh: Factor<T, [T; packed_len(joint_columns(1))]>,
    calf: Factor<T, [T; packed_len(joint_columns(2))]>,
}

impl<T: Real> Default for LegFactors<T> {
    /// No data.
    fn default() -> Self {
        Self {
            hip: Factor::new::<{ joint_columns(0) }>(),
            thigh: Factor::new::<{ joint_columns(1) }>(),
            calf: Factor::new::<{ joint_columns(2) }>(),
        }
    }
}

impl<T: Real> LegFactors<T> {
    /// The factor of hip (0), thigh (1) or calf (any other number).
    pub fn joint(&self, joint: usize) -> Factor<T, &[T]> {
        match joint {
            0 => self.hip.view(),
            1 => self.thigh.view(),
            _ => self.calf.view(),
        }
    }

    /// Windows folded in; forgotten ones count less.
    pub fn windows(&self) -> T {
        self.hip.rows()
    }

    /// Folds in the rows of one window.
    ///
    /// # Errors
    /// [`FactorError::NotFinite`], and then nothing of the joint that holds such a number is folded in.
    pub fn fold(&mut self, rows: &LegRows<T>) -> Result<(), FactorError> {
        let mut row = [T::zero(); joint_columns(0) + 1];
        self.hip.update(rows.joint_row(0, &mut row))?;
        self.thigh.update(rows.joint_row(1, &mut row))?;
        self.calf.update(rows.joint_row(2, &mut row))
    }

    /// Weighs all data so far down to `retention` (0 to 1).
    pub fn forget(&mut self, retention: T) {
        self.hip.forget(retention);
        self.thigh.forget(retention);
        self.calf.forget(retention);
    }

    /// Adds the data of `other`, in any order and any number of times the same.
    ///
    /// # Errors
    /// [`FactorError::NotFinite`] if `other` holds such a number.
    pub fn merge(&mut self, other: &Self) -> Result<(), FactorError> {
        let columns: [usize; joint_columns(0)] = core::array::from_fn(|c| c);
        let mut scratch = [T::zero(); joint_columns(0) + 1];
        let one = T::one();
        self.hip.merge(&other.hip, &columns, one, &mut scratch)?;
        self.thigh.merge(
            &other.thigh,
            &columns[..joint_columns(1)],
            one,
            &mut scratch,
        )?;
        self.calf
            .merge(&other.calf, &columns[..joint_columns(2)], one, &mut scratch)
    }

    /// A joint's noise: the standard deviation of its mean torque over a window (N m) about its own best fit.
    ///
    /// Before there are data it is [`NOISE_GUESS`].
    pub fn noise(&self, joint: usize) -> T {
        let (guess, rows) = (real::<T>(NOISE_GUESS), real::<T>(NOISE_GUESS_ROWS));
        let factor = self.joint(joint);
        let freedom = (factor.rows() - real(factor.columns() as f64)).max(T::zero());
        ((factor.residual() + rows * guess * guess) / (freedom + rows)).sqrt()
    }

    /// A joint's sum of squared residuals (mean torques over windows, N m) under any parameters of the leg.
    pub fn sum_of_squares(&self, joint: usize, theta: &LegVector<T>) -> T {
        let own: [T; joint_columns(0)] = core::array::from_fn(|c| {
            theta
                .get(parameter_index(joint, c))
                .copied()
                .unwrap_or(T::zero())
        });
        self.joint(joint).sum_of_squares(&own)
    }
}

/// A joint's noise before there are data, N m.
pub const NOISE_GUESS: f64 = 0.1;
/// How many rows that guess is worth.
const NOISE_GUESS_ROWS: f64 = 10.0;

/// What is taken to be true of a leg before any data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegPrior<T: Real> {
    bodies: [BodyFactor<T>; JOINTS_PER_LEG],
    effects: [[Prior; EFFECTS.len()]; JOINTS_PER_LEG],
}

impl<T: Real> LegPrior<T> {
    /// The CAD's inertias within [`CAD_UNCERTAINTY`], each effect as its catalogue entry says.
    pub fn new(which: Leg) -> Self {
        let tree = leg::<T>(which);
        Self {
            // A body that is not physical has no distance to others: nothing is then known of it. The Go2's all are.
            bodies: core::array::from_fn(|b| {
                let body = tree.bodies()[b].inertia.prior(real(CAD_UNCERTAINTY));
                body.unwrap_or(BodyFactor::new::<INERTIAL>())
            }),
            effects: ACTUATORS.map(|actuator: Actuator| EFFECTS.map(|e| e.prior(&actuator))),
        }
    }

    /// Means and standard deviations, in the order of θ.
    ///
    /// # Errors
    /// [`FactorError::Singular`] if a body has no prior.
    pub fn marginals(&self) -> Result<(LegVector<T>, LegVector<T>), FactorError> {
        let mut solver = Solver::default();
        solver.start(self, &LegFactors::default());
        while !solver.advance()? {}
        Ok((solver.solution().values, solver.solution().std))
    }
}

/// A leg's estimated parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution<T> {
    /// θ, SI.
    pub values: LegVector<T>,
    /// Standard deviations under independent residuals, in the units of the values.
    pub std: LegVector<T>,
    /// Each joint's noise that the weights used: standard deviation of a window's mean torque, N m.
    pub noise: [T; JOINTS_PER_LEG],
    /// Windows used.
    pub windows: T,
}

/// The solution of a leg in steps of bounded cost, so that a tick stays within its budget.
#[derive(Clone, Copy, Debug)]
pub struct Solver<T: Real> {
    data: LegFactors<T>,
    factor: Factor<T, [T; packed_len(LEG_PARAMETERS)]>,
    stage: Stage,
    variance: LegVector<T>,
    solution: Solution<T>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    Merge { joint: usize, row: usize },
    Solve,
    Variance { column: usize },
    Done,
}

/// Cost that one step of a solution may reach: numbers touched, about a dozen instructions each.
const STEP_COST: usize = 3000;

impl<T: Real> Default for Solver<T> {
    fn default() -> Self {
        let zero = [T::zero(); LEG_PARAMETERS];
        let solution = Solution {
            values: zero,
            std: zero,
            noise: [T::zero(); 3],
            windows: T::zero(),
        };
        Self {
            data: LegFactors::default(),
            factor: Factor::new::<LEG_PARAMETERS>(),
            stage: Stage::Done,
            variance: zero,
            solution,
        }
    }
}

impl<T: Real> Solver<T> {
    /// Begins the solution for the data in `factors` (copied: they may go on changing) on top of `prior`.
    pub fn start(&mut self, prior: &LegPrior<T>, factors: &LegFactors<T>) {
        self.data = *factors;
        self.factor.clear();
        self.stage = Stage::Merge { joint: 0, row: 0 };
        self.variance.fill(T::zero());
        for (b, body) in prior.bodies.iter().enumerate() {
            // The columns are constants of this file, so that neither call can fail.
            let _ = self.factor.place(solver_column(INERTIAL * b), body);
        }
        for (joint, effects) in prior.effects.iter().enumerate() {
            for (e, prior) in effects.iter().enumerate() {
                let mut row = Factor::<T, [T; packed_len(1)]>::new::<1>();
                let _ = row.add_prior(0, real(prior.mean), real(prior.std), &mut [T::zero(); 2]);
                let _ = self
                    .factor
                    .place(solver_column(effect_index(joint, e)), &row);
            }
        }
    }

    /// Does the next step; true when [`solution`](Self::solution) is new, and from then on.
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

    /// The last finished solution; zeros before the first.
    pub fn solution(&self) -> &Solution<T> {
        &self.solution
    }

    fn merge(&mut self, joint: usize, row: usize) -> Result<Stage, FactorError> {
        let columns = joint_columns(joint);
        let map: [usize; joint_columns(0)] = core::array::from_fn(|c| {
            if c < columns {
                solver_column(parameter_index(joint, c))
            } else {
                0
            }
        });
        let weight = T::one() / self.data.noise(joint);
        let mut scratch = [T::zero(); joint_columns(0) + 1];
        let mut cost = 0;
        for k in row..=columns {
            if cost > STEP_COST {
                return Ok(Stage::Merge { joint, row: k });
            }
            let data = self.data.joint(joint);
            self.factor
                .merge_row(&data, k, &map[..columns], weight, &mut scratch)?;
            cost += (columns + 1 - k) * (columns + 2 - k) / 2;
        }
        if joint + 1 < JOINTS_PER_LEG {
            Ok(Stage::Merge {
                joint: joint + 1,
                row: 0,
            })
        } else {
            Ok(Stage::Solve)
        }
    }

    fn solve(&mut self) -> Result<Stage, FactorError> {
        let mut ordered = [T::zero(); LEG_PARAMETERS];
        self.factor.solve(&mut ordered)?;
        self.solution.values = core::array::from_fn(|k| ordered[solver_column(k)]);
        Ok(Stage::Variance { column: 0 })
    }

    fn add_variances(&mut self, column: usize) -> Result<Stage, FactorError> {
        let mut scratch = [T::zero(); LEG_PARAMETERS];
        let mut cost = 0;
        for j in column..LEG_PARAMETERS {
            if cost > STEP_COST {
                return Ok(Stage::Variance { column: j });
            }
            self.factor
                .add_variance_column(j, &mut self.variance, &mut scratch)?;
            cost += (j + 1) * (j + 2) / 2;
        }
        self.solution.std = core::array::from_fn(|k| self.variance[solver_column(k)].sqrt());
        self.solution.noise = core::array::from_fn(|joint| self.data.noise(joint));
        self.solution.windows = self.data.windows();
        Ok(Stage::Done)
    }
}

/// One leg from samples to estimates: window, factors, prior. The [`Solver`] may serve several.
#[derive(Clone, Debug)]
pub struct LegEstimator<T: Real> {
    window: LegWindow<T>,
    factors: LegFactors<T>,
    prior: LegPrior<T>,
}

impl<T: Real> LegEstimator<T> {
    /// A leg of a robot that hangs or stands level by its base, without data.
    pub fn new(which: Leg) -> Self {
        let window = Window::new(
            leg(which),
            Transform::identity(),
            EFFECTS,
            plausible(which),
            Settings::default(),
        );
        Self {
            window,
            factors: LegFactors::default(),
            prior: LegPrior::new(which),
        }
    }

    /// Takes the next sample; a window that it closes is folded in.
    pub fn push(&mut self, sample: &Sample<T, JOINTS_PER_LEG>) -> Push {
        let push = self.window.push(sample);
        if push == Push::Closed && self.factors.fold(self.window.rows()).is_err() {
            return Push::Rejected(crate::window::Implausible::NotFinite);
        }
        push
    }

    /// The rows of the window closed last.
    pub fn rows(&self) -> &LegRows<T> {
        self.window.rows()
    }

    /// The data so far.
    pub fn factors(&self) -> &LegFactors<T> {
        &self.factors
    }

    /// The data so far, to forget or to merge.
    pub fn factors_mut(&mut self) -> &mut LegFactors<T> {
        &mut self.factors
    }

    /// What was taken to be true before.
    pub fn prior(&self) -> &LegPrior<T> {
        &self.prior
    }

    /// The solution at once, on the desktop; the microcontroller goes through [`Solver`] step by step.
    ///
    /// # Errors
    /// As [`Solver::advance`].
    pub fn solve(&self) -> Result<Solution<T>, FactorError> {
        let mut solver = Solver::default();
        solver.start(&self.prior, &self.factors);
        while !solver.advance()? {}
        Ok(*solver.solution())
    }
}

/// Limits of a leg's readings with room for offsets: 1 rad beyond the joint's stops, twice the rated speed and torque.
pub fn plausible<T: Real>(which: Leg) -> [Plausible<T>; JOINTS_PER_LEG] {
    let limits = position_limits(which);
    core::array::from_fn(|joint| Plausible {
        position: [real(limits[joint][0] - 1.0), real(limits[joint][1] + 1.0)],
        speed: real(2.0 * ACTUATORS[joint].velocity),
        torque: real(2.0 * ACTUATORS[joint].effort),
    })
}

impl<T: Real> LegRows<T> {
    /// A joint's row as its factor takes it, written into the front of `buffer` and returned.
    fn joint_row<'a>(&self, joint: usize, buffer: &'a mut [T]) -> &'a mut [T] {
        let row = buffer.get_mut(..=joint_columns(joint)).unwrap_or(&mut []);
        self.write_row(joint, joint..JOINTS_PER_LEG, row);
        row
    }
}

#[cfg(test)]
mod tests;
