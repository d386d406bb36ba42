//! Shape parameters, in which a torque is not linear: Stribeck's speed, cogging's frequency, saturation's limit.
//!
//! The residuals of the present fit are regressed on the effect's columns for a grid of shapes, beside what friction and a
//! constant torque explain; the best shape is then refined between its neighbours.

use proprio_core::effect::EffectKind;

use super::dot::dot;
use super::limb::{LimbCriticism, Place};
use super::whitening::{Whitening, neighbour_correlation};

/// Windows that a scan looks at, spread over the recording.
const MOST_WINDOWS: usize = 3000;
/// A correlation of neighbours that differs by less is the same.
const CORRELATION_STEP: f64 = 0.03;
/// Multiples of the gear ratio that cogging is looked for at.
const MULTIPLES: usize = 48;
/// Limits that a saturation is looked for at, evenly up to the largest torque.
const LIMITS: u32 = 40;
/// Rounds of refinement, each a third as wide as the last.
const ROUNDS: usize = 3;

/// What friction and a constant torque explain anyhow.
const BASIS: [EffectKind; 3] = [EffectKind::Viscous, EffectKind::Coulomb, EffectKind::Bias];

/// Of each joint its windows: samples \[first, last\] and the residual.
type Residuals = Vec<Vec<([usize; 2], f64)>>;

