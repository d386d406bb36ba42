//! Which effects each joint has, and which it lacks: one bounded step at a time, between two estimates.
//!
//! For each joint in turn, both folds' factors are copied, so that all models are judged on the same data. The fit to one
//! fold, on top of the CAD prior of the base parameters and the effects' own, is put in the order base parameters,
//! effects ([`Nested`]); then every candidate is tried beside the active effects, and every active effect left out; each fit
//! is judged on the other fold. Then the folds change places.

use crate::Real;
use crate::criticism::{Finding, HeldOut, Nested, work_len};
use crate::estimator::{
    Active, BASE_RANK, Beliefs, DEVICE_COLUMNS, DeviceFolds, FOLDS, FRONT, LegBase,
};
use crate::factor::{Factor, FactorError, ROWS, block_cost, packed_len};
use crate::go2::{ACTUATORS, JOINTS_PER_LEG, LEGS};
use crate::scalar::real;

/// Columns of the longest joint: effects and base parameters.
const COLUMNS: usize = DEVICE_COLUMNS + BASE_RANK[0];

/// A step ends at the first block of rows that brings its cost here ([`block_cost`]).
const STEP_COST: usize = 1200;

/// Effects tried in one step; an active one takes two fits.
const TRIES: usize = 1;

/// Fewest windows of a fold that is judged: a second of its own.
const LEAST_WINDOWS: f64 = 50.0;

/// What was found of one effect at one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Verdict<T> {
    pub(super) leg: usize,
    pub(super) joint: usize,
    pub(super) effect: usize,
    pub(super) active: bool,
    pub(super) windows: T,
    pub(super) held_out: HeldOut<T, FOLDS>,
    pub(super) finding: Finding<T>,
}

/// What a diagnosis looks at.
pub(super) struct Evidence<'a, T> {
    pub(super) folds: &'a DeviceFolds<T>,
    pub(super) base: &'a LegBase<T>,
    pub(super) active: &'a Active,
    pub(super) beliefs: &'a Beliefs,
    /// The joints' noise, N m.
    pub(super) noise: &'a [T; JOINTS_PER_LEG],
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Copy the next joint's data.
    Copy,
    /// Stack the training fold's rows from this one on.
    Stack { row: usize },
    /// Try this effect.
    Try { effect: usize },
    /// Tell of this effect.
    Tell { effect: usize },
}

/// The diagnosis under way.
pub(super) struct Diagnosis<T> {
    joint: usize,
    stage: Stage,
    /// The fold that is fitted; the other judges.
    train: usize,
    active: u32,
    noise: T,
    windows: [T; FOLDS],
    folds: [[T; packed_len(COLUMNS)]; FOLDS],
    work: [T; packed_len(COLUMNS)],
    small: [T; work_len(DEVICE_COLUMNS)],
    /// The error of the model as it is, on the judging fold.
    present: T,
    held_out: [HeldOut<T, FOLDS>; DEVICE_COLUMNS],
    findings: [Finding<T>; DEVICE_COLUMNS],
}

impl<T: Real> Diagnosis<T> {
    pub(super) const fn new() -> Self {
        Self {
            joint: 0,
            stage: Stage::Copy,
            train: 0,
            active: 0,
            noise: T::ZERO,
            windows: [T::ZERO; FOLDS],
            folds: [[T::ZERO; packed_len(COLUMNS)]; FOLDS],
            work: [T::ZERO; packed_len(COLUMNS)],
            small: [T::ZERO; work_len(DEVICE_COLUMNS)],
            present: T::ZERO,
            held_out: [const { HeldOut::NONE }; DEVICE_COLUMNS],
            findings: [const { Finding::NONE }; DEVICE_COLUMNS],
        }
    }

    /// Begins with the first joint again.
    pub(super) fn restart(&mut self) {
        self.joint = 0;
        self.stage = Stage::Copy;
    }

    /// Leaves out what is left of the present leg.
    pub(super) fn skip_leg(&mut self) {
        self.joint = (self.leg() + 1) % LEGS * JOINTS_PER_LEG;
        self.stage = Stage::Copy;
    }

