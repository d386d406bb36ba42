//! Least squares over a limb's parameters, whatever its columns, with every body one that could exist and every effect
//! within its bounds.
//!
//! The cost is that of [`proprio_core::consistent`]: the data's sum of squares in units of each joint's noise, per body the
//! prior that is infinite at the edge of what is physical, per effect its own prior. It is convex. Each Newton step
//! expands the bodies' priors and minimises the quadratic that results within the effects' bounds (an active set: Nocedal &
//! Wright 2006, §16.5); a step that leaves the physical bodies or raises the cost is halved. The core's solver is for a
//! limb whose columns are each joint's own; here a column may be felt by every joint (elasticity, tilt, load).

use nalgebra::{DMatrix, DVector};
use proprio_core::inertia::{BodyFactor, INERTIAL, InertialParameters};

use crate::dot::dot;
use crate::factor::HeapFactor;

/// Newton steps that a solution may take.
const MAX_ITERATIONS: usize = 50;
/// How often a step may be halved.
const MAX_HALVINGS: i32 = 40;
/// A step that moves no parameter by more than this many standard deviations is the last.
const CONVERGED: f64 = 1e-6;

/// What is known of a parameter that belongs to no body before any data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounded {
    /// Expected value.
    pub mean: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Least value that it may take.
    pub lower: f64,
    /// Greatest.
    pub upper: f64,
}

/// A limb's problem: the bodies' parameters first, then all others.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Each body by the CAD, and its relative uncertainty.
    pub bodies: Vec<(InertialParameters<f64>, f64)>,
    /// All parameters that are no body's.
    pub others: Vec<Bounded>,
    /// Rows of the data in units of the noise: the parameters, then the right-hand side.
    pub data: DMatrix<f64>,
    /// Whether bodies may be unphysical: then their prior is its expansion about the CAD.
    pub free: bool,
}

/// A fit.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The bodies' parameters, then all others.
    pub theta: DVector<f64>,
    /// R of the cost's expansion there, RᵀR = half the Hessian: (RᵀR)⁻¹ is the covariance for independent residuals.
    pub factor: DMatrix<f64>,
    /// Which parameters are held at a bound.
    pub held: Vec<bool>,
    #[cfg(test)]
    iterations: usize,
}

impl Solution {
    /// Standard deviations if residuals are independent.
    pub fn std(&self) -> DVector<f64> {
        let inverse = inverse(&self.factor);
        DVector::from_fn(inverse.nrows(), |k, _| inverse.row(k).norm())
    }
}

/// The inverse of an upper triangle; every parameter has a prior, so that it exists.
pub fn inverse(factor: &DMatrix<f64>) -> DMatrix<f64> {
    let n = factor.nrows();
    factor
        .solve_upper_triangular(&DMatrix::identity(n, n))
        .unwrap_or_else(|| DMatrix::from_element(n, n, f64::NAN))
}

/// The triangle of a matrix of any number of rows: as many rows as columns.
pub fn triangle(rows: DMatrix<f64>) -> DMatrix<f64> {
    let n = rows.ncols();
    let m = rows.nrows().max(n);
    let r = rows.resize_vertically(m, 0.0).qr().r();
    r.rows(0, n).into_owned()
}

impl Problem {
    fn parameters(&self) -> usize {
        INERTIAL * self.bodies.len() + self.others.len()
    }

    /// The same prior without data.
    pub fn without_data(&self) -> Self {
        Self {
            data: DMatrix::zeros(0, self.parameters() + 1),
            ..self.clone()
        }
    }

    /// The CAD's bodies, and what the others are taken to be.
    pub fn start(&self) -> DVector<f64> {
        let bodies = self
            .bodies
            .iter()
            .flat_map(|(cad, _)| cad.0.iter().copied());
        let others = self.others.iter().map(|o| o.mean.max(o.lower).min(o.upper));
        DVector::from_vec(bodies.chain(others).collect())
    }

