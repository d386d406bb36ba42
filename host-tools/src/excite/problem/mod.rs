//! A design as a function of its unknowns: cost, constraints, and the slopes of both in one pass.
//!
//! Files beside:
//!
//! - `limits`: what a motion must keep to, as constraints that are satisfied where they are not positive

mod limits;
mod slopes;

use nalgebra::{DMatrix, DMatrixView};
use proprio_core::inertia::INERTIAL;

use super::columns::Column;
use super::cost::{Cost, triangle};
use super::fourier::{Basis, Motion};
use super::limb::{Instant, Limb};
use crate::equation::dot::dot;
pub use limits::JointLimits;
pub(super) use limits::Limits;

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

/// Everything at one point; constraints are satisfied where they are not positive.
pub(super) struct Evaluation {
    pub(super) rows: DMatrix<f64>,
    pub(super) constraints: Vec<f64>,
    instants: Vec<Instant>,
    /// Each sample's torque regressor, row after row.
    regressors: Vec<f64>,
    torques: Vec<Vec<f64>>,
    effects: Vec<Vec<super::columns::Term>>,
    distances: Vec<super::clearance::Distances>,
}

impl Problem {
    pub(super) fn joints(&self) -> usize {
        self.limb.joints()
    }

    /// How many unknowns there are.
    pub(super) fn unknowns(&self) -> usize {
        self.joints() * self.basis.modes()
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
        let mut of = Evaluation {
            rows: DMatrix::zeros(0, 0),
            constraints: Vec::with_capacity(self.constraints()),
            instants: Vec::with_capacity(samples),
            regressors: vec![0.0; samples * n * p],
            torques: Vec::with_capacity(samples),
            effects: Vec::with_capacity(samples),
            distances: Vec::with_capacity(samples),
        };
        for s in 0..samples {
            let at = self.instant(x, s);
            let w = &mut of.regressors[n * p * s..n * p * (s + 1)];
            self.limb.regressor(&at, w);
            let rigid: Vec<f64> = (0..n)
                .map(|c| dot(&w[p * c..p * (c + 1)], &self.theta))
                .collect();
            let terms = self.columns.iter();
            let terms = terms.map(|column| self.term(column, &at, &rigid)).collect();
            let distances = self.limits.clearance.distances(self.limb.as_ref(), &at.q);
            self.constrain(&at, w, &rigid, &distances, share, &mut of.constraints);
            of.instants.push(at);
            of.torques.push(rigid);
            of.effects.push(terms);
            of.distances.push(distances);
        }
        of.rows = self.rows(&of);
        of
    }

    /// The weighted rows of the scaled parameters: one product of matrices, which is several times as fast as scalar products one
    /// after another.
    fn rows(&self, of: &Evaluation) -> DMatrix<f64> {
        let (n, p) = (self.joints(), INERTIAL * self.joints());
        let count = n * self.basis.samples();
        let regressors = DMatrixView::from_slice(&of.regressors, p, count);
        let mut rows = self.scale.rows(0, p).transpose() * regressors;
        for (m, mut row) in rows.column_iter_mut().enumerate() {
            let (s, c) = (m / n, m % n);
            for (e, column) in self.columns.iter().enumerate() {
                if column.joint == c {
                    let value = of.effects[s][e].value;
                    for (row, scale) in row.iter_mut().zip(&self.scale.row(p + e)) {
                        *row += value * scale;
                    }
                }
            }
            row *= self.weights[c] * self.repeats.sqrt();
        }
        rows.transpose()
    }

    /// Whether all constraints hold at the samples, the limits times `share` as in [`Self::evaluate`].
    pub(super) fn is_within(&self, x: &[f64], share: f64) -> bool {
        let p = self.theta.len();
        let mut w = vec![0.0; self.joints() * p];
        let mut constraints = Vec::with_capacity(self.per_sample());
        (0..self.basis.samples()).all(|s| {
            let at = self.instant(x, s);
            self.limb.regressor(&at, &mut w);
            let rigid = (0..self.joints()).map(|c| dot(&w[p * c..p * (c + 1)], &self.theta));
            let rigid: Vec<f64> = rigid.collect();
            let distances = self.limits.clearance.distances(self.limb.as_ref(), &at.q);
            constraints.clear();
            self.constrain(&at, &w, &rigid, &distances, share, &mut constraints);
            constraints.iter().all(|c| *c <= 0.0)
        })
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

    /// The cost of an evaluation with the matrix M of its slope.
    pub(super) fn cost(&self, of: &Evaluation, cost: &Cost) -> Option<super::cost::Value> {
        cost.of(&self.triangle(of))
    }

    /// The triangle of an evaluation's rows and of what earlier logs know.
    fn triangle(&self, of: &Evaluation) -> DMatrix<f64> {
        triangle(&of.rows, self.earlier.as_ref())
    }
}

impl Evaluation {
    /// The torque regressor of sample s.
    fn regressor(&self, s: usize) -> &[f64] {
        let size = self.regressors.len() / self.instants.len();
        &self.regressors[size * s..size * (s + 1)]
    }
}
