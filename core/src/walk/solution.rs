//! The solution, a block of six rows at a time: the factor's triangles and the priors in one triangle, whose end is the trunk.
//!
//! A prior is in units of its own deviation and the data in N m, so priors are multiplied by the noise of an equation: what the solution
//! before has left, 0.1 N m at first. Deviations hold if what is left of neighbouring windows is independent; the desktop's, which also
//! looks at the spread over blocks of time, are larger where it is not.

use super::columns::{ACC, BIAS, COLUMNS, EFFECTS, OWN, PRIOR_ROWS, REST, TRUNK, WalkPrior};
use super::leg::INERTIA;
use super::{ACTUATORS, Block, Factor, Folding, LIMB, ROWS, STEP_NUMBERS, WalkFactor, WalkMemory};
use crate::effect::EffectKind;
use crate::go2::{JOINTS_PER_LEG, LEGS};
use crate::inertia::INERTIAL;
use crate::scalar::sqrt;
use crate::{Real, scalar::real};

/// The noise of an equation before a solution tells it, and the least that is believed, N m.
const FIRST_NOISE: f64 = 0.1;
const LEAST_NOISE: f64 = 1e-4;
/// Equations that tell it.
const LEAST_EQUATIONS: u32 = COLUMNS as u32;
/// Standard deviation of an accelerometer's bias, m/s².
const ACC_BIAS: f64 = 0.2;

/// Blocks: the bodies' priors, the effects' of each leg in two, the accelerometer's, the legs' rows.
const BODIES: usize = PRIOR_ROWS.div_ceil(ROWS);
const EFFECT_BLOCKS: usize = 2;
const ACC_AT: usize = BODIES + EFFECT_BLOCKS * LEGS;
const LEGS_AT: usize = ACC_AT + 1;
const LEG_BLOCKS: usize = (LIMB + 1).div_ceil(ROWS);
const BLOCKS: usize = LEGS_AT + LEG_BLOCKS * LEGS;
/// Rows of the triangle that one step substitutes.
const STEP_ROWS: usize = 24;

/// What is told of a robot that walks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkEstimate<T> {
    /// The whole robot's mass, kg, and its standard deviation if what is left is independent.
    pub mass: [T; 2],
    /// The trunk's ten inertial parameters about the base's origin: what the data say of trunk and hips together, told apart by the CAD.
    pub trunk: [T; INERTIAL],
    /// The accelerometer's bias, m/s², in the IMU's axes.
    pub acc_bias: [T; BIAS],
    /// Root mean square of what is left of an equation, N m.
    pub noise: T,
    /// Equations that it is of.
    pub equations: u32,
}

/// Where a solution is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    Idle,
    Copy,
    /// This block is written next, or is being folded in.
    Write(usize),
    Fold(usize),
    /// Rows from here up are still to be substituted.
    Substitute(usize),
}

/// A solution being made, and the last one.
#[derive(Clone, Debug)]
pub(super) struct Solution<T> {
    stage: Stage,
    folding: Folding,
    block: [[T; ROWS]; COLUMNS + 1],
    noise: T,
    /// Equations of the solution under way, and of the last one.
    under_way: u32,
    equations: u32,
    next: [T; COLUMNS],
    theta: [T; COLUMNS],
    mass_std: T,
}

impl<T: Real> Solution<T> {
    pub(super) const fn new() -> Self {
        Self {
            stage: Stage::Idle,
            folding: Folding::from(0),
            block: [[T::ZERO; ROWS]; COLUMNS + 1],
            noise: T::ZERO,
            under_way: 0,
            equations: 0,
            next: [T::ZERO; COLUMNS],
            theta: [T::ZERO; COLUMNS],
            mass_std: T::ZERO,
        }
    }

    pub(super) fn begin(&mut self) {
        self.stage = Stage::Idle;
        self.noise = real(FIRST_NOISE);
        self.equations = 0;
        self.theta = [T::zero(); COLUMNS];
    }

    pub(super) fn start(&mut self) {
        if self.stage == Stage::Idle {
            self.stage = Stage::Copy;
        }
    }

    pub(super) fn parameters(&self) -> &[T; COLUMNS] {
        &self.theta
    }

    /// A part of it; true when it is done.
    pub(super) fn advance(
        &mut self,
        memory: &mut WalkMemory<T>,
        gravity: &[T; 4],
        equations: u32,
    ) -> bool {
        match self.stage {
            Stage::Idle => {}
            Stage::Copy => {
                memory.work.copy_from_slice(memory.factor.base().packed());
                self.under_way = equations;
                self.stage = Stage::Write(0);
            }
            Stage::Write(block) => {
                let first = self.write(block, memory, gravity);
                self.folding = Folding::from(first);
                self.stage = Stage::Fold(block);
            }
            Stage::Fold(block) => self.fold(block, memory),
            Stage::Substitute(rows) => return self.substitute(rows, memory),
        }
        false
    }

    fn fold(&mut self, block: usize, memory: &mut WalkMemory<T>) {
        let target = Factor::in_storage(COLUMNS, memory.work.as_mut_slice());
        let folded =
            target.and_then(|target| self.folding.advance(target, STEP_NUMBERS, &mut self.block));
        if folded.is_err() {
            // Numbers that overflow: this solution is none.
            self.stage = Stage::Idle;
        } else if self.folding.is_done(COLUMNS) {
            self.stage = match block + 1 {
                BLOCKS => Stage::Substitute(COLUMNS),
                next => Stage::Write(next),
            };
        }
    }