    /// The cost; `None` where a body is not physical.
    pub fn cost(&self, theta: &DVector<f64>) -> Option<f64> {
        let n = self.parameters();
        let misfit = self.data.columns(0, n) * theta - self.data.column(n);
        let mut cost = misfit.norm_squared();
        for (b, (cad, relative)) in self.bodies.iter().enumerate() {
            let body = body(theta, b);
            cost += if self.free {
                cad.prior(*relative)?.sum_of_squares(body.0.as_slice())
            } else {
                body.divergence(cad)? * 2.0 / (relative * relative)
            };
        }
        for (k, other) in self.others.iter().enumerate() {
            cost += ((theta[INERTIAL * self.bodies.len() + k] - other.mean) / other.std).powi(2);
        }
        Some(cost)
    }

    /// R and z of the prior expanded about θ, stacked under nothing.
    fn prior_rows(&self, theta: &DVector<f64>) -> Option<DMatrix<f64>> {
        let n = self.parameters();
        let mut rows = DMatrix::zeros(n, n + 1);
        for b in 0..self.bodies.len() {
            let expanded = self.body_prior(theta, b)?;
            for k in 0..INERTIAL {
                let Some((z, r)) = expanded.row(k).split_last() else {
                    continue;
                };
                for (c, x) in r.iter().enumerate() {
                    rows[(INERTIAL * b + k, INERTIAL * b + k + c)] = *x;
                }
                rows[(INERTIAL * b + k, n)] = *z;
            }
        }
        for (k, other) in self.others.iter().enumerate() {
            let at = INERTIAL * self.bodies.len() + k;
            rows[(at, at)] = 1.0 / other.std;
            rows[(at, n)] = other.mean / other.std;
        }
        Some(rows)
    }

    /// The prior's rows about θ without their right-hand side: times their transpose, the prior's information.
    pub fn prior_information(&self, theta: &DVector<f64>) -> DMatrix<f64> {
        let n = self.parameters();
        let rows = self
            .prior_rows(theta)
            .unwrap_or_else(|| DMatrix::zeros(n, n + 1));
        rows.columns(0, n).into_owned()
    }

    /// A root S of the prior's covariance S Sᵀ as the prior looks from θ: a body twice as heavy is known half as well.
    pub fn prior_root(&self, theta: &DVector<f64>) -> DMatrix<f64> {
        inverse(&self.prior_information(theta))
    }

