//! The patterns that have a name: what a residual looks like against one variable.

use serde::Serialize;

use super::cluster::{Fit, fit};
use super::series::{Runs, Series, centred, project_out, square};

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
        /// Quarter of a period later.
        quadrature: bool,
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
    /// Other with the foot on the ground.
    Contact,
}

/// Velocity, rad/s, within which a window's mean has no sure sign: three times the noise of a Go2's mean velocity over a window.
const UNSURE: f64 = 0.03;

/// Periods over the range of positions that are looked for.
const PERIODS: std::ops::RangeInclusive<usize> = 2..=16;

/// Share of a pattern's own square that must be left beside those taken.
const ADDS: f64 = 1e-3;

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
        let fit = |&shape: &Shape| {
            let mut x = self.pattern(shape);
            if !taken.is_empty() {
                let all = square(&centred(&x));
                x = centred(&x);
                project_out(&mut x, taken);
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
        let waves = PERIODS.flat_map(|periods| {
            [false, true].map(|quadrature| Shape::Periodic {
                per_radian: periods as f64 / self.range,
                quadrature,
            })
        });
        let explained = |shape: &Shape| {
            let x = centred(&self.pattern(*shape));
            let product: f64 = x.iter().zip(&e).map(|(x, e)| x * e).sum();
            product * product / square(&x).max(f64::MIN_POSITIVE)
        };
        let waves = waves.map(|shape| (explained(&shape), shape));
        waves
            .max_by(|(a, _), (b, _)| a.total_cmp(b))
            .map(|(_, shape)| shape)
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
            Shape::Periodic {
                per_radian,
                quadrature,
            } => {
                let angle = |q: f64| std::f64::consts::TAU * per_radian * (q - self.least);
                let wave = |&q: &f64| {
                    if quadrature {
                        angle(q).cos()
                    } else {
                        angle(q).sin()
                    }
                };
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
            Shape::Contact => self.values(Variable::Contact),
        }
    }
}
