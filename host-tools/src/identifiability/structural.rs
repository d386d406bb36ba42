//! What no motion on this base can tell: the torque's rows in random states.
//!
//! A torque's column at an instant is the derivative of the window column: d/dt \[boundary\] + rate, here with the boundary's
//! derivative by central differences along the motion. Bodies and the effects that are columns of their own joint are
//! analysed; corrections, tilt and loads are derivatives that depend on the model itself.

use nalgebra::DMatrix;
use proprio_core::effect::{JointState, Term};
use proprio_core::inertia::INERTIAL;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::reduction::{Reduction, from_the_left};
use crate::equation::column::Column;
use crate::estimate::fit::LimbFit;

/// Step of the central differences, s.
const STEP: f64 = 1e-5;
/// Share of a column's length that must be its own: far above the differences' error, far below any combination's.
const TOLERANCE: f64 = 1e-6;

/// A joint's motion about an instant: position, velocity, acceleration, and torque and temperature that go with them.
#[derive(Clone, Copy)]
struct Instant {
    q: f64,
    dq: f64,
    ddq: f64,
    tau: f64,
    temperature: f64,
    /// How far the bristles are bent, of their most.
    deflection: f64,
}

impl Instant {
    fn random(random: &mut ChaCha8Rng) -> Self {
        Self {
            q: random.random_range(-3.0..3.0),
            dq: random.random_range(-5.0..5.0),
            ddq: random.random_range(-25.0..25.0),
            tau: random.random_range(-20.0..20.0),
            temperature: random.random_range(20.0..80.0),
            deflection: random.random_range(-1.0..1.0),
        }
    }

    fn at(&self, t: f64) -> [f64; 2] {
        [
            self.q + t * self.dq + 0.5 * t * t * self.ddq,
            self.dq + t * self.ddq,
        ]
    }

    fn state(&self, t: f64) -> JointState<f64> {
        let [q, dq] = self.at(t);
        JointState {
            temperature: self.temperature,
            presliding: t * self.deflection,
            // That of other limbs: of nothing that this one does.
            recoil: [0.0, self.tau * self.deflection],
            ..JointState::reported(q, dq, self.tau)
        }
    }
}

pub(crate) fn of(fit: &LimbFit) -> Reduction {
    let columns = &fit.columns;
    let analysed: Vec<usize> = (0..columns.entries.len())
        .filter(|&k| {
            matches!(
                columns.entries[k].column,
                Column::Inertial(..) | Column::Own { .. } | Column::Coupled { .. }
            )
        })
        .collect();
    let n = columns.joints();
    let (rigid, base) = (
        fit.data.body.loaded(&fit.values),
        fit.data.body.base(&fit.values),
    );
    let width = INERTIAL * n;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    // Rows of all joints: twice as many as columns.
    let states = (2 * analysed.len()).div_ceil(n);
    let mut rows = DMatrix::zeros(states * n, analysed.len());
    for s in 0..states {
        let joints: Vec<Instant> = (0..n).map(|_| Instant::random(&mut random)).collect();
        let motion = |t: f64| -> (Vec<f64>, Vec<f64>) {
            joints
                .iter()
                .map(|joint| <(f64, f64)>::from(joint.at(t)))
                .unzip()
        };
        let regressors = |t: f64| {
            let (q, dq) = motion(t);
            let (mut momentum, mut rate) = (vec![0.0; n * width], vec![0.0; n * width]);
            rigid.regressors(&base, [&q, &dq], Some(&mut momentum), &mut rate, None);
            (momentum, rate)
        };
        let (before, now, after) = (regressors(-STEP), regressors(0.0), regressors(STEP));
        for j in 0..n {
            for (c, &k) in analysed.iter().enumerate() {
                rows[(s * n + j, c)] = match columns.entries[k].column {
                    Column::Inertial(b, p) => {
                        let at = j * width + INERTIAL * b + p;
                        (after.0[at] - before.0[at]) / (2.0 * STEP) + now.1[at]
                    }
                    ref column => {
                        let term = |t: f64| {
                            let states: Vec<_> =
                                joints.iter().map(|joint| joint.state(t)).collect();
                            columns.term(column, j, &states).unwrap_or(Term::zero())
                        };
                        (term(STEP).boundary - term(-STEP).boundary) / (2.0 * STEP) + term(0.0).rate
                    }
                };
            }
        }
    }
    from_the_left(&rows, &analysed, columns.entries.len(), TOLERANCE)
}