    /// R and z of all rows, the prior expanded about θ.
    pub fn expanded(&self, theta: &DVector<f64>) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let n = self.parameters();
        let r = self.expand(&self.fixed(), theta)?.dense();
        Some((
            r.view((0, 0), (n, n)).into_owned(),
            r.view((0, n), (n, 1)).column(0).into_owned(),
        ))
    }

    /// The data and what is known of the effects: no step changes them.
    fn fixed(&self) -> HeapFactor {
        let (n, bodies) = (self.parameters(), INERTIAL * self.bodies.len());
        let mut factor = HeapFactor::new(n);
        // Where the last number lies in the columns up to each: data that are a triangle already stay as they are.
        let mut last = 0;
        let reach: Vec<usize> = (self.data.column_iter())
            .map(|column| {
                let own = column.iter().rposition(|x| *x != 0.0);
                last = last.max(own.map_or(0, |row| row + 1));
                last
            })
            .collect();
        factor.reflect(self.data.transpose().as_mut_slice(), &|k| reach[k]);
        let mut rows = vec![0.0; self.others.len() * (n + 1)];
        for (k, (row, other)) in rows.chunks_exact_mut(n + 1).zip(&self.others).enumerate() {
            row[bodies + k] = 1.0 / other.std;
            row[n] = other.mean / other.std;
        }
        factor.reflect(&mut rows, &|k| (k + 1).saturating_sub(bodies));
        factor
    }

    /// The same with the bodies' prior expanded about θ.
    fn expand(&self, fixed: &HeapFactor, theta: &DVector<f64>) -> Option<HeapFactor> {
        let width = self.parameters() + 1;
        let mut rows = vec![0.0; INERTIAL * self.bodies.len() * width];
        for (b, own) in rows.chunks_exact_mut(INERTIAL * width).enumerate() {
            let expanded = self.body_prior(theta, b)?;
            for (k, row) in own.chunks_exact_mut(width).enumerate() {
                if let Some((z, r)) = expanded.row(k).split_last() {
                    let first = INERTIAL * b + k;
                    row[first..first + r.len()].copy_from_slice(r);
                    row[width - 1] = *z;
                }
            }
        }
        let mut factor = fixed.clone();
        factor.reflect(&mut rows, &|k| k + 1);
        Some(factor)
    }

    /// A body's prior, expanded about θ where it is no quadratic.
    fn body_prior(&self, theta: &DVector<f64>, b: usize) -> Option<BodyFactor<f64>> {
        let (cad, relative) = &self.bodies[b];
        if self.free {
            cad.prior(*relative)
        } else {
            body(theta, b).divergence_near(cad, *relative)
        }
    }

    fn bounds(&self) -> Vec<[f64; 2]> {
        let unbounded = [f64::NEG_INFINITY, f64::INFINITY];
        let bodies = std::iter::repeat_n(unbounded, INERTIAL * self.bodies.len());
        let others = self.others.iter().map(|o| [o.lower, o.upper]);
        bodies.chain(others).collect()
    }

    /// The minimum; `None` if the CAD is not physical or a number is not finite.
    pub fn solve(&self) -> Option<Solution> {
        self.solve_from(&self.start())
    }

    /// The same, looked for from `start`, which may be near: there is one minimum. A start that is not possible is not used.
    pub fn solve_from(&self, start: &DVector<f64>) -> Option<Solution> {
        let minimum = self.minimum(start)?;
        let expanded = self.expand(&minimum.fixed, &minimum.theta)?.dense();
        let n = minimum.theta.len();
        Some(Solution {
            factor: expanded.view((0, 0), (n, n)).into_owned(),
            theta: minimum.theta,
            held: minimum.held,
            #[cfg(test)]
            iterations: minimum.iterations,
        })
    }

    /// Where that is, and nothing of how surely: an expansion less.
    pub fn theta_from(&self, start: &DVector<f64>) -> Option<DVector<f64>> {
        Some(self.minimum(start)?.theta)
    }

    fn minimum(&self, start: &DVector<f64>) -> Option<Minimum> {
        let bounds = self.bounds();
        let inside =
            (start.iter().zip(&bounds)).all(|(x, [lower, upper])| x >= lower && x <= upper);
        let near = inside.then(|| Some((start.clone(), self.cost(start)?)));
        let (mut theta, mut cost) = match near.flatten() {
            Some(near) => near,
            None => (self.start(), self.cost(&self.start())?),
        };
        let fixed = self.fixed();
        let mut held = vec![false; theta.len()];
        let (mut iterations, mut done) = (0, false);
        while !done && iterations < MAX_ITERATIONS {
            let expanded = self.expand(&fixed, &theta)?;
            let (target, at_bound) = within(&expanded, &theta, &bounds);
            let arrived = is_near(&expanded, (&target - &theta).as_slice());
            let mut falls = false;
            for halvings in 0..MAX_HALVINGS {
                let trial = &theta + (&target - &theta) * 0.5f64.powi(halvings);
                // So short a step lowers the cost by less than the cost is rounded: the expansion knows better. A longer
                // one that leaves the cost as it is would be taken for ever, to and fro.
                let better = |there: &f64| arrived || *there < cost;
                if let Some(there) = self.cost(&trial).filter(better) {
                    // A halved step does not reach the bounds.
                    if halvings == 0 {
                        held.clone_from(&at_bound);
                    }
                    (theta, cost, falls) = (trial, there, true);
                    break;
                }
            }
            if !falls {
                held = at_bound;
            }
            iterations += 1;
            done = arrived || !falls;
        }
        theta.iter().all(|x| x.is_finite()).then_some(Minimum {
            theta,
            held,
            fixed,
            #[cfg(test)]
            iterations,
        })
    }
}

