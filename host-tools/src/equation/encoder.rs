//! What a joint's encoder gets wrong, and the motion that it has seen.

/// A joint's encoder: reported position = true + offset + sine · sin q + cosine · cos q, with q the true one.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Encoder {
    /// rad.
    pub(super) offset: f64,
    /// rad, once per turn.
    pub(super) sine: f64,
    /// See `sine`.
    pub(super) cosine: f64,
}

impl Encoder {
    /// Whether it is wrong by no more than a constant.
    fn is_round(&self) -> bool {
        self.sine == 0.0 && self.cosine == 0.0
    }

    /// The true position, rad, by the reported one.
    fn position(&self, reported: f64) -> f64 {
        let moved = reported - self.offset;
        if self.is_round() {
            return moved;
        }
        // A contraction by √0.08 at the bounds: what four leave there is 0.6 % of the error, of one of 0.03 rad 1e-6 of it.
        (0..4).fold(moved, |q, _| {
            moved - self.sine * q.sin() - self.cosine * q.cos()
        })
    }

    /// True position (rad) and velocity (rad/s) by the reported ones.
    pub(crate) fn motion(&self, [q, dq]: [f64; 2]) -> [f64; 2] {
        let [q, dq, _] = self.state([q, dq, 0.0]);
        [q, dq]
    }

    /// The same with the acceleration, rad/s².
    pub(crate) fn state(&self, [q, dq, ddq]: [f64; 3]) -> [f64; 3] {
        let q = self.position(q);
        if self.is_round() {
            return [q, dq, ddq];
        }
        let (sin, cos) = q.sin_cos();
        let slope = 1.0 + self.sine * cos - self.cosine * sin;
        let bend = -self.sine * sin - self.cosine * cos;
        let dq = dq / slope;
        [q, dq, (ddq - bend * dq * dq) / slope]
    }

    /// Reported position (rad) and velocity (rad/s) by the true ones.
    pub(crate) fn reported(&self, [q, dq]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = q.sin_cos();
        let slope = 1.0 + self.sine * cos - self.cosine * sin;
        [
            q + self.offset + self.sine * sin + self.cosine * cos,
            dq * slope,
        ]
    }

    /// Its numbers, for keys.
    pub(crate) fn numbers(&self) -> [f64; 3] {
        [self.offset, self.sine, self.cosine]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// What it reports of a motion is that motion again, by differences too.
        #[test]
        fn what_is_reported_is_understood(
            offset in -0.5f64..0.5, sine in -0.05f64..0.05, cosine in -0.05f64..0.05, phase in -3.0f64..3.0,
        ) {
            let encoder = Encoder { offset, sine, cosine };
            let truth = |t: f64| phase + (2.0 * t).sin();
            let reported = |t: f64| truth(t) + offset + sine * truth(t).sin() + cosine * truth(t).cos();
            let h = 1e-4;
            let derivatives = |of: &dyn Fn(f64) -> f64| {
                let [a, b, c] = [-h, 0.0, h].map(|t| of(0.3 + t));
                [b, (c - a) / (2.0 * h), (a - 2.0 * b + c) / (h * h)]
            };
            let known = encoder.state(derivatives(&reported));
            let true_state = derivatives(&truth);
            for (n, (a, b)) in known.iter().zip(true_state).enumerate() {
                prop_assert!((a - b).abs() < [1e-6, 1e-5, 1e-3][n], "{n}: {a} {b}");
            }
            let [q, dq] = encoder.motion([reported(0.3), 1.0]);
            prop_assert!((q - truth(0.3)).abs() < 1e-6 && dq.is_finite());
            let again = encoder.reported([q, dq]);
            prop_assert!((again[0] - reported(0.3)).abs() < 1e-6 && (again[1] - 1.0).abs() < 1e-6);
        }
    }
}