impl LimbCriticism<'_> {
    /// Finds of what kind the noise is, and sets the shape of every effect that has one, in the model or not, to the best on
    /// the present residuals. True if one has changed so that the data have to be gone over again.
    pub(crate) fn scan_shapes(&mut self) -> bool {
        if self.take_noise() {
            self.refold();
        }
        let looked = self.look(&self.fit.theta);
        let longest = looked.iter().map(Vec::len).max().unwrap_or(0);
        let stride = (longest / MOST_WINDOWS).max(1);
        let mut changed = false;
        for joint in 0..self.recording.joints {
            let windows = looked[joint].iter().step_by(stride);
            let scanned: Vec<([usize; 2], f64)> = windows.copied().collect();
            for effect in [
                EffectKind::Stribeck,
                EffectKind::Cogging,
                EffectKind::Saturation,
            ] {
                let place = (effect, joint);
                if self.is_shape_given(place)
                    || (!self.with_candidates && !self.active.contains(&place))
                {
                    continue;
                }
                let Some(best) = self.best_shape(&scanned, place) else {
                    continue;
                };
                let before = self.shape(place);
                if (best - before).abs() > 1e-3 * before.abs() {
                    self.set_shape(place, best);
                    changed = true;
                }
            }
        }
        changed
    }

    /// Finds of what kind the noise is: the residuals that all effects together leave. True if neighbours are otherwise
    /// correlated than the rows were whitened for.
    fn take_noise(&mut self) -> bool {
        let mut saturated = self.look(&self.saturated());
        let correlation: Vec<f64> = saturated.iter().map(|w| neighbour_correlation(w)).collect();
        let is_other = |(a, b): (&f64, &f64)| (a - b).abs() > CORRELATION_STEP;
        let changed = correlation.iter().zip(&self.correlation).any(is_other);
        if changed {
            self.correlation = correlation;
        }
        for (windows, &correlation) in saturated.iter_mut().zip(&self.correlation) {
            let mut whitening = Whitening::new(correlation);
            for (samples, residual) in windows.iter_mut() {
                whitening.whiten(*samples, std::slice::from_mut(residual));
            }
        }
        self.memory = saturated.iter().map(|windows| memory(windows)).collect();
        changed
    }

    fn look(&self, theta: &[f64]) -> Residuals {
        let theta = self.columns.combined(theta);
        let mut windows = vec![Vec::new(); self.recording.joints];
        for window in self.windows.iter() {
            for (joint, list) in windows
                .iter_mut()
                .enumerate()
                .filter(|(j, _)| window.moves[*j])
            {
                list.push((window.samples, window.residual(joint, &theta[joint])));
            }
        }
        windows
    }

    fn best_shape(&self, windows: &[([usize; 2], f64)], place: Place) -> Option<f64> {
        if windows.len() < 50 {
            return None;
        }
        let mut residual: Vec<f64> = windows.iter().map(|w| w.1).collect();
        if self.active.contains(&place) {
            // What the effect explains with its present shape is for the new shape to explain.
            let entries = self.columns.of_effect(place.0, place.1);
            let columns = self.columns(windows, place, self.shape(place));
            for (column, entry) in columns.into_iter().zip(entries) {
                let value = self.fit.theta[entry];
                residual
                    .iter_mut()
                    .zip(column)
                    .for_each(|(r, x)| *r += value * x);
            }
        }
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for effect in BASIS {
            for column in self.columns(windows, (effect, place.1), 1.0) {
                basis.extend(orthonormal(column, &basis));
            }
        }
        let explained = |columns: Vec<Vec<f64>>| {
            let mut all = basis.clone();
            let mut fall = 0.0;
            for column in columns {
                if let Some(direction) = orthonormal(column, &all) {
                    fall += dot(&direction, &residual).powi(2);
                    all.push(direction);
                }
            }
            fall
        };
        if place.0 == EffectKind::Saturation {
            return self.best_limit(windows, place, &residual, &basis);
        }
        let fall = |shape: f64| explained(self.columns(windows, place, shape));
        let grid = self.grid(place);
        let falls: Vec<f64> = match place.0 {
            EffectKind::Cogging => (self.harmonics(windows, place.1).into_iter())
                .map(explained)
                .collect(),
            _ => grid.iter().map(|&shape| fall(shape)).collect(),
        };
        let best = (0..grid.len()).max_by(|&a, &b| falls[a].total_cmp(&falls[b]))?;
        let (mut shape, mut most) = (grid[best], falls[best]);
        let neighbour = if best + 1 < grid.len() {
            grid[best + 1]
        } else {
            grid[best.saturating_sub(1)]
        };
        let mut step = 0.5 * (neighbour - shape).abs();
        for _ in 0..ROUNDS {
            for other in [shape - step, shape + step] {
                let fall = fall(other);
                if other > 0.0 && fall > most {
                    (shape, most) = (other, fall);
                }
            }
            step /= 3.0;
        }
        Some(shape)
    }

    /// The limit under which the share of the limited torque that is not explained is least.
    ///
    /// The excess over the limit itself is a column of which a small limit makes the measured torque: judged by its fall
    /// alone the smallest limit would always be the best.
    fn best_limit(
        &self,
        windows: &[([usize; 2], f64)],
        place: Place,
        residual: &[f64],
        basis: &[Vec<f64>],
    ) -> Option<f64> {
        let torque = self.columns(windows, place, 0.0).swap_remove(0);
        let most = torque.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let unexplained = |limit: f64| {
            let excess = self.columns(windows, place, limit).swap_remove(0);
            let difference = |a: &[f64]| -> Vec<f64> {
                a.iter()
                    .zip(&excess)
                    .map(|(a, excess)| a - excess)
                    .collect()
            };
            let (limited, mut left) = (difference(&torque), difference(residual));
            for b in basis {
                let share = dot(b, &left);
                left.iter_mut().zip(b).for_each(|(x, b)| *x -= share * b);
            }
            dot(&left, &left) / dot(&limited, &limited)
        };
        let grid = (1..LIMITS).map(|k| most * f64::from(k) / f64::from(LIMITS));
        let judged = grid.map(|limit| (limit, unexplained(limit)));
        let (mut limit, mut least) = judged.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let mut step = 0.5 * most / f64::from(LIMITS);
        for _ in 0..ROUNDS {
            for other in [limit - step, limit + step] {
                let left = unexplained(other);
                if left < least {
                    (limit, least) = (other, left);
                }
            }
            step /= 3.0;
        }
        Some(limit)
    }

    /// How many different shapes of an effect are tried, so that chance alone makes one of them look good.
    pub(crate) fn shapes_tried(&self, place: Place) -> f64 {
        match place.0 {
            _ if self.is_shape_given(place) => 1.0,
            EffectKind::Cogging => MULTIPLES as f64,
            // Neighbouring speeds and limits look much the same.
            _ => 4.0,
        }
    }

    /// The shapes to try.
    fn grid(&self, (effect, joint): Place) -> Vec<f64> {
        match effect {
            EffectKind::Cogging => (1..=MULTIPLES)
                .map(|k| k as f64 * self.gear(joint))
                .collect(),
            _ => (0..12).map(|k| 0.01 * 1.45f64.powi(k)).collect(),
        }
    }

    /// The columns of an effect over windows, as their rows have them.
    fn columns(
        &self,
        windows: &[([usize; 2], f64)],
        (effect, joint): Place,
        shape: f64,
    ) -> Vec<Vec<f64>> {
        let joints = self.recording.joints;
        let mut columns = vec![Vec::new(); effect.columns()];
        for &([first, last], _) in windows {
            let term = |k: usize| effect.terms(&self.motion.states[k * joints + joint], shape);
            let (start, end) = (term(first), term(last));
            let mut sums = [0, 1].map(|n| end[n].boundary - start[n].boundary);
            for k in first..=last {
                let weight = self.weight([first, last], k);
                for (sum, term) in sums.iter_mut().zip(term(k)) {
                    *sum += weight * term.rate;
                }
            }
            let length = self.length([first, last]);
            for (column, sum) in columns.iter_mut().zip(sums) {
                column.push(sum / length);
            }
        }
        columns
    }

    /// The columns of cogging at the multiples of the gear ratio that are in its grid. Sine and cosine of each multiple come
    /// from those of the one before (angle addition), so that a sample costs one evaluation and not one for each multiple.
    fn harmonics(&self, windows: &[([usize; 2], f64)], joint: usize) -> Vec<Vec<Vec<f64>>> {
        let (joints, gear) = (self.recording.joints, self.gear(joint));
        let mut columns = vec![vec![Vec::new(); 2]; MULTIPLES];
        for &([first, last], _) in windows {
            let mut sums = [[0.0; 2]; MULTIPLES];
            for k in first..=last {
                let state = &self.motion.states[k * joints + joint];
                let [sin, cos] = EffectKind::Cogging.terms(state, gear).map(|term| term.rate);
                let weight = self.weight([first, last], k);
                let (mut s, mut c) = (weight * sin, weight * cos);
                for sum in &mut sums {
                    sum[0] += s;
                    sum[1] += c;
                    (s, c) = (s * cos + c * sin, c * cos - s * sin);
                }
            }
            let length = self.length([first, last]);
            for (columns, sums) in columns.iter_mut().zip(sums) {
                columns[0].push(sums[0] / length);
                columns[1].push(sums[1] / length);
            }
        }
        columns
    }

    /// The time that sample k stands for in the integral over a window (trapezoidal rule), s.
    fn weight(&self, [first, last]: [usize; 2], k: usize) -> f64 {
        let time = &self.recording.time_us;
        0.5e-6 * (time[(k + 1).min(last)] - time[k.saturating_sub(1).max(first)]) as f64
    }

    /// A window's length, s.
    fn length(&self, [first, last]: [usize; 2]) -> f64 {
        1e-6 * (self.recording.time_us[last] - self.recording.time_us[first]) as f64
    }
}

