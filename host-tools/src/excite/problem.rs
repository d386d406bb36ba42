//! A design as a function of its unknowns: cost, constraints, and the slopes of both in one pass.

use nalgebra::DMatrix;
use proprio_core::inertia::INERTIAL;

use super::clearance::Clearance;
use super::columns::Column;
use super::cost::{Cost, triangle};
use super::fourier::{Basis, Motion};
use super::limb::{Instant, Limb};

/// What a joint may do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Least and greatest position, rad (m).
    pub position: [f64; 2],
    /// Greatest speed, rad/s (m/s).
    pub velocity: f64,
    /// Greatest acceleration, rad/s² (m/s²).
    pub acceleration: f64,
    /// Greatest torque, N m (N).
    pub torque: f64,
    /// Greatest mechanical power, W.
    pub power: f64,
}

/// Limits of a limb.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Limits {
    /// Joint by joint.
    pub joints: Vec<JointLimits>,
    /// By how much each inertial and effect parameter may be off, as a share of its value: the torque and power limits hold for
    /// all of them at once.
    pub uncertainty: f64,
    /// What must stay apart.
    pub clearance: Clearance,
    /// By how much, m.
    pub margin: f64,
}

/// What the motors have to give besides moving the bodies: an effect's column and its value.
pub(super) type Known = (Column, f64);

/// A limb's part of a design.
pub(super) struct Problem {
    pub(super) limb: Box<dyn Limb>,
    /// Inertial parameters, ten per body.
    pub(super) theta: Vec<f64>,
    /// The effects whose values are known well enough to foresee the torque.
    pub(super) known: Vec<Known>,
    /// The effects whose parameters are to be found.
    pub(super) columns: Vec<Column>,
    /// From the scaled identifiable parameters to the 10 n + columns of the rows: p × r.
    pub(super) scale: DMatrix<f64>,
    /// What a row of a joint is multiplied by.
    pub(super) weights: Vec<f64>,
    /// How often the period is repeated: as many rows.
    pub(super) repeats: f64,
    /// The triangle of earlier logs in the scaled parameters.
    pub(super) earlier: Option<DMatrix<f64>>,
    pub(super) basis: Basis,
    pub(super) pose: Vec<f64>,
    pub(super) limits: Limits,
}

impl std::fmt::Debug for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Problem")
            .field("joints", &self.joints())
            .field("unknowns", &self.unknowns())
            .finish_non_exhaustive()
    }
}

/// Kinds of constraints of a joint at one instant: both sides of position, velocity, acceleration, torque and power.
const KINDS: usize = 10;
/// Their names.
const NAMES: [&str; 5] = ["position", "velocity", "acceleration", "torque", "power"];
/// The distance by which a clearance is counted, m.
const DISTANCE: f64 = 0.1;

/// Everything at one point; constraints are satisfied where they are not positive.
pub(super) struct Evaluation {
    pub(super) rows: DMatrix<f64>,
    pub(super) constraints: Vec<f64>,
    instants: Vec<Instant>,
    regressors: Vec<Vec<f64>>,
    torques: Vec<Vec<f64>>,
    effects: Vec<Vec<super::columns::Term>>,
    distances: Vec<Vec<super::clearance::Distance>>,
}

impl Problem {
    pub(super) fn joints(&self) -> usize {
        self.limb.joints()
    }

    /// How many unknowns there are.
    pub(super) fn unknowns(&self) -> usize {
        self.joints() * self.basis.modes()
    }

    /// Constraints at one instant.
    fn per_sample(&self) -> usize {
        KINDS * self.joints() + self.limits.clearance.count()
    }

    /// How many constraints there are.
    pub(super) fn constraints(&self) -> usize {
        self.per_sample() * self.basis.samples()
    }

    /// What the n-th constraint limits, and its joint.
    pub(super) fn constraint(&self, n: usize) -> (String, Option<usize>) {
        let n = n % self.per_sample();
        if n < KINDS * self.joints() {
            (NAMES[n % KINDS / 2].to_owned(), Some(n / KINDS))
        } else {
            (self.limits.clearance.name(n - KINDS * self.joints()), None)
        }
    }

