//! What the excitation makes the motors do: the response of the loop that holds the point.

use nalgebra::DMatrix;
use realfft::num_complex::Complex64;

use super::lines::Signals;
use super::peak;
use crate::spectrum::Foreseen;

/// Excitation to position and to torque at each line of a point: G (1 + K G)⁻¹ and 1 − K G (1 + K G)⁻¹, with K = kp + s kd.
pub(super) struct Swing {
    position: Vec<DMatrix<Complex64>>,
    torque: Vec<DMatrix<Complex64>>,
    omega: Vec<f64>,
}

/// How far, how fast and by what torque the motors swing about the carrier.
pub(super) struct Peaks {
    /// rad or m.
    pub(super) q: Vec<f64>,
    /// rad/s or m/s.
    pub(super) dq: Vec<f64>,
    /// N m: excitation and feedback.
    pub(super) torque: Vec<f64>,
}

impl Swing {
    /// At a point of `seen`; none where the model is singular.
    pub(super) fn new(
        seen: &Foreseen,
        point: usize,
        signals: &Signals,
        gains: &[[f64; 2]],
    ) -> Option<Self> {
        let n = gains.len();
        let (mut position, mut torque, mut omega) = (Vec::new(), Vec::new(), Vec::new());
        for line in 0..signals.lines().len() {
            let own = seen.response(point, line)?;
            let w = seen.omega(line);
            let gain = |i: usize| Complex64::new(gains[i][0], w * gains[i][1]);
            let back = DMatrix::from_fn(n, n, |i, j| gain(i) * own[(i, j)]);
            let one = DMatrix::<Complex64>::identity(n, n);
            let closed = (&one + &back).try_inverse()?;
            position.push(&own * &closed);
            torque.push(&one - &back * &closed);
            omega.push(w);
        }
        Some(Self {
            position,
            torque,
            omega,
        })
    }

    /// Peaks in an experiment with these phases, between the samples too.
    pub(super) fn peaks(&self, signals: &Signals, phases: &[Vec<f64>], experiment: usize) -> Peaks {
        let n = signals.joints();
        let lines = 0..self.omega.len();
        let drives: Vec<Vec<Complex64>> = lines
            .clone()
            .map(|l| {
                let of = |j: usize| signals.coefficient(phases, j, experiment, l);
                (0..n).map(of).collect()
            })
            .collect();
        let between = signals.between_samples();
        let of = |m: &[DMatrix<Complex64>], i: usize, by: &dyn Fn(usize) -> Complex64| {
            let at = |l: usize| {
                let sum: Complex64 = (0..n).map(|j| m[l][(i, j)] * drives[l][j]).sum();
                sum * by(l)
            };
            between * peak(&signals.wave(&lines.clone().map(at).collect::<Vec<_>>()))
        };
        let one = |_| Complex64::from(1.0);
        let slope = |l: usize| Complex64::new(0.0, self.omega[l]);
        Peaks {
            q: (0..n).map(|i| of(&self.position, i, &one)).collect(),
            dq: (0..n).map(|i| of(&self.position, i, &slope)).collect(),
            torque: (0..n).map(|i| of(&self.torque, i, &one)).collect(),
        }
    }

    /// What peaks of random phases are about: so many times the rms.
    pub(super) fn usual_peaks(&self, signals: &Signals, crest: f64) -> Peaks {
        let n = signals.joints();
        let of = |m: &[DMatrix<Complex64>], i: usize, power: i32| {
            let line = |(l, m): (usize, &DMatrix<Complex64>)| {
                let squares =
                    (0..n).map(|j| m[(i, j)].norm_sqr() * signals.amplitude(j, l).powi(2));
                0.5 * squares.sum::<f64>() * self.omega[l].powi(2 * power)
            };
            crest * m.iter().enumerate().map(line).sum::<f64>().sqrt()
        };
        Peaks {
            q: (0..n).map(|i| of(&self.position, i, 0)).collect(),
            dq: (0..n).map(|i| of(&self.position, i, 1)).collect(),
            torque: (0..n).map(|i| of(&self.torque, i, 0)).collect(),
        }
    }
}
