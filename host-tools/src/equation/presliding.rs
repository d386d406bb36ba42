//! Presliding friction by a joint's motion: how far its bristles are bent, integrated over time.
//!
//! With z/zs the deflection as a share of the most that it can be, and motion in one direction s = ±1, Dahl's equation
//! ([`proprio_core::effect`]) is linear in the distance x = |Δq|/zs,
//!
//! ```text
//! z/zs → s + (z/zs − s) exp(−x)
//! ```
//!
//! exact whatever the speed. Its mean over the time of a step, s + (z/zs − s) (1 − exp(−x))/x, is exact at a steady speed: where the
//! speed changes much between two samples, or its sign, the step is divided along the cubic through both samples' positions and
//! velocities.
//!
//! How far the bristles were bent before the first sample is not known. Any two beginnings come as near each other as exp(−path/zs),
//! so that a start in the middle, at rest, is at most that far off: the torque is right to 5 % of F once the joint has gone 3 zs, and
//! a window counts only if it moves. After a gap it starts anew, for nobody knows what the joint did meanwhile.

/// How many parts a step is divided into whose greater speed is at most so many times the smaller; a window's mean is then right to
/// 0.2 % of F where a joint swings at 9 Hz and samples come at 500 Hz, to 1 % at 100 Hz.
const PARTS: [(f64, usize); 2] = [(1.1, 1), (2.0, 2)];
/// The same of a step in which the speed changes more, or its sign.
const MOST_PARTS: usize = 8;

/// The way of a joint through a stretch of samples without a gap, in parts of which each has a steady speed.
#[derive(Clone)]
pub(crate) struct Way {
    /// How long each part takes (s), and how far it goes, in the unit of the position.
    parts: Vec<[f64; 2]>,
    /// How many parts there are until each sample.
    ends: Vec<usize>,
}

impl Way {
    /// By position, velocity, … at the times `t`.
    pub(crate) fn of(t: &[f64], state: &[[f64; 4]]) -> Self {
        let mut parts = Vec::with_capacity(2 * t.len());
        let mut ends = Vec::with_capacity(t.len());
        ends.extend(t.first().map(|_| 0));
        for k in 1..t.len() {
            let step = Step {
                time: t[k] - t[k - 1],
                from: [state[k - 1][0], state[k - 1][1]],
                to: [state[k][0], state[k][1]],
            };
            let count = step.parts();
            let time = step.time / count as f64;
            let mut last = step.from[0];
            for n in 1..=count {
                let q = step.position(n as f64 / count as f64);
                parts.push([time, q - last]);
                last = q;
            }
            ends.push(parts.len());
        }
        Self { parts, ends }
    }

    /// ∫ z/zs dt at each sample since the first, s.
    pub(crate) fn impulse(&self, zs: f64) -> impl Iterator<Item = f64> + '_ {
        self.bristles(zs).map(|[impulse, _]| impulse)
    }

    /// The same, and z/zs at each sample.
    pub(crate) fn bristles(&self, zs: f64) -> impl Iterator<Item = [f64; 2]> + '_ {
        let (mut bent, mut sum, mut done) = (0.0, 0.0, 0);
        self.ends.iter().map(move |&end| {
            for [time, distance] in &self.parts[done..end] {
                let (mean, after) = slid(bent, distance / zs);
                sum += time * mean;
                bent = after;
            }
            done = end;
            [sum, bent]
        })
    }
}

/// The mean deflection on the way by a signed distance in units of zs, and that at its end.
pub(crate) fn slid(bent: f64, distance: f64) -> (f64, f64) {
    let (x, sign) = (distance.abs(), distance.signum());
    let left = (-x).exp();
    // (1 − exp(−x))/x, which has few digits left where x is as small as an encoder's quantum: its series there, to 1e-13.
    let mean = if x > 1e-4 {
        (1.0 - left) / x
    } else {
        1.0 - x * (0.5 - x / 6.0)
    };
    (sign + (bent - sign) * mean, sign + (bent - sign) * left)
}

/// From one sample to the next: position and velocity at both.
struct Step {
    time: f64,
    from: [f64; 2],
    to: [f64; 2],
}

impl Step {
    fn parts(&self) -> usize {
        let [a, b] = [self.from[1], self.to[1]];
        let (slow, fast) = (a.abs().min(b.abs()), a.abs().max(b.abs()));
        let steady = |(most, _): &&(f64, usize)| a * b > 0.0 && fast <= most * slow;
        (PARTS.iter().find(steady)).map_or(MOST_PARTS, |(_, parts)| *parts)
    }

