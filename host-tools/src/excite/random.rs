//! Random motions within the limits: what a design is compared with.

use std::sync::Arc;

use super::setup::Setup;
use super::{
    ExciteError, LimbDesign, Measured, Settings, condition_number, problem::Problem, proof, search,
};
use crate::model::{self, Model};

/// By what a motion grows until it meets a limit, or shrinks until it is within them, and how often at most.
const STEP: f64 = 1.3;
const STEPS: usize = 40;
/// Halvings of the last step.
const HALVINGS: usize = 4;
/// Steps by which a motion is made smaller that is not within the limits between its samples, and how often at most.
const SMALLER: f64 = 0.98;
const SHRUNK: usize = 60;

/// Random Fourier motions of a limb, each as large as the limits allow: the space, the limits and the first guesses are those
/// of [`super::design`], and nothing is searched.
#[derive(Debug)]
pub struct RandomMotions {
    limb: model::Limb,
    problem: Arc<Problem>,
    measured: Measured,
    seed: u64,
    repeats: u32,
}

impl RandomMotions {
    /// Of a limb that moves alone.
    ///
    /// # Errors
    /// As [`super::design`].
    pub fn new(
        model: &Model,
        limb: &model::Limb,
        settings: &Settings,
    ) -> Result<Self, ExciteError> {
        settings.check()?;
        let Setup {
            problem, measured, ..
        } = Setup::new(model, limb, settings, true)?;
        Ok(Self {
            limb: limb.clone(),
            problem: Arc::new(problem),
            measured,
            seed: settings.seed,
            repeats: settings.repeats(),
        })
    }

    /// σ₁ / σ_r of the n-th motion's identifiable inertial columns, scaled as [`super::Measures::condition_number`] is; `None`
    /// if it is not within the limits however small.
    pub fn condition_number(&self, n: u64) -> Option<f64> {
        let x = self.largest(n)?;
        Some(condition_number(&self.measured.kind, &self.problem, &x))
    }

    /// The n-th motion, proved to be within the limits at every instant; `None` if it is not however small.
    pub fn motion(&self, n: u64) -> Option<LimbDesign> {
        let mut x = self.largest(n)?;
        for _ in 0..SHRUNK {
            let motion = self.problem.motion(&x, self.repeats);
            if proof::violations(&self.problem, &motion).is_empty() {
                return Some(LimbDesign {
                    limb: self.limb.name.clone(),
                    joints: self.limb.bodies.clone().collect(),
                    motion,
                    measures: self.measured.of(&self.problem, &x),
                    expected: self.measured.expected(&x),
                    violations: Vec::new(),
                    history: Vec::new(),
                    problem: self.problem.clone(),
                });
            }
            x.iter_mut().for_each(|x| *x *= SMALLER);
        }
        None
    }

    /// The n-th guess, as large as the limits allow at its samples.
    fn largest(&self, n: u64) -> Option<Vec<f64>> {
        let guess = search::guess(&self.problem, self.seed, n);
        let sized = |size: f64| -> Vec<f64> { guess.iter().map(|x| size * x).collect() };
        let within = |size: f64| self.problem.is_within(&sized(size), search::SHARE);
        let grows = within(1.0);
        let (mut size, mut other) = (1.0, 1.0);
        for step in 0..=STEPS {
            if step == STEPS {
                return None;
            }
            other = if grows { size * STEP } else { size / STEP };
            if within(other) != grows {
                break;
            }
            size = other;
        }
        // The larger of the two is beyond the limits, the smaller within.
        let (mut low, mut high) = if grows { (size, other) } else { (other, size) };
        for _ in 0..HALVINGS {
            let middle = (low * high).sqrt();
            if within(middle) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(sized(low))
    }
}
