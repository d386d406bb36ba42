//! The straight line through neighbouring samples that smooths a signal and has its slope.

/// How far the straight line reaches that smooths the transmitted torque, s.
pub(super) const REACH: f64 = 8.5e-3;

/// How many samples lie within [`REACH`] on either side of sample k: the same number on both.
pub(super) fn around(t: &[f64], k: usize) -> usize {
    let most = k.min(t.len() - 1 - k);
    let near = |half: &usize| t[k] - t[k - half] <= REACH && t[k + half] - t[k] <= REACH;
    (1..=most).take_while(near).count().max(most.min(1))
}

/// Value and slope at sample k of the straight line through as many samples on either side.
pub(crate) fn local_line(t: &[f64], x: &[f64], k: usize, half: usize) -> [f64; 2] {
    Line::about(t, k, half).fitted(x, (0, 1))
}

/// A straight line through neighbouring samples: what of it the times make.
pub(super) struct Line<'a> {
    t: &'a [f64],
    k: usize,
    half: usize,
    sum: f64,
    squares: f64,
}

impl<'a> Line<'a> {
    pub(super) fn about(t: &'a [f64], k: usize, half: usize) -> Self {
        let half = half.min(k).min(t.len() - 1 - k);
        let (mut sum, mut squares) = (0.0, 0.0);
        for time in &t[k - half..=k + half] {
            let dt = time - t[k];
            sum += dt;
            squares += dt * dt;
        }
        Self {
            t,
            k,
            half,
            sum,
            squares,
        }
    }

    /// Its value and slope at sample k, where x lies from `first` on at every `step` of a list.
    pub(super) fn fitted(&self, list: &[f64], (first, step): (usize, usize)) -> [f64; 2] {
        let (t, k) = (self.t, self.k);
        let x = |k: usize| list[k * step + first];
        let here = x(k);
        if self.half == 0 {
            let (a, b) = if k == 0 {
                (0, 1.min(t.len() - 1))
            } else {
                (k - 1, k)
            };
            let step = t[b] - t[a];
            let slope = if step > 0.0 {
                (x(b) - x(a)) / step
            } else {
                0.0
            };
            return [here, slope];
        }
        let (mut sum, mut product) = (0.0, 0.0);
        let samples = k - self.half..=k + self.half;
        let near = list[samples.start() * step + first..].iter().step_by(step);
        let now = t[k];
        for (t, x) in t[samples].iter().zip(near) {
            let dx = x - here;
            sum += dx;
            product += (t - now) * dx;
        }
        let n = (2 * self.half + 1) as f64;
        let slope = (product - self.sum * sum / n) / (self.squares - self.sum * self.sum / n);
        [here + (sum - slope * self.sum) / n, slope]
    }

    /// The parabola through the same samples: it keeps what a line flattens where a signal turns.
    pub(super) fn parabola(&self) -> Parabola {
        let (t, k) = (self.t, self.k);
        let samples = k - self.half..k + self.half + 1;
        // In units of the reach, so that the powers are of one size.
        let reach = (t[samples.end - 1] - t[samples.start]).max(f64::MIN_POSITIVE);
        let times = || t[samples.clone()].iter().map(|t_i| (t_i - t[k]) / reach);
        let mut powers = [0.0; 5];
        for dt in times() {
            let mut power = 1.0;
            for sum in &mut powers {
                *sum += power;
                power *= dt;
            }
        }
        let [s0, s1, s2, s3, s4] = powers;
        // The first unknown of the normal equations, by Cramer's rule.
        let minors = [s2 * s4 - s3 * s3, s1 * s4 - s2 * s3, s1 * s3 - s2 * s2];
        let whole = s0 * minors[0] - s1 * minors[1] + s2 * minors[2];
        let is_told = self.half > 0 && whole.abs() >= f64::MIN_POSITIVE;
        let weight = |dt: f64| match is_told {
            true => (minors[0] - dt * (minors[1] - dt * minors[2])) / whole,
            false => 0.0,
        };
        Parabola {
            k,
            first: samples.start,
            weights: times().map(weight).collect(),
        }
    }
}

/// A parabola through neighbouring samples: how much each of them counts in its value at the one in the middle.
pub(super) struct Parabola {
    k: usize,
    first: usize,
    weights: Vec<f64>,
}

impl Parabola {
    /// Its value at sample k, where x lies from `first` on at every `step` of a list.
    pub(super) fn value(&self, list: &[f64], (first, step): (usize, usize)) -> f64 {
        let here = list[self.k * step + first];
        let near = list[self.first * step + first..].iter().step_by(step);
        let sum: f64 = (self.weights.iter().zip(near))
            .map(|(weight, x)| weight * (x - here))
            .sum();
        here + sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_has_its_slope_inside() {
        let t: Vec<f64> = (0..20).map(|k| 0.002 * f64::from(k)).collect();
        let x: Vec<f64> = t.iter().map(|t| 1.0 + 3.0 * t + 50.0 * t * t).collect();
        let [_, slope] = local_line(&t, &x, 10, 4);
        assert!((slope - (3.0 + 100.0 * t[10])).abs() < 1e-9);
    }

    #[test]
    fn a_parabola_has_its_value_where_it_turns() {
        let uneven = |k: i32| 0.002 * f64::from(k) + 3e-4 * f64::from(k % 3);
        let t: Vec<f64> = (0..20).map(uneven).collect();
        let x: Vec<f64> = t.iter().map(|t| 1.0 + 3.0 * t + 50.0 * t * t).collect();
        for half in 0..5 {
            let value = Line::about(&t, 10, half).parabola().value(&x, (0, 1));
            assert!((value - x[10]).abs() < 1e-12, "{half}: {value}");
        }
    }
}