    /// Position at a share of the step, by the cubic through both ends.
    fn position(&self, share: f64) -> f64 {
        let [a, b] = [self.from[1] * self.time, self.to[1] * self.time];
        let way = self.to[0] - self.from[0];
        let rest = 1.0 - share;
        self.from[0]
            + share * share * (3.0 - 2.0 * share) * way
            + share * rest * (a * rest - b * share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn presliding(t: &[f64], state: &[[f64; 4]], zs: f64) -> Vec<f64> {
        Way::of(t, state).impulse(zs).collect()
    }

    fn sine(n: usize, period: f64) -> (Vec<f64>, Vec<[f64; 4]>) {
        let t: Vec<f64> = (0..n).map(|k| period * k as f64).collect();
        let state = |t: &f64| [0.1 * (9.0 * t).sin(), 0.9 * (9.0 * t).cos(), 0.0, 0.0];
        let states = t.iter().map(state).collect();
        (t, states)
    }

    /// Dahl's equation by small explicit steps along the closed motion.
    fn by_small_steps(t: &[f64], zs: f64) -> Vec<f64> {
        const STEPS: usize = 20_000;
        let (mut bent, mut sum) = (0.0, 0.0);
        let mut all = vec![0.0];
        for k in 1..t.len() {
            let h = (t[k] - t[k - 1]) / STEPS as f64;
            for n in 0..STEPS {
                let dq = 0.9 * (9.0 * (t[k - 1] + (n as f64 + 0.5) * h)).cos();
                let before = bent;
                bent += h * (dq - dq.abs() * bent) / zs;
                sum += 0.5 * h * (before + bent);
            }
            all.push(sum);
        }
        all
    }

    /// Whether the bristles give way over more than a sample's distance or less: within a thousandth of the impulse that a window of 20 ms
    /// can have at 500 Hz, within a two-hundredth at 100 Hz.
    #[test]
    fn it_is_dahls_equation() {
        for (period, most) in [(0.002, 2e-5), (0.01, 1e-4)] {
            let (t, state) = sine((0.8 / period) as usize, period);
            for zs in [1e-3, 5e-3, 0.05] {
                let (ours, other) = (presliding(&t, &state, zs), by_small_steps(&t, zs));
                let window = (0.02 / period) as usize;
                for k in window..t.len() {
                    let difference = (ours[k] - ours[k - window]) - (other[k] - other[k - window]);
                    assert!(difference.abs() < most, "{period} {zs} {k}: {difference}");
                }
            }
        }
    }

    /// For a small displacement it is Coulomb friction, and the reversal is found within a fraction of a sample.
    #[test]
    fn without_displacement_it_is_coulomb_friction() {
        let (t, state) = sine(400, 0.002);
        let impulse = presliding(&t, &state, 1e-9);
        let turns = [1.0, 3.0, 5.0].map(|n| n * std::f64::consts::PI / 18.0);
        for k in 0..t.len() {
            let mut exact = 0.0;
            let (mut sign, mut from) = (1.0, 0.0);
            for turn in turns.into_iter().filter(|turn| *turn < t[k]) {
                exact += sign * (turn - from);
                (sign, from) = (-sign, turn);
            }
            exact += sign * (t[k] - from);
            assert!(
                (impulse[k] - exact).abs() < 3e-4,
                "{k}: {} {exact}",
                impulse[k]
            );
        }
    }

    #[test]
    fn nothing_comes_of_no_samples_or_of_rest() {
        assert!(presliding(&[], &[], 0.01).is_empty());
        let rest = presliding(&[0.0, 1.0, 2.0], &[[0.3, 0.0, 0.0, 0.0]; 3], 0.01);
        assert_eq!(rest, [0.0; 3]);
    }

    proptest! {
        /// Never more than the friction itself; and whatever the bristles were like before, they forget it over the path.
        #[test]
        fn it_is_bounded_and_forgets(
            steps in prop::collection::vec(-1.0..1.0f64, 1..60),
            zs in 1e-3..0.3f64,
            start in -1.0..1.0f64,
        ) {
            let (mut one, mut other, mut path) = (start, 0.0, 0.0);
            for step in steps {
                let distance = 0.05 * step / zs;
                let (mean, end) = slid(one, distance);
                prop_assert!(mean.abs() <= 1.0 && end.abs() <= 1.0);
                (one, other) = (end, slid(other, distance).1);
                path += distance.abs();
            }
            prop_assert!(((one - other) - start * (-path).exp()).abs() < 1e-12);
        }
    }
}