/// Where the cost is least: the point, which parameters are held at a bound, and what no step has changed.
struct Minimum {
    theta: DVector<f64>,
    held: Vec<bool>,
    fixed: HeapFactor,
    #[cfg(test)]
    iterations: usize,
}

/// Whether a step moves no parameter by as much as [`CONVERGED`] of its standard deviation.
fn is_near(factor: &HeapFactor, step: &[f64]) -> bool {
    let n = factor.columns();
    // ‖R step‖ is the longest that any parameter moves; the last one's standard deviation is 1/R there.
    let moved = |k: usize| {
        let row = &factor.row(k)[..n - k];
        dot(row, &step[k..])
    };
    let longest: f64 = (0..n).map(|k| moved(k).powi(2)).sum();
    if longest.sqrt() < CONVERGED {
        return true;
    }
    if n > 0 && moved(n - 1).abs() >= CONVERGED {
        return false;
    }
    let dense = factor.dense();
    let inverse = inverse(&dense.view((0, 0), (n, n)).into_owned());
    (0..n).all(|k| (step[k] / inverse.row(k).norm()).abs() < CONVERGED)
}

/// Body b of θ.
pub fn body(theta: &DVector<f64>, b: usize) -> InertialParameters<f64> {
    InertialParameters(theta.fixed_rows::<INERTIAL>(INERTIAL * b).into_owned())
}