    /// The leg whose evidence the next step wants.
    pub(super) fn leg(&self) -> usize {
        self.joint / JOINTS_PER_LEG
    }

    /// One step of bounded cost; the same instructions whatever the data. Nothing, as long as verdicts wait to be told.
    pub(super) fn advance(&mut self, evidence: &Evidence<T>) {
        let done = match self.stage {
            Stage::Copy => self.copy(evidence),
            Stage::Stack { row } => self.stack(row),
            Stage::Try { effect } => self.try_effects(effect, evidence),
            Stage::Tell { .. } => Ok(()),
        };
        if done.is_err() {
            self.next_joint();
        }
    }

    /// The next verdict, each once.
    pub(super) fn take(&mut self) -> Option<Verdict<T>> {
        let Stage::Tell { effect } = self.stage else {
            return None;
        };
        let (Some(held_out), Some(finding)) =
            (self.held_out.get(effect), self.findings.get(effect))
        else {
            self.next_joint();
            return None;
        };
        let verdict = Verdict {
            leg: self.leg(),
            joint: self.joint % JOINTS_PER_LEG,
            effect,
            active: self.active >> effect & 1 == 1,
            windows: self.windows[0] + self.windows[1],
            held_out: *held_out,
            finding: *finding,
        };
        if effect + 1 < DEVICE_COLUMNS {
            self.stage = Stage::Tell { effect: effect + 1 };
        } else {
            self.next_joint();
        }
        Some(verdict)
    }

    fn next_joint(&mut self) {
        self.joint = (self.joint + 1) % (LEGS * JOINTS_PER_LEG);
        self.stage = Stage::Copy;
    }

    fn base(&self) -> usize {
        BASE_RANK[self.joint % JOINTS_PER_LEG]
    }

    fn copy(&mut self, evidence: &Evidence<T>) -> Result<(), FactorError> {
        let joint = self.joint % JOINTS_PER_LEG;
        for (fold, copy) in self.folds.iter_mut().enumerate() {
            let factor = evidence.folds.joint(fold, joint);
            self.windows[fold] = factor.rows();
            for (to, from) in copy.iter_mut().zip(factor.packed()) {
                *to = *from;
            }
        }
        self.active = evidence.active.0[joint];
        self.noise = evidence.noise[joint];
        self.held_out = [HeldOut::NONE; DEVICE_COLUMNS];
        self.findings = [Finding::NONE; DEVICE_COLUMNS];
        if self.windows.iter().any(|n| *n < real(LEAST_WINDOWS)) {
            self.next_joint();
            return Ok(());
        }
        self.train_on(0, evidence)
    }

    /// Puts the priors in the work space, for the fit to fold `train`.
    fn train_on(&mut self, train: usize, evidence: &Evidence<T>) -> Result<(), FactorError> {
        let (joint, base) = (self.joint % JOINTS_PER_LEG, self.base());
        self.train = train % FOLDS;
        self.stage = Stage::Stack { row: 0 };
        let mut work = factor(&mut self.work, base + DEVICE_COLUMNS)?;
        work.clear();
        let marginal = evidence.base.marginal(joint);
        work.place(0, &marginal.ok_or(FactorError::Length(joint))?)?;
        // A load that was picked up is none of the CAD's.
        work.forget(evidence.base.trust(joint));
        for n in 0..DEVICE_COLUMNS {
            let prior = evidence.beliefs.prior(joint, n, &ACTUATORS[joint]).prior;
            // What is not there is zero: a candidate's mean would be evidence for it.
            let mean = if self.active >> n & 1 == 1 {
                prior.mean
            } else {
                0.0
            };
            let mut row = Factor::<T, [T; packed_len(1)]>::new::<1>();
            row.add_prior(0, real(mean), real(prior.std), &mut [T::zero(); 2])?;
            work.place(base + n, &row)?;
        }
        Ok(())
    }