    fn instant(&self, x: &[f64], s: usize) -> Instant {
        let mut at = Instant::zero(self.joints());
        let modes = self.basis.modes();
        for j in 0..self.joints() {
            let own = &x[modes * j..modes * (j + 1)];
            [at.q[j], at.dq[j], at.ddq[j]] = self.basis.at(own, self.pose[j], s);
        }
        at
    }

    /// One period of the motion of these unknowns.
    pub(super) fn motion(&self, x: &[f64], repeats: u32) -> Motion {
        let modes = self.basis.modes();
        let series = |j: usize| {
            let own = &x[modes * j..modes * (j + 1)];
            self.basis.series(own, self.pose[j])
        };
        Motion {
            period: self.basis.period,
            repeats,
            joints: (0..self.joints()).map(series).collect(),
        }
    }

    /// Rows and constraints, the latter with all limits but positions' and distances' times `share`, and those drawn in by 1 −
    /// `share` of their range.
    pub(super) fn evaluate(&self, x: &[f64], share: f64) -> Evaluation {
        let (n, p) = (self.joints(), INERTIAL * self.joints());
        let samples = self.basis.samples();
        let r = self.scale.ncols();
        let mut rows = DMatrix::zeros(n * samples, r);
        let mut of = Evaluation {
            rows: DMatrix::zeros(0, 0),
            constraints: Vec::with_capacity(self.constraints()),
            instants: Vec::with_capacity(samples),
            regressors: Vec::with_capacity(samples),
            torques: Vec::with_capacity(samples),
            effects: Vec::with_capacity(samples),
            distances: Vec::with_capacity(samples),
        };
        let times = self.repeats.sqrt();
        for s in 0..samples {
            let at = self.instant(x, s);
            let mut w = vec![0.0; n * p];
            self.limb.regressor(&at, &mut w);
            let rigid: Vec<f64> = (0..n)
                .map(|c| dot(&w[p * c..p * (c + 1)], &self.theta))
                .collect();
            let terms: Vec<_> = self
                .columns
                .iter()
                .map(|column| self.term(column, &at, &rigid))
                .collect();
            for c in 0..n {
                let weight = self.weights[c] * times;
                for k in 0..r {
                    let scale = self.scale.column(k);
                    let scale = scale.as_slice();
                    let mut sum = dot(&w[p * c..p * (c + 1)], &scale[..p]);
                    for (e, column) in self.columns.iter().enumerate() {
                        if column.joint == c {
                            sum += terms[e].value * scale[p + e];
                        }
                    }
                    rows[(n * s + c, k)] = weight * sum;
                }
            }
            let distances = self.limits.clearance.distances(self.limb.as_ref(), &at.q);
            self.constrain(&at, &w, &rigid, &distances, share, &mut of.constraints);
            of.instants.push(at);
            of.regressors.push(w);
            of.torques.push(rigid);
            of.effects.push(terms);
            of.distances.push(distances);
        }
        of.rows = rows;
        of
    }

    /// All constraints at one instant, whatever the basis; W of that instant is `w`.
    pub(super) fn constraints_at(&self, at: &Instant, w: &[f64]) -> Vec<f64> {
        let p = self.theta.len();
        let rigid = (0..self.joints()).map(|c| dot(&w[p * c..p * (c + 1)], &self.theta));
        let rigid: Vec<f64> = rigid.collect();
        let distances = self.limits.clearance.distances(self.limb.as_ref(), &at.q);
        let mut constraints = Vec::with_capacity(self.per_sample());
        self.constrain(at, w, &rigid, &distances, 1.0, &mut constraints);
        constraints
    }

