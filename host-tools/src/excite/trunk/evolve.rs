//! A search without slopes: an evolution strategy whose steps have a size of their own in each direction.
//!
//! Separable CMA-ES (Ros & Hansen 2008) on directions: how far a motion goes is settled by the limits ([`Course::largest`]), so a point
//! and its multiples are the same motion.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::super::search::Supervisor;
use crate::parallel::side_by_side;

/// Motions of a generation, and the better of them that make the next.
const GENERATION: usize = 20;
const PARENTS: usize = GENERATION / 2;
/// The first steps, as a share of a point's length.
const FIRST_STEP: f64 = 0.3;
/// By what a motion grows until it meets a limit, how often at most, and halvings of the last step.
const GROWTH: f64 = 1.4;
const STEPS: usize = 30;
const HALVINGS: usize = 5;

/// What is searched.
pub(super) trait Course: Sync {
    /// Unknowns of a motion.
    fn unknowns(&self) -> usize;
    /// Whether the motion of these unknowns keeps to the limits.
    fn is_within(&self, x: &[f64]) -> bool;
    /// What the motion costs; none if it has no number.
    fn cost(&self, x: &[f64]) -> Option<f64>;

    /// The point times the largest number with which its motion keeps to the limits, nearly; none if there is none.
    fn largest(&self, x: &[f64]) -> Option<Vec<f64>> {
        let sized = |size: f64| -> Vec<f64> { x.iter().map(|x| size * x).collect() };
        let grows = self.is_within(x);
        let (mut size, mut other, mut step) = (1.0, 1.0, 0);
        loop {
            other = if grows {
                other * GROWTH
            } else {
                other / GROWTH
            };
            if self.is_within(&sized(other)) != grows {
                break;
            }
            (size, step) = (other, step + 1);
            if step == STEPS {
                return None;
            }
        }
        let (mut low, mut high): (f64, f64) = if grows { (size, other) } else { (other, size) };
        for _ in 0..HALVINGS {
            let middle = (low * high).sqrt();
            if self.is_within(&sized(middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(sized(low))
    }
}

/// A motion as large as the limits allow.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Candidate {
    pub(super) x: Vec<f64>,
    pub(super) cost: f64,
}

/// How much is searched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Effort {
    /// Random motions, the best of which begins.
    pub(super) starts: usize,
    /// Generations after it.
    pub(super) generations: usize,
}

/// The best motion of a search; the same for the same seed, on any number of processors. None if no random motion is within the limits.
pub(super) fn search(
    course: &impl Course,
    seed: u64,
    effort: Effort,
    supervisor: &dyn Supervisor,
) -> Option<Candidate> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let n = course.unknowns();
    let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
    let evaluate = |x: &Vec<f64>| -> Option<Candidate> {
        if supervisor.stop() {
            return None;
        }
        let x = course.largest(x)?;
        let cost = course.cost(&x)?;
        Some(Candidate { x, cost })
    };
    let of = effort.generations + 1;
    let mut points = |count: usize, at: &dyn Fn(usize, f64) -> f64| -> Vec<Vec<f64>> {
        (0..count)
            .map(|_| (0..n).map(|k| at(k, normal())).collect())
            .collect()
    };
    let starts = points(effort.starts, &|_, z| z);
    let found = side_by_side(&starts, evaluate);
    let mut best = better(found.into_iter().flatten())?;
    supervisor.progress(1, of, Some(best.cost));
    let mut mean = unit(&best.x);
    let mut strategy = Strategy::new(n);
    for generation in 1..=effort.generations {
        let steps: Vec<f64> = strategy.steps();
        let children = points(GENERATION, &|k, z| mean[k] + steps[k] * z);
        let mut ranked: Vec<(usize, Candidate)> = side_by_side(&children, evaluate)
            .into_iter()
            .enumerate()
            .filter_map(|(k, child)| Some((k, child?)))
            .collect();
        if supervisor.stop() || ranked.len() < PARENTS {
            break;
        }
        ranked.sort_by(|a, b| a.1.cost.total_cmp(&b.1.cost).then(a.0.cmp(&b.0)));
        let parents: Vec<&Vec<f64>> = ranked[..PARENTS]
            .iter()
            .map(|(k, _)| &children[*k])
            .collect();
        mean = strategy.next(&mean, &parents);
        if ranked[0].1.cost < best.cost {
            best = ranked.swap_remove(0).1;
        }
        supervisor.progress(generation + 1, of, Some(best.cost));
    }
    Some(best)
}