    /// Writes a block's rows, and tells the first column that they touch.
    fn write(&mut self, n: usize, memory: &WalkMemory<T>, gravity: &[T; 4]) -> usize {
        if n < BODIES {
            memory
                .prior
                .write_rows(ROWS * n, self.noise, &mut self.block)
        } else if n < ACC_AT {
            self.write_effects(n - BODIES)
        } else if n < LEGS_AT {
            self.write_acc(gravity)
        } else {
            let (leg, rows) = ((n - LEGS_AT) / LEG_BLOCKS, (n - LEGS_AT) % LEG_BLOCKS);
            let triangle = memory.factor.limb(leg);
            let k = ROWS * rows;
            WalkFactor::write_limb_rows(&triangle, leg, k, &mut self.block);
            // Beyond its own columns a leg's rows touch the common ones.
            match k.checked_sub(OWN) {
                Some(common) => ACC + common,
                None => OWN * leg + k,
            }
        }
    }

    /// Half of a leg's effects.
    fn write_effects(&mut self, n: usize) -> usize {
        self.block.as_flattened_mut().fill(T::zero());
        let first = OWN * (n / EFFECT_BLOCKS) + INERTIA;
        for r in 0..ROWS {
            let e = ROWS * (n % EFFECT_BLOCKS) + r;
            let actuator = &ACTUATORS[(e / EFFECTS) % JOINTS_PER_LEG];
            let prior = EffectKind::PLAIN[e % EFFECTS].prior_of(actuator, 0);
            let weight = self.noise * real(1.0 / prior.std);
            set(&mut self.block, first + e, r, weight);
            set(&mut self.block, COLUMNS, r, weight * real(prior.mean));
        }
        first + ROWS * (n % EFFECT_BLOCKS)
    }

    /// The accelerometer's prior, and what gravity's length tells of it.
    fn write_acc(&mut self, gravity: &[T; 4]) -> usize {
        self.block.as_flattened_mut().fill(T::zero());
        for (n, x) in gravity.iter().enumerate() {
            set(&mut self.block, ACC + n, BIAS, *x * self.noise);
        }
        for n in 0..BIAS {
            set(
                &mut self.block,
                ACC + n,
                n,
                self.noise * real(1.0 / ACC_BIAS),
            );
        }
        ACC
    }

    /// Some rows of the substitution, the last ones first; the deviation of the mass at its end.
    fn substitute(&mut self, rows: usize, memory: &WalkMemory<T>) -> bool {
        let Ok(factor) = Factor::in_storage(COLUMNS, memory.work.as_slice()) else {
            return false;
        };
        let end = rows.saturating_sub(STEP_ROWS);
        for k in (end..rows).rev() {
            let Some((z, row)) = factor.row(k).split_last() else {
                break;
            };
            let known = row.iter().zip(self.next.iter().skip(k)).skip(1);
            let left = known.fold(*z, |left, (r, x)| left - *r * *x);
            if let (Some(to), Some(pivot)) = (self.next.get_mut(k), row.first()) {
                *to = left / *pivot;
            }
        }
        if end > 0 {
            self.stage = Stage::Substitute(end);
            return false;
        }
        self.finish(&factor);
        true
    }

    #[inline(never)]
    fn finish(&mut self, factor: &Factor<T, &[T]>) {
        self.stage = Stage::Idle;
        let finite = self
            .next
            .iter()
            .fold(T::zero(), |sum, x| sum + *x * T::zero());
        if finite != T::zero() {
            return;
        }
        self.theta = self.next;
        self.equations = self.under_way;
        let equations = real::<T>(f64::from(self.under_way.max(1)));
        // Of a few equations, which the parameters fit whatever they are, nothing is learnt.
        let left = sqrt(factor.residual() / equations).max(real(LEAST_NOISE));
        let told = self.under_way >= LEAST_EQUATIONS;
        self.noise = if told { left } else { self.noise };
        // The mass' row of R⁻¹ among the last columns: those of the legs before it have no part in it.
        let mut row = [T::zero(); REST];
        for c in 0..REST {
            let own = if c == 0 { T::one() } else { T::zero() };
            let left = (0..c).fold(own, |left, k| {
                let entry = factor.row(TRUNK + k).get(c - k).copied();
                left - row.get(k).copied().unwrap_or(T::zero()) * entry.unwrap_or(T::zero())
            });
            let pivot = factor.row(TRUNK + c).first().copied().unwrap_or(T::one());
            if let Some(to) = row.get_mut(c) {
                *to = left / pivot;
            }
        }
        let square = row.iter().fold(T::zero(), |sum, x| sum + *x * *x);
        self.mass_std = sqrt(square) * self.noise;
    }

    pub(super) fn estimate(&self, prior: &WalkPrior<T>) -> WalkEstimate<T> {
        let at = |n: usize| self.theta.get(n).copied().unwrap_or(T::zero());
        WalkEstimate {
            mass: [at(TRUNK), self.mass_std],
            trunk: prior.trunk(&self.theta),
            acc_bias: core::array::from_fn(|n| at(ACC + n)),
            noise: self.noise,
            equations: self.equations,
        }
    }
}

fn set<T: Copy>(block: &mut Block<T>, column: usize, row: usize, x: T) {
    if let Some(to) = block.get_mut(column).and_then(|rows| rows.get_mut(row)) {
        *to = x;
    }
}
