//! Bodies that the data carry far from the CAD's.
//!
//! A prior that the data contradict biases a body's value and makes its error too small. Such a body is released: its uncertainty is taken to be what makes its
//! distance a usual one (the ratio of Birge, Phys. Rev. 40, 1932).

use crate::bounded::{Problem, Solution, body, inverse};
use proprio_core::inertia::INERTIAL;

/// Squared distance from the CAD, in units of its uncertainty, beyond which a body is not the one that is stated: 99 % of all bodies with the
/// stated uncertainty are nearer (χ² of ten degrees of freedom).
pub const FARTHEST: f64 = 23.2;
/// Times that bodies are released, or held nearer: one that is moves the others.
pub const ROUNDS: usize = 5;

impl Problem {
    /// Squared distance of body b from the CAD's, in units of its uncertainty.
    pub fn distance(&self, solution: &Solution, b: usize) -> f64 {
        let (cad, relative) = &self.bodies[b];
        let body = body(&solution.theta, b);
        (body.divergence(cad)).map_or(0.0, |d| d * 2.0 / (relative * relative))
    }

    /// Whether any body is farther from the CAD's than bodies are.
    pub fn has_far_body(&self, solution: &Solution) -> bool {
        (0..self.bodies.len()).any(|b| self.distance(solution, b) > FARTHEST)
    }

    /// Releases those bodies that are farther from the CAD's than bodies are. Whether there is one.
    pub fn release(&mut self, solution: &Solution) -> bool {
        let mut far = false;
        for b in 0..self.bodies.len() {
            let distance = self.distance(solution, b);
            if distance > FARTHEST {
                self.bodies[b].1 *= (distance / self.told(solution, b).max(1.0)).sqrt();
                far = true;
            }
        }
        far
    }

    /// How many of body b's numbers the data tell: those whose prior they narrow.
    fn told(&self, solution: &Solution, b: usize) -> f64 {
        let prior = self.prior_information(&solution.theta);
        let own = INERTIAL * b;
        let covariance = inverse(&solution.factor);
        let open = prior.view((own, own), (INERTIAL, INERTIAL)) * covariance.rows(own, INERTIAL);
        INERTIAL as f64 - open.norm_squared()
    }
}