    /// The torque foreseen at an instant, N m.
    pub(super) fn foreseen(&self, at: &Instant) -> Vec<f64> {
        let (n, p) = (self.joints(), self.theta.len());
        let mut w = vec![0.0; n * p];
        self.limb.regressor(at, &mut w);
        let rigid: Vec<f64> = (0..n)
            .map(|c| dot(&w[p * c..p * (c + 1)], &self.theta))
            .collect();
        (0..n).map(|c| self.torque(at, &w, &rigid, c)[0]).collect()
    }

    /// Rows of the inertial columns alone in another scale, of one period, not weighted.
    pub(super) fn inertial_rows(&self, x: &[f64], scale: &DMatrix<f64>) -> DMatrix<f64> {
        let (n, p) = (self.joints(), self.theta.len());
        let mut rows = DMatrix::zeros(n * self.basis.samples(), p);
        let mut w = vec![0.0; n * p];
        for s in 0..self.basis.samples() {
            self.limb.regressor(&self.instant(x, s), &mut w);
            for c in 0..n {
                for k in 0..p {
                    rows[(n * s + c, k)] = w[p * c + k];
                }
            }
        }
        rows * scale
    }

    fn term(&self, column: &Column, at: &Instant, rigid: &[f64]) -> super::columns::Term {
        let j = column.joint;
        column.term([at.q[j], at.dq[j], at.ddq[j]], rigid[j])
    }

    /// Torque foreseen at joint c and what it may be off by, N m.
    pub(super) fn torque(&self, at: &Instant, w: &[f64], rigid: &[f64], c: usize) -> [f64; 2] {
        let p = self.theta.len();
        let row = &w[p * c..p * (c + 1)];
        let mut torque = rigid[c];
        let mut size: f64 = row
            .iter()
            .zip(&self.theta)
            .map(|(w, t)| (w * t).abs())
            .sum();
        for (column, value) in self.known.iter().filter(|(column, _)| column.joint == c) {
            let part = value * self.term(column, at, rigid).value;
            torque += part;
            size += part.abs();
        }
        [torque, self.limits.uncertainty * size]
    }

    fn constrain(
        &self,
        at: &Instant,
        w: &[f64],
        rigid: &[f64],
        distances: &[super::clearance::Distance],
        share: f64,
        to: &mut Vec<f64>,
    ) {
        for (c, limit) in self.limits.joints.iter().enumerate() {
            let [lower, upper] = limit.position;
            let range = (upper - lower).max(1e-9);
            let inset = (1.0 - share) * range / 2.0;
            let [torque, off] = self.torque(at, w, rigid, c);
            let both = |value: f64, most: f64| {
                [value / (most * share) - 1.0, -value / (most * share) - 1.0]
            };
            to.push((at.q[c] - upper + inset) / range);
            to.push((lower + inset - at.q[c]) / range);
            to.extend(both(at.dq[c], limit.velocity));
            to.extend(both(at.ddq[c], limit.acceleration));
            let most = limit.torque * share;
            to.extend([(torque + off) / most - 1.0, (off - torque) / most - 1.0]);
            let (power, off) = (torque * at.dq[c], off * at.dq[c].abs());
            let most = limit.power * share;
            to.extend([(power + off) / most - 1.0, (off - power) / most - 1.0]);
        }
        let margin = self.limits.margin + (1.0 - share) * DISTANCE;
        to.extend(distances.iter().map(|d| (margin - d.value) / DISTANCE));
    }

    /// The cost of an evaluation with the matrix M of its slope.
    pub(super) fn cost(&self, of: &Evaluation, cost: &Cost) -> Option<super::cost::Value> {
        cost.of(&triangle(&of.rows, self.earlier.as_ref()))
    }

