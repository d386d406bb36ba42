//! Slopes by the unknowns: from those by the rows and the constraints back to the series' coefficients.

use nalgebra::DMatrix;

use super::{Evaluation, Problem};
use crate::excite::columns::Term;
use crate::excite::limb::Instant;

impl Problem {
    /// Slopes by the unknowns of the cost, whose slope by the rows is rows · `m`, plus Σ `pushes` · constraints.
    pub(in crate::excite) fn slopes(
        &self,
        of: &Evaluation,
        m: &DMatrix<f64>,
        pushes: &[f64],
        share: f64,
    ) -> Vec<f64> {
        let (n, p) = (self.joints(), self.theta.len());
        // One row's slopes beside each other.
        let by_rows = &self.scale * (&of.rows * m).transpose();
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
                let by_row = by_rows.column(n * s + c);
                for (g, by) in g[p * c..p * (c + 1)].iter_mut().zip(&by_row) {
                    *g = weight * by;
                }
                for (e, column) in self.columns.iter().enumerate() {
                    if column.joint == c {
                        let push = weight * by_row[p + e];
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
    pub(super) fn push_term(
        &self,
        term: &Term,
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
}
