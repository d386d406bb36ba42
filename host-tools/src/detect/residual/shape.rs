//! The patterns that have a name: what a residual looks like against one variable.

use std::f64::consts::{FRAC_PI_2, TAU};

use serde::Serialize;

use super::cluster::{Fit, fit};
use super::series::{Runs, Series, centred, project_out, square};
use crate::robust;

/// What the residual is held against.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Variable {
    /// Nothing: the mean.
    Constant,
    /// Velocity with its sign, rad/s.
    Velocity,
    /// Magnitude of the velocity, rad/s.
    Speed,
    /// Acceleration, rad/s², from positions.
    Acceleration,
    /// Position, rad.
    Position,
    /// Magnitude of the predicted torque, N m.
    Load,
    /// Motor temperature, degrees Celsius.
    Temperature,
    /// Time, s.
    Time,
    /// Foot on the ground or not, 1 or 0.
    Contact,
}

/// A pattern that has a name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Shape {
    /// The same everywhere.
    Offset,
    /// A step where the velocity changes sign.
    Step,
    /// Proportional to velocity.
    Viscous,
    /// As the square of the velocity, against it.
    Drag,
    /// Grows with the magnitude of the velocity, the same in both directions.
    Even,
    /// Proportional to acceleration.
    Inertial,
    /// Proportional to position.
    Spring,
    /// Periodic in position.
    Periodic {
        /// Periods per radian.
        per_radian: f64,
        /// Phase of the sine at the least position, rad.
        phase: f64,
    },
    /// Proportional to the predicted torque.
    Gain,
    /// Grows with the magnitude of the torque.
    Load,
    /// Against the motion, growing with the magnitude of the torque.
    LoadFriction,
    /// Proportional to temperature.
    Warmth,
    /// Proportional to velocity, growing or shrinking with temperature.
    WarmFriction,
    /// Drifts with time.
    Drift,
    /// Is another from one moment on.
    Change {
        /// What changes.
        of: Changing,
        /// From when on, s, as the log counts.
        at: f64,
    },
    /// Other with the foot on the ground.
    Contact,
}

/// What of a torque may be another from one moment on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Changing {
    /// A constant torque.
    Offset,
    /// Friction of constant size.
    Friction,
    /// Friction in proportion to velocity.
    Viscous,
    /// Inertia.
    Inertia,
    /// The scale of all torque.
    Gain,
}

impl Changing {
    const ALL: [Self; 5] = [
        Self::Offset,
        Self::Friction,
        Self::Viscous,
        Self::Inertia,
        Self::Gain,
    ];

    /// The shape that is another.
    fn shape(self) -> Shape {
        match self {
            Self::Offset => Shape::Offset,
            Self::Friction => Shape::Step,
            Self::Viscous => Shape::Viscous,
            Self::Inertia => Shape::Inertial,
            Self::Gain => Shape::Gain,
        }
    }
}

/// A change is looked for where so much of a shape's square lies before it and after (Andrews 1993, table 1, whose trimming is this).
const TRIMMED: f64 = 0.15;

/// Ranges of speed, and of acceleration, in each of which a shape may have a size of its own.
const RANGES: usize = 6;

/// Moments of a change that count as independent tries: at 1 % the largest of Andrews' statistics, 12.16, is one of 5e-4 at a known moment.
const MOMENTS: usize = 20;

/// Velocity, rad/s, within which a window's mean has no sure sign: three times the noise of a Go2's mean velocity over a window.
const UNSURE: f64 = 0.03;

/// Periods over the range of positions that are looked for, in halves: between two of these a wave keeps nine tenths of itself.
const PERIODS: std::ops::RangeInclusive<usize> = 4..=32;

/// Share of a pattern's own square that must be left beside those taken.
pub(super) const ADDS: f64 = 1e-3;

/// Ranges of position below this, rad, hold no period.
const LEAST_RANGE: f64 = 0.01;

/// A joint's variables, worked out once.
#[derive(Debug)]
pub(super) struct Variables<'a> {
    series: Series<'a>,
    predicted: Vec<f64>,
    acceleration: Vec<f64>,
    range: f64,
    least: f64,
}