    /// Slopes by the unknowns of the cost, whose slope by the rows is rows · `m`, plus Σ `pushes` · constraints.
    pub(super) fn slopes(
        &self,
        of: &Evaluation,
        m: &DMatrix<f64>,
        pushes: &[f64],
        share: f64,
    ) -> Vec<f64> {
        let (n, p) = (self.joints(), self.theta.len());
        let by_rows = (&of.rows * m) * self.scale.transpose();
        let times = self.repeats.sqrt();
        let modes = self.basis.modes();
        let mut slopes = vec![0.0; self.unknowns()];
        let mut by = Instant::zero(n);
        let mut g = vec![0.0; n * p];
        for s in 0..self.basis.samples() {
            by.clear();
            let at = &of.instants[s];
            for c in 0..n {
                let weight = self.weights[c] * times;
                for k in 0..p {
                    g[p * c + k] = weight * by_rows[(n * s + c, k)];
                }
                for (e, column) in self.columns.iter().enumerate() {
                    if column.joint == c {
                        let push = weight * by_rows[(n * s + c, p + e)];
                        self.push_term(&of.effects[s][e], push, c, &mut by, &mut g);
                    }
                }
            }
            let own = &pushes[self.per_sample() * s..self.per_sample() * (s + 1)];
            self.push_constraints(of, s, own, share, &mut by, &mut g);
            self.limb.pull_back(at, &g, &mut by);
            for j in 0..n {
                let own = &mut slopes[modes * j..modes * (j + 1)];
                self.basis.pull_back(s, [by.q[j], by.dq[j], by.ddq[j]], own);
            }
        }
        slopes
    }

    /// Adds the slopes of `push` times an effect's torque at joint c.
    fn push_term(
        &self,
        term: &super::columns::Term,
        push: f64,
        c: usize,
        by: &mut Instant,
        g: &mut [f64],
    ) {
        by.q[c] += push * term.by_q;
        by.dq[c] += push * term.by_dq;
        by.ddq[c] += push * term.by_ddq;
        if term.by_torque != 0.0 {
            let p = self.theta.len();
            for (g, theta) in g[p * c..p * (c + 1)].iter_mut().zip(&self.theta) {
                *g += push * term.by_torque * theta;
            }
        }
    }

    fn push_constraints(
        &self,
        of: &Evaluation,
        s: usize,
        pushes: &[f64],
        share: f64,
        by: &mut Instant,
        g: &mut [f64],
    ) {
        let p = self.theta.len();
        let at = &of.instants[s];
        for (c, limit) in self.limits.joints.iter().enumerate() {
            let push = &pushes[KINDS * c..KINDS * (c + 1)];
            if push.iter().all(|x| *x == 0.0) {
                continue;
            }
            let range = (limit.position[1] - limit.position[0]).max(1e-9);
            by.q[c] += (push[0] - push[1]) / range;
            by.dq[c] += (push[2] - push[3]) / (limit.velocity * share);
            by.ddq[c] += (push[4] - push[5]) / (limit.acceleration * share);
            let [torque, off] = self.torque(at, &of.regressors[s], &of.torques[s], c);
            let (most, dq) = (limit.torque * share, at.dq[c]);
            let strongest = limit.power * share;
            by.dq[c] += ((push[8] - push[9]) * torque + (push[8] + push[9]) * off * dq.signum())
                / strongest;
            let on_torque = (push[6] - push[7]) / most + (push[8] - push[9]) * dq / strongest;
            let on_size = self.limits.uncertainty
                * ((push[6] + push[7]) / most + (push[8] + push[9]) * dq.abs() / strongest);
            let row = &of.regressors[s][p * c..p * (c + 1)];
            for ((g, w), theta) in g[p * c..p * (c + 1)].iter_mut().zip(row).zip(&self.theta) {
                *g += theta * (on_torque + on_size * (w * theta).signum());
            }
            for (column, value) in self.known.iter().filter(|(column, _)| column.joint == c) {
                let term = self.term(column, at, &of.torques[s]);
                let sign = (value * term.value).signum();
                self.push_term(&term, value * (on_torque + on_size * sign), c, by, g);
            }
        }
        let own = &pushes[KINDS * self.joints()..];
        for (push, distance) in own.iter().zip(&of.distances[s]) {
            if *push != 0.0 {
                for (by, slope) in by.q.iter_mut().zip(&distance.slopes) {
                    *by -= push * slope / DISTANCE;
                }
            }
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