fn better(candidates: impl Iterator<Item = Candidate>) -> Option<Candidate> {
    candidates.min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// The point of length √n in its direction.
fn unit(x: &[f64]) -> Vec<f64> {
    let length = x
        .iter()
        .map(|x| x * x)
        .sum::<f64>()
        .sqrt()
        .max(f64::MIN_POSITIVE);
    let scale = (x.len() as f64).sqrt() / length;
    x.iter().map(|x| scale * x).collect()
}

/// Sizes of the steps and what they are learnt from, in the terms of Ros & Hansen.
struct Strategy {
    size: f64,
    variance: Vec<f64>,
    path: Vec<f64>,
    size_path: Vec<f64>,
    weights: Vec<f64>,
}

impl Strategy {
    fn new(n: usize) -> Self {
        let raw = |k: usize| (PARENTS as f64 + 0.5).ln() - (k as f64 + 1.0).ln();
        let sum: f64 = (0..PARENTS).map(raw).sum();
        Self {
            size: FIRST_STEP,
            variance: vec![1.0; n],
            path: vec![0.0; n],
            size_path: vec![0.0; n],
            weights: (0..PARENTS).map(|k| raw(k) / sum).collect(),
        }
    }

    fn steps(&self) -> Vec<f64> {
        self.variance.iter().map(|v| self.size * v.sqrt()).collect()
    }

    /// The next mean, from the better ones, best first; learns from how they lie.
    fn next(&mut self, mean: &[f64], parents: &[&Vec<f64>]) -> Vec<f64> {
        let n = mean.len() as f64;
        let worth = 1.0 / self.weights.iter().map(|w| w * w).sum::<f64>();
        let along = (4.0 + worth / n) / (n + 4.0 + 2.0 * worth / n);
        let size_rate = (worth + 2.0) / (n + worth + 5.0);
        let damping = 1.0 + size_rate + 2.0 * (((worth - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0);
        let separable = (n + 2.0) / 3.0;
        let one = (separable * 2.0 / ((n + 1.3).powi(2) + worth)).min(0.5);
        let many = (separable * 2.0 * (worth - 2.0 + 1.0 / worth) / ((n + 2.0).powi(2) + worth))
            .min(1.0 - one);
        let mut next = vec![0.0; mean.len()];
        for k in 0..mean.len() {
            let steps = parents.iter().map(|p| (p[k] - mean[k]) / self.size);
            let steps: Vec<f64> = steps.collect();
            let weighed = |of: &dyn Fn(f64) -> f64| -> f64 {
                steps
                    .iter()
                    .zip(&self.weights)
                    .map(|(s, w)| w * of(*s))
                    .sum()
            };
            let (step, spread) = (weighed(&|s| s), weighed(&|s| s * s));
            next[k] = mean[k] + self.size * step;
            self.size_path[k] = (1.0 - size_rate) * self.size_path[k]
                + (size_rate * (2.0 - size_rate) * worth).sqrt() * step / self.variance[k].sqrt();
            self.path[k] =
                (1.0 - along) * self.path[k] + (along * (2.0 - along) * worth).sqrt() * step;
            self.variance[k] = (1.0 - one - many) * self.variance[k]
                + one * self.path[k] * self.path[k]
                + many * spread;
        }
        let length = self.size_path.iter().map(|x| x * x).sum::<f64>().sqrt();
        let usual = n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));
        self.size *= (size_rate / damping * (length / usual - 1.0)).exp();
        unit(&next)
    }
}