    /// Stacks rows of the training fold, effects moved behind the base parameters.
    fn stack(&mut self, first: usize) -> Result<(), FactorError> {
        let base = self.base();
        let p = base + DEVICE_COLUMNS;
        let weight = T::one() / self.noise;
        let (mut cost, mut k) = (0, first);
        while k <= p && cost < STEP_COST {
            let train = factor(&mut self.folds[self.train % FOLDS], p)?;
            let mut block = [[T::zero(); ROWS]; COLUMNS + 1];
            let end = (k + ROWS).min(p + 1);
            for (slot, k) in (k..end).enumerate() {
                for (n, x) in train.row(k).iter().enumerate() {
                    let place = match k + n {
                        c if c < FRONT => base + c,
                        c if c < FRONT + base => c - FRONT,
                        c => c,
                    };
                    if let Some(to) = block.get_mut(place).and_then(|to| to.get_mut(slot)) {
                        *to = *x * weight;
                    }
                }
            }
            // A row begins at its own place; the first effects' rows have base columns, which come before.
            let start = match k {
                k if k < FRONT => 0,
                k if k < FRONT + base => k - FRONT,
                k => k,
            };
            let block = block.get_mut(start..=p).unwrap_or(&mut []);
            factor(&mut self.work, p)?.fold_block(start, block)?;
            cost += block_cost(p + 1 - start);
            k = end;
        }
        self.stage = if k <= p {
            Stage::Stack { row: k }
        } else {
            self.present = self.judge(self.active, DEVICE_COLUMNS)?.0;
            Stage::Try { effect: 0 }
        };
        Ok(())
    }

    /// The error of a model on the judging fold, and what its fit found of effect `of`.
    fn judge(&mut self, subset: u32, of: usize) -> Result<(T, Finding<T>), FactorError> {
        let base = self.base();
        let p = base + DEVICE_COLUMNS;
        let (mut theta, mut there) = ([T::zero(); COLUMNS], [T::zero(); COLUMNS]);
        let theta = theta.get_mut(..p).unwrap_or(&mut []);
        let fitted = factor(&mut self.work, p)?;
        let found = Nested::new(fitted.view(), base).fit(subset, of, theta, &mut self.small)?;
        let (inertial, effects) = theta.split_at(base.min(theta.len()));
        let (front, back) = effects.split_at(FRONT.min(effects.len()));
        for (to, from) in there
            .iter_mut()
            .zip(front.iter().chain(inertial).chain(back))
        {
            *to = *from;
        }
        let test = factor(&mut self.folds[(self.train + 1) % FOLDS], p)?;
        Ok((test.sum_of_squares(&there), found))
    }

    /// Tries a few effects from this one on; after the last, the folds change places.
    fn try_effects(&mut self, first: usize, evidence: &Evidence<T>) -> Result<(), FactorError> {
        let end = (first + TRIES).min(DEVICE_COLUMNS);
        for effect in first..end {
            self.try_effect(effect)?;
        }
        if end < DEVICE_COLUMNS {
            self.stage = Stage::Try { effect: end };
        } else if self.train + 1 < FOLDS {
            self.train_on(self.train + 1, evidence)?;
        } else {
            self.stage = Stage::Tell { effect: 0 };
        }
        Ok(())
    }

    /// Tries the model without an active effect, or with a candidate.
    fn try_effect(&mut self, effect: usize) -> Result<(), FactorError> {
        let bit = 1 << effect;
        let active = self.active & bit != 0;
        let (error, found) = self.judge(self.active ^ bit, effect)?;
        let (with, without, found) = if active {
            (self.present, error, self.judge(self.active, effect)?.1)
        } else {
            (error, self.present, found)
        };
        let train = self.train % FOLDS;
        let (held_out, finding) = (self.held_out.get_mut(effect), self.findings.get_mut(effect));
        if let (Some(held_out), Some(finding)) = (held_out, finding) {
            (held_out.with[train], held_out.without[train]) = (with, without);
            *finding = finding.plus(found);
        }
        Ok(())
    }
}

/// The factor of so many columns at the front of a work space.
fn factor<T: Real>(work: &mut [T], columns: usize) -> Result<Factor<T, &mut [T]>, FactorError> {
    let error = FactorError::Length(work.len());
    Factor::in_storage(columns, work.get_mut(..packed_len(columns)).ok_or(error)?)
}