/// The integrated autocorrelation time of residuals in windows, at least one: so many neighbours say the same thing
/// (Geyer 1992, initial positive sequence).
fn memory(windows: &[([usize; 2], f64)]) -> f64 {
    const MOST_LAG: usize = 100;
    let n = windows.len();
    let mean = windows.iter().map(|w| w.1).sum::<f64>() / n.max(1) as f64;
    let at_lag = |lag: usize| -> f64 {
        let pairs = windows.iter().zip(windows.iter().skip(lag));
        pairs.map(|(a, b)| (a.1 - mean) * (b.1 - mean)).sum()
    };
    let variance = at_lag(0);
    if n < 2 * MOST_LAG || variance <= 0.0 {
        return 1.0;
    }
    let mut time = 1.0;
    for pair in 0..MOST_LAG / 2 {
        let (odd, even) = (
            at_lag(2 * pair + 1) / variance,
            at_lag(2 * pair + 2) / variance,
        );
        if odd + even <= 0.0 {
            break;
        }
        time += 2.0 * (odd + even);
    }
    time.max(1.0)
}

/// What of `x` is not in the span of `basis`, to unit length; `None` if nothing is.
fn orthonormal(mut x: Vec<f64>, basis: &[Vec<f64>]) -> Option<Vec<f64>> {
    let size = dot(&x, &x).sqrt();
    for b in basis {
        let share = dot(b, &x);
        x.iter_mut().zip(b).for_each(|(x, b)| *x -= share * b);
    }
    let length = dot(&x, &x).sqrt();
    if length.is_nan() || length <= 1e-6 * size {
        return None;
    }
    x.iter_mut().for_each(|x| *x /= length);
    Some(x)
}