/// The minimum of ‖R x − z‖² within bounds, from a point within them, and which entries are at one.
fn within(
    factor: &HeapFactor,
    start: &DVector<f64>,
    bounds: &[[f64; 2]],
) -> (DVector<f64>, Vec<bool>) {
    let n = start.len();
    let mut x = start.clone();
    let mut held: Vec<bool> = (0..n)
        .map(|k| x[k] <= bounds[k][0] || x[k] >= bounds[k][1])
        .collect();
    // Each round adds or releases one; a convex problem of n bounds ends long before.
    for _ in 0..20 * n {
        let target = solve_free(factor, &x, &held);
        let mut share = 1.0;
        let mut blocking = None;
        for k in (0..n).filter(|&k| !held[k]) {
            let step = target[k] - x[k];
            let bound = if step < 0.0 {
                bounds[k][0]
            } else {
                bounds[k][1]
            };
            if step != 0.0 && (bound - x[k]) / step < share {
                share = ((bound - x[k]) / step).max(0.0);
                blocking = Some((k, bound));
            }
        }
        x += (&target - &x) * share;
        if let Some((k, bound)) = blocking {
            (x[k], held[k]) = (bound, true);
            continue;
        }
        if !held.contains(&true) {
            break;
        }
        // Half the gradient: where the cost falls inwards, a bound lets go.
        let slope = factor.slope(x.as_slice());
        let length = |k: usize| {
            let column = (0..=k).map(|row| factor.row(row)[k - row].powi(2));
            column.sum::<f64>().sqrt()
        };
        let worst = (0..n)
            .filter(|&k| held[k] && bounds[k][0] < bounds[k][1])
            .map(|k| {
                let inwards = if x[k] > bounds[k][0] {
                    -slope[k]
                } else {
                    slope[k]
                };
                (k, inwards / length(k))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match worst {
            Some((k, inwards)) if inwards < -1e-9 => held[k] = false,
            _ => break,
        }
    }
    (x, held)
}

/// The least-squares solution over the entries that are not held.
fn solve_free(factor: &HeapFactor, x: &DVector<f64>, held: &[bool]) -> DVector<f64> {
    let n = x.len();
    let mut target = x.clone();
    // Before the first that is held the triangle stays as it is.
    let first = held.iter().position(|held| *held).unwrap_or(n);
    let free: Vec<usize> = (first..n).filter(|&k| !held[k]).collect();
    let (f, count) = (free.len(), n - first);
    let mut rows = vec![0.0; count * (f + 1)];
    for (row, k) in rows.chunks_exact_mut(f + 1).zip(first..n) {
        let from = factor.row(k);
        let known = (k..n).filter(|c| held[*c]);
        row[f] = from[n - k] - known.map(|c| from[c - k] * x[c]).sum::<f64>();
        for (to, &c) in row.iter_mut().zip(&free) {
            *to = c.checked_sub(k).map_or(0.0, |at| from[at]);
        }
    }
    let mut reduced = HeapFactor::new(f);
    reduced.reflect(&mut rows, &|c| free.get(c).map_or(count, |k| k + 1 - first));
    let mut solution = vec![0.0; f];
    reduced.solve_before(f, &mut solution);
    // Nothing determines what is not finite: it stays.
    if solution.iter().all(|x| x.is_finite()) {
        free.iter()
            .zip(solution)
            .for_each(|(&k, value)| target[k] = value);
    }
    factor.solve_before(first, target.as_mut_slice());
    target
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use proptest::prelude::*;

    fn cad() -> InertialParameters<f64> {
        InertialParameters::from_com(
            1.0,
            Vector3::new(0.01, -0.02, 0.05),
            Matrix3::from_diagonal(&Vector3::new(0.01, 0.012, 0.008)),
        )
    }

    fn problem(numbers: &[f64], torque: f64) -> Problem {
        let n = INERTIAL + 2;
        let rows = numbers.len() / n;
        let data = DMatrix::from_fn(rows, n + 1, |r, c| {
            if c < n {
                numbers[r * n + c]
            } else {
                torque * numbers[r * n]
            }
        });
        let other = Bounded {
            mean: 0.1,
            std: 1.0,
            lower: 0.0,
            upper: 0.5,
        };
        Problem {
            bodies: vec![(cad(), 0.1)],
            others: vec![other; 2],
            data,
            free: false,
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// Whatever the data ask for, bodies exist, bounds hold, and no feasible neighbour is better.
        #[test]
        fn the_minimum_is_physical_and_a_minimum(
            numbers in prop::collection::vec(-3.0..3.0f64, 12 * 6),
            torque in -50.0..50.0f64,
            directions in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 12), 8),
        ) {
            let problem = problem(&numbers, torque);
            let solution = problem.solve().unwrap();
            prop_assert!(body(&solution.theta, 0).is_physical());
            prop_assert!(solution.iterations < MAX_ITERATIONS);
            for k in INERTIAL..INERTIAL + 2 {
                prop_assert!((0.0..=0.5).contains(&solution.theta[k]));
            }
            let cost = problem.cost(&solution.theta).unwrap();
            let std = solution.std();
            for direction in directions {
                let step = DVector::from_vec(direction).component_mul(&std) * 1e-2;
                let mut there = &solution.theta + step;
                for k in INERTIAL..INERTIAL + 2 {
                    there[k] = there[k].clamp(0.0, 0.5);
                }
                if let Some(other) = problem.cost(&there) {
                    prop_assert!(other >= cost - 1e-9 * (1.0 + cost), "{other} < {cost}");
                }
            }
        }

        /// Where nothing is at a bound and priors are weak against good data, the answer is what made the data.
        #[test]
        fn data_that_tell_everything_are_believed(
            numbers in prop::collection::vec(-3.0..3.0f64, 12 * 40),
            friction in 0.05..0.45f64,
        ) {
            let mut problem = problem(&numbers, 0.0);
            let mut truth = problem.start();
            truth[0] *= 1.05;
            truth[INERTIAL] = friction;
            problem.data *= 1e4;
            let n = truth.len();
            let right = problem.data.columns(0, n) * &truth;
            problem.data.set_column(n, &right);
            let solution = problem.solve().unwrap();
            prop_assert!((&solution.theta - &truth).amax() < 1e-4);
        }
    }
}
