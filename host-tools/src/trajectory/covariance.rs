//! How surely a joint's state is known: its covariance, symmetric, so that the entries on and above the diagonal are all there is.

use super::State;

/// Rows of the entries on and above the diagonal, one after the other: 00 01 02 03 11 12 13 22 23 33.
#[derive(Clone, Copy)]
pub(super) struct Covariance([f64; 10]);

impl Covariance {
    pub(super) fn diagonal(variance: f64) -> Self {
        let v = variance;
        Self([v, 0.0, 0.0, 0.0, v, 0.0, 0.0, v, 0.0, v])
    }

    /// After a time h without a measurement: F P Fᵀ + Q with F the motion of constant jerk and Q what white snap of this intensity adds,
    /// ∫ g gᵀ dt with g the motion after a unit of jerk.
    pub(super) fn moved_on(&self, h: f64, intensity: f64) -> Self {
        // A position, a velocity and an acceleration after that time (`moved`, entry by entry).
        let position = |[q, dq, ddq, jerk]: State| q + h * (dq + h * (ddq / 2.0 + h * jerk / 6.0));
        let velocity = |[dq, ddq, jerk]: [f64; 3]| dq + h * (ddq + h * jerk / 2.0);
        let acceleration = |[ddq, jerk]: [f64; 2]| ddq + h * jerk;
        let [p00, p01, p02, p03, p11, p12, p13, p22, p23, p33] = self.0;
        // F P: of column k the rows down to the diagonal.
        let a00 = position([p00, p01, p02, p03]);
        let (a01, a11) = (position([p01, p11, p12, p13]), velocity([p11, p12, p13]));
        let (a02, a12) = (position([p02, p12, p22, p23]), velocity([p12, p22, p23]));
        let (a03, a13) = (position([p03, p13, p23, p33]), velocity([p13, p23, p33]));
        let (a22, a23) = (acceleration([p22, p23]), acceleration([p23, p33]));
        let mut next = [
            position([a00, a01, a02, a03]),
            velocity([a01, a02, a03]),
            acceleration([a02, a03]),
            a03,
            velocity([a11, a12, a13]),
            acceleration([a12, a13]),
            a13,
            acceleration([a22, a23]),
            a23,
            p33,
        ];
        let (q, h2) = (intensity * h, h * h);
        let (h3, h4) = (h * h2, h2 * h2);
        let noise = [
            h2 * h4 / 252.0,
            h * h4 / 72.0,
            h4 / 30.0,
            h3 / 24.0,
            h4 / 20.0,
            h3 / 8.0,
            h2 / 6.0,
            h2 / 3.0,
            h / 2.0,
            1.0,
        ];
        (next.iter_mut().zip(noise)).for_each(|(x, noise)| *x += q * noise);
        Self(next)
    }

    /// Adds to the acceleration's variance.
    pub(super) fn add_acceleration(&mut self, variance: f64) {
        self.0[7] += variance;
    }

    /// Takes in a measurement of entry n with this noise; its gain, and the variance of its innovation.
    pub(super) fn observed(&mut self, n: usize, noise: f64) -> (State, f64) {
        let column = self.column(n);
        let variance = column[n] + noise;
        let gain = column.map(|c| c / variance);
        let mut at = 0;
        for i in 0..4 {
            for j in i..4 {
                self.0[at] -= gain[i] * column[j];
                at += 1;
            }
        }
        (gain, variance)
    }

    pub(super) fn times(&self, x: &State) -> State {
        std::array::from_fn(|i| self.column(i).iter().zip(x).map(|(p, x)| p * x).sum())
    }

    /// A column, or a row.
    fn column(&self, n: usize) -> State {
        let p = &self.0;
        match n {
            0 => [p[0], p[1], p[2], p[3]],
            1 => [p[1], p[4], p[5], p[6]],
            2 => [p[2], p[5], p[7], p[8]],
            _ => [p[3], p[6], p[8], p[9]],
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Vector4};

    use super::*;
    use crate::trajectory::moved;

    fn whole(covariance: &Covariance) -> Matrix4<f64> {
        Matrix4::from_fn(|i, j| covariance.column(j)[i])
    }

    /// Beside matrices: F P Fᵀ + Q, and P − P h hᵀ P / (hᵀ P h + r).
    #[test]
    fn what_moves_on_and_what_is_told_is_that_of_matrices() {
        let h = 0.3;
        let f = Matrix4::from_columns(&std::array::from_fn::<_, 4, _>(|j| {
            let unit: State = std::array::from_fn(|i| f64::from(u8::from(i == j)));
            Vector4::from(moved(&unit, h))
        }));
        let mut own = Covariance::diagonal(2.0);
        own.add_acceleration(0.5);
        let mut p = Matrix4::from_diagonal(&Vector4::new(2.0, 2.0, 2.5, 2.0));
        // ∫₀ʰ g(t) g(t)ᵀ dt by Simpson's rule over a thousand steps, g = (t³/6, t²/2, t, 1).
        let mut q = Matrix4::zeros();
        let steps = 1000;
        for k in 0..=steps {
            let t = h * f64::from(k) / f64::from(steps);
            let g = Vector4::new(t.powi(3) / 6.0, t * t / 2.0, t, 1.0);
            let weight = match k {
                0 => 1.0,
                k if k == steps => 1.0,
                k => f64::from(2 + 2 * (k % 2)),
            };
            q += g * g.transpose() * (weight * h / f64::from(3 * steps));
        }
        for (n, noise) in [(0, 0.1), (1, 0.7), (0, 1e-3)] {
            own = own.moved_on(h, 0.4);
            p = f * p * f.transpose() + 0.4 * q;
            let (gain, variance) = own.observed(n, noise);
            let column: Vector4<f64> = p.column(n).into();
            assert!((variance - (column[n] + noise)).abs() < 1e-12 * variance);
            assert!((Vector4::from(gain) - column / variance).amax() < 1e-12);
            p -= column * column.transpose() / variance;
            assert!((whole(&own) - p).amax() < 1e-12 * p.amax(), "{p}");
            let x = [0.3, -0.1, 2.0, 0.7];
            let product = p * Vector4::from(x);
            assert!((Vector4::from(own.times(&x)) - product).amax() < 1e-12 * p.amax());
        }
    }
}