impl<'a> Variables<'a> {
    pub(super) fn of(series: &Series<'a>, runs: &Runs) -> Self {
        let (least, most) = (series.q.iter())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &q| {
                (a.min(q), b.max(q))
            });
        Self {
            predicted: series.predicted(),
            acceleration: series.acceleration(runs),
            series: *series,
            range: most - least,
            least,
        }
    }

    /// Whether the joint slides.
    pub(super) fn slides(&self) -> bool {
        self.series.slides
    }

    /// The variables that the series has.
    pub(super) fn known(&self) -> Vec<Variable> {
        let mut known = vec![
            Variable::Constant,
            Variable::Velocity,
            Variable::Speed,
            Variable::Acceleration,
            Variable::Position,
            Variable::Load,
            Variable::Time,
        ];
        known.extend(self.series.temperature.map(|_| Variable::Temperature));
        known.extend(self.series.contact.map(|_| Variable::Contact));
        known
    }

    /// A variable's values, one per window.
    pub(super) fn values(&self, variable: Variable) -> Vec<f64> {
        let magnitude = |values: &[f64]| values.iter().map(|v| v.abs()).collect();
        match variable {
            Variable::Constant => vec![1.0; self.series.t.len()],
            Variable::Velocity => self.series.dq.to_vec(),
            Variable::Speed => magnitude(self.series.dq),
            Variable::Acceleration => self.acceleration.clone(),
            Variable::Position => self.series.q.to_vec(),
            Variable::Load => magnitude(&self.predicted),
            Variable::Temperature => self.series.temperature.unwrap_or_default().to_vec(),
            Variable::Time => self.series.t.to_vec(),
            Variable::Contact => self.series.contact.unwrap_or_default().to_vec(),
        }
    }

    /// What each named pattern in a variable adds to those `taken` (orthonormal), and how many were tried.
    pub(super) fn fits(
        &self,
        variable: Variable,
        residual: &[f64],
        taken: &[Vec<f64>],
        runs: &Runs,
    ) -> (Vec<(Shape, Fit)>, usize) {
        let mut shapes = match variable {
            Variable::Constant => vec![Shape::Offset],
            Variable::Velocity => vec![Shape::Step, Shape::Viscous, Shape::Drag],
            Variable::Speed => vec![Shape::Even],
            Variable::Acceleration => vec![Shape::Inertial],
            Variable::Position => vec![Shape::Spring],
            Variable::Load => vec![Shape::Gain, Shape::Load, Shape::LoadFriction],
            Variable::Temperature => vec![Shape::Warmth, Shape::WarmFriction],
            Variable::Time => vec![Shape::Drift],
            Variable::Contact => vec![Shape::Contact],
        };
        let mut tried = shapes.len();
        if variable == Variable::Position && self.range > LEAST_RANGE {
            tried += 2 * PERIODS.count();
            shapes.extend(self.best_period(residual));
        }
        if variable == Variable::Time {
            tried += Changing::ALL.len() * MOMENTS;
            shapes.extend(
                Changing::ALL
                    .iter()
                    .filter_map(|of| self.change(*of, residual)),
            );
        }
        let fit = |&shape: &Shape| {
            let mut x = self.pattern(shape);
            let steady = match shape {
                Shape::Change { of, .. } => self.steady(of),
                _ => Vec::new(),
            };
            if !taken.is_empty() || !steady.is_empty() {
                let all = square(&centred(&x));
                x = centred(&x);
                // What is taken is not orthogonal to what is steady: what it has besides.
                let mut basis = steady;
                for direction in taken {
                    add_direction(&mut basis, direction.clone());
                }
                project_out(&mut x, &basis);
                // A pattern that is as good as taken adds nothing but rounding.
                (square(&x) > ADDS * all).then_some(())?;
            }
            Some((shape, fit(&x, residual, runs)?))
        };
        (shapes.iter().filter_map(fit).collect(), tried)
    }

    /// The wave in position that explains most; only this one is worth an error.
    fn best_period(&self, residual: &[f64]) -> Option<Shape> {
        let e = centred(residual);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let waves = PERIODS.filter_map(|halves| {
            let per_radian = 0.5 * halves as f64 / self.range;
            let wave = |phase| centred(&self.pattern(Shape::Periodic { per_radian, phase }));
            let [sine, cosine] = [wave(0.0), wave(FRAC_PI_2)];
            // Both together by least squares: a phase of its own.
            let [ss, sc, cc] = [
                dot(&sine, &sine),
                dot(&sine, &cosine),
                dot(&cosine, &cosine),
            ];
            let [se, ce] = [dot(&sine, &e), dot(&cosine, &e)];
            let determinant = ss * cc - sc * sc;
            let [a, b] = [se * cc - ce * sc, ce * ss - se * sc].map(|x| x / determinant);
            let explained = a * se + b * ce;
            let phase = b.atan2(a);
            explained
                .is_finite()
                .then_some((explained, Shape::Periodic { per_radian, phase }))
        });
        waves
            .max_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, shape)| shape)
    }

    /// A shape with a size of its own in each range of speed and of acceleration (orthonormal). A sweep's speed is its time: what a static curve
    /// explains has not changed.
    fn steady(&self, of: Changing) -> Vec<Vec<f64>> {
        let x = or_zero(self.pattern(of.shape()));
        let mut basis: Vec<Vec<f64>> = Vec::new();
        let accelerations: Vec<f64> = self.acceleration.iter().map(|a| a.abs()).collect();
        for by in [self.values(Variable::Speed), accelerations] {
            let edges: Vec<f64> = (1..RANGES)
                .filter_map(|n| {
                    let finite = by.iter().copied().filter(|v| v.is_finite());
                    robust::quantile(finite, n as f64 / RANGES as f64)
                })
                .collect();
            for range in 0..RANGES {
                let is_in = |v: &f64| edges.partition_point(|edge| edge < v) == range;
                let own = x
                    .iter()
                    .zip(&by)
                    .map(|(x, v)| if is_in(v) { *x } else { 0.0 });
                add_direction(&mut basis, own.collect());
            }
        }
        basis
    }

    /// The moment from which on a shape is best taken to be another.
    fn change(&self, of: Changing, residual: &[f64]) -> Option<Shape> {
        let x = or_zero(self.pattern(of.shape()));
        let mut e = centred(residual);
        project_out(&mut e, &self.steady(of));
        let both = |k: usize| [x[k] * x[k], x[k] * e[k]];
        let [xx, xe] = (0..x.len()).fold([0.0; 2], |[a, b], k| [a + both(k)[0], b + both(k)[1]]);
        let (mut before, mut best) = ([0.0; 2], None::<(f64, f64)>);
        for k in 1..x.len() {
            let [square, product] = both(k - 1);
            before = [before[0] + square, before[1] + product];
            let after = [xx - before[0], xe - before[1]];
            if before[0].min(after[0]) <= TRIMMED * xx {
                continue;
            }
            // A size of its own before and after, beyond one size for both.
            let gain = before[1] * before[1] / before[0] + after[1] * after[1] / after[0];
            if best.is_none_or(|(most, _)| gain > most) {
                best = Some((gain, 0.5 * (self.series.t[k - 1] + self.series.t[k])));
            }
        }
        best.map(|(_, at)| Shape::Change { of, at })
    }

    /// A pattern of size 1, one value per window.
    pub(super) fn pattern(&self, shape: Shape) -> Vec<f64> {
        let Series { dq, q, .. } = self.series;
        let direction = |dq: f64| (dq / UNSURE).clamp(-1.0, 1.0);
        let velocities = |f: &dyn Fn(f64) -> f64| dq.iter().map(|&dq| f(dq)).collect();
        match shape {
            Shape::Offset => self.values(Variable::Constant),
            Shape::Step => velocities(&direction),
            Shape::Viscous => dq.to_vec(),
            Shape::Drag => velocities(&|dq| dq * dq.abs()),
            Shape::Even => velocities(&f64::abs),
            Shape::Inertial => self.acceleration.clone(),
            Shape::Spring => q.to_vec(),
            Shape::Periodic { per_radian, phase } => {
                let wave = |q: &f64| (TAU * per_radian * (q - self.least) + phase).sin();
                q.iter().map(wave).collect()
            }
            Shape::Gain => self.predicted.clone(),
            Shape::Load => self.values(Variable::Load),
            Shape::LoadFriction => {
                let pairs = self.predicted.iter().zip(dq);
                pairs.map(|(tau, &dq)| tau.abs() * direction(dq)).collect()
            }
            Shape::Warmth => self.values(Variable::Temperature),
            Shape::WarmFriction => {
                let temperature = self.values(Variable::Temperature);
                let mean = temperature.iter().sum::<f64>() / temperature.len().max(1) as f64;
                let pairs = temperature.iter().zip(dq);
                pairs.map(|(t, dq)| (t - mean) * dq).collect()
            }
            Shape::Drift => self.values(Variable::Time),
            Shape::Change { of, at } => {
                let x = or_zero(self.pattern(of.shape()));
                let later = |k: usize| self.series.t[k] > at;
                let after: f64 = (0..x.len())
                    .filter(|k| later(*k))
                    .map(|k| x[k] * x[k])
                    .sum();
                // Less its share of the whole shape: what is the same throughout is no change.
                let share = after / square(&x).max(f64::MIN_POSITIVE);
                let own = |k: usize| x[k] * (f64::from(u8::from(later(k))) - share);
                (0..x.len()).map(own).collect()
            }
            Shape::Contact => self.values(Variable::Contact),
        }
    }
}

/// What a vector has beside an orthonormal basis becomes a direction of it, if it is more than rounding.
fn add_direction(basis: &mut Vec<Vec<f64>>, mut own: Vec<f64>) {
    let all = square(&own);
    project_out(&mut own, basis);
    let left = square(&own);
    if left > ADDS * all {
        own.iter_mut().for_each(|x| *x /= left.sqrt());
        basis.push(own);
    }
}

/// What is not a number says nothing.
fn or_zero(mut values: Vec<f64>) -> Vec<f64> {
    values
        .iter_mut()
        .filter(|x| !x.is_finite())
        .for_each(|x| *x = 0.0);
    values
}
