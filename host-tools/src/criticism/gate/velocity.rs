//! Does the reported velocity belong to the reported position?
//!
//! Over a stretch of time, ∫q̇ dt must be Δq. If q̇ is reported with a gain g, late by d and through a filter, its
//! expansion in slow motion is q̇_reported = g (q̇ − d q̈ + c q⃛) + o, so that
//!
//! ```text
//! ∫q̇ dt = g Δq − g d Δq̇ + g c Δq̈ + o Δt
//! ```
//!
//! is linear in what is sought. Without the second and third column a filter's roll-off or a late stamp would pass for a
//! gain: a sine of 9 Hz filtered at 4 ms loses 2.5 %. All columns come from the *position*, smoothed by a local parabola,
//! never from the velocity under test: its noise enters the left side only and biases nothing. Position is reported in
//! steps h too; each Δq has an error of variance h²/6, which is taken off the sum of squares (least squares corrected
//! for errors in variables; Fuller 1987, §1.2).

use nalgebra::{SMatrix, SVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::blocks::{Blocks, Merge};

/// Samples around a point through which a parabola goes.
pub(super) const AROUND: usize = 9;

/// Time between the ends of stretches, s, and how many of it make a stretch of 0.2 s.
pub(super) const STEP: f64 = 0.05;
const STEPS: usize = 4;

/// What is known of a joint at an instant, from positions alone except for the integral.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Point {
    t: f64,
    integral: f64,
    q: f64,
    dq: f64,
    ddq: f64,
}

/// A joint's motion around the present: the last positions and integrals of the velocity.
#[derive(Debug, Clone, Default)]
pub(super) struct Trail {
    q: [f64; AROUND],
    integral: [f64; AROUND],
    last_dq: f64,
}

impl Trail {
    /// Takes a sample `dt` seconds after the last; 0 starts anew.
    pub(super) fn push(&mut self, dt: f64, q: f64, dq: f64) {
        self.q.rotate_left(1);
        self.integral.rotate_left(1);
        self.q[AROUND - 1] = q;
        self.integral[AROUND - 1] = self.integral[AROUND - 2] + 0.5 * dt * (self.last_dq + dq);
        self.last_dq = dq;
    }

    /// The middle of the trail; `times` are those of its samples, s.
    pub(super) fn middle(&self, times: &[f64; AROUND], fit: &Parabola) -> Point {
        let [q, dq, ddq] = fit.through(&self.q);
        Point {
            t: times[AROUND / 2],
            integral: self.integral[AROUND / 2],
            q,
            dq,
            ddq,
        }
    }
}

/// The least-squares parabola through values at given times: its value, slope and curvature at the middle one.
#[derive(Debug, Clone)]
pub(super) struct Parabola {
    weights: SMatrix<f64, 3, AROUND>,
}

impl Parabola {
    /// None if the times do not carry a parabola.
    pub(super) fn at(times: &[f64; AROUND]) -> Option<Self> {
        let middle = times[AROUND / 2];
        let scale = times[AROUND - 1] - times[0];
        let basis = SMatrix::<f64, AROUND, 3>::from_fn(|row, power| {
            ((times[row] - middle) / scale).powi(power as i32)
        });
        let normal = (basis.transpose() * basis).cholesky()?;
        let mut weights = normal.solve(&basis.transpose());
        weights.row_mut(1).scale_mut(1.0 / scale);
        weights.row_mut(2).scale_mut(2.0 / (scale * scale));
        weights
            .iter()
            .all(|w| w.is_finite())
            .then_some(Self { weights })
    }

    fn through(&self, values: &[f64; AROUND]) -> [f64; 3] {
        // Relative to the middle, so that nothing cancels.
        let middle = values[AROUND / 2];
        let relative = SVector::<f64, AROUND>::from_fn(|row, _| values[row] - middle);
        let [value, slope, curvature] = (self.weights * relative).into();
        [value + middle, slope, curvature]
    }
}

const COLUMNS: usize = 4;

/// Normal equations of the stretches in a block of time.
#[derive(Debug, Clone, Default)]
struct Sums {
    count: f64,
    square: SMatrix<f64, COLUMNS, COLUMNS>,
    product: SVector<f64, COLUMNS>,
}

impl Merge for Sums {
    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.square += other.square;
        self.product += other.product;
    }
}

/// What the stretches of a joint say of its reported velocity.
#[derive(Debug, Clone)]
pub(super) struct VelocityCheck {
    recent: [Point; STEPS],
    held: usize,
    sums: Blocks<Sums>,
}

/// The reported velocity against the reported position.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct VelocityGain {
    /// Reported velocity = gain × true.
    pub gain: f64,
    /// Its standard error, from the spread over blocks of time.
    pub gain_std: f64,
    /// How late the velocity is against the position, s; negative: early.
    pub lag: f64,
    /// Its standard error, s.
    pub lag_std: f64,
    /// Velocity reported at rest, rad/s.
    pub offset: f64,
    /// Its standard error, rad/s.
    pub offset_std: f64,
    /// Stretches of 0.2 s, overlapping.
    pub stretches: u64,
    /// Blocks of time from whose spread the errors come.
    pub blocks: usize,
}

/// A gain within this of 1 is as good as 1: it changes friction and inertia by less than they are known, and every joint
/// of the Go2s whose logs we have reports 0.4 to 1.6 % too much.
pub const TOLERATED_GAIN: f64 = 0.02;

/// Chance, over all joints of a log, to find fault with a gain that is within [`TOLERATED_GAIN`].
pub const FALSE_ALARM: f64 = 0.001;

impl VelocityGain {
    /// Whether the gain differs from `reference` by more than [`TOLERATED_GAIN`] beyond reasonable doubt: Student's
    /// test over the blocks at the level [`FALSE_ALARM`], shared among `tests` of them.
    pub fn differs_from(&self, reference: f64, tests: usize) -> bool {
        let excess = (self.gain / reference - 1.0).abs() - TOLERATED_GAIN;
        let freedom = (self.blocks - 1) as f64;
        let student = StudentsT::new(0.0, 1.0, freedom);
        student.is_ok_and(|student| {
            let p = 2.0 * student.sf(excess / self.gain_std.max(f64::MIN_POSITIVE));
            p * tests as f64 <= FALSE_ALARM
        })
    }
}

impl VelocityCheck {
    pub(super) fn new() -> Self {
        Self {
            recent: [Point::default(); STEPS],
            held: 0,
            sums: Blocks::new(),
        }
    }

    /// A gap: no stretch reaches over it.
    pub(super) fn interrupt(&mut self) {
        self.held = 0;
    }

    /// Takes the end of a stretch, one [`STEP`] after the last.
    pub(super) fn push(&mut self, end: Point) {
        if self.held == STEPS {
            self.add(&self.recent[0].clone(), &end);
        } else {
            self.held += 1;
        }
        self.recent.rotate_left(1);
        self.recent[STEPS - 1] = end;
    }

    fn add(&mut self, start: &Point, end: &Point) {
        let x = SVector::from([
            end.q - start.q,
            end.dq - start.dq,
            end.ddq - start.ddq,
            end.t - start.t,
        ]);
        // The excess over Δq, so that a gain of exactly 1 leaves no rounding.
        let y = end.integral - start.integral - x[0];
        let sums = self.sums.at(end.t);
        sums.count += 1.0;
        sums.square += x * x.transpose();
        sums.product += x * y;
    }

    /// The verdict; `quantum` is that of the position, rad. None where the joint hardly moves.
    pub(super) fn result(&self, quantum: f64) -> Option<VelocityGain> {
        let total = self.sums.total();
        // Rms of Δq below half a degree is noise, play and creep.
        if total.square[(0, 0)] < total.count * 0.01f64.powi(2) {
            return None;
        }
        let solve = |sums: &Sums| {
            let mut square = sums.square;
            square[(0, 0)] -= sums.count * quantum * quantum / 6.0;
            let scale = square
                .diagonal()
                .map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
            let scaled = SMatrix::from_diagonal(&scale) * square * SMatrix::from_diagonal(&scale)
                + SMatrix::identity() * 1e-9;
            let x = scaled
                .cholesky()?
                .solve(&sums.product.component_mul(&scale));
            let x = x.component_mul(&scale);
            let gain = 1.0 + x[0];
            (gain > 0.0).then_some([gain, -x[1] / gain, x[3]])
        };
        let (value, std, blocks) = self.sums.jackknife(|sums| sums.count == 0.0, solve)?;
        Some(VelocityGain {
            gain: value[0],
            gain_std: std[0],
            lag: value[1],
            lag_std: std[1],
            offset: value[2],
            offset_std: std[2],
            stretches: total.count as u64,
            blocks,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DataGates, Joint, Reading};
    use super::*;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, Normal};

    /// How a sensor reports a motion.
    #[derive(Debug, Clone, Copy)]
    struct Sensor {
        gain: f64,
        lag: f64,
        offset: f64,
        /// Time constant of a first-order filter of the velocity, s.
        filter: f64,
    }

    /// A chirp to 9 Hz as a Go2 would log it: quanta, noise, 5 % repeats.
    fn check(seed: u64, seconds: f64, sensor: Sensor) -> VelocityGain {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, 0.035).unwrap();
        let mut gates = DataGates::new([Joint {
            name: "FR_hip".into(),
            effort: 23.7,
        }]);
        let round = |x: f64, quantum: f64| (x / quantum).round() * quantum;
        let phase = |t: f64| 0.6 * t + 0.5 * 56.0 / seconds * t * t;
        let frequency = |t: f64| 0.6 + 56.0 / seconds * t;
        let mut reading = None;
        for k in 0..(seconds * 500.0) as u64 {
            let t = k as f64 * 2e-3;
            // A filter turns and shrinks a sine; a chirp this slow is one at each moment.
            let (late, w) = (t - sensor.lag, frequency(t - sensor.lag));
            let (cosine, sine) = (phase(late).cos(), phase(late).sin());
            let x = w * sensor.filter;
            let filtered = 0.3 * w * (cosine + x * sine) / (1.0 + x * x);
            let new = Reading {
                q: round(0.3 * phase(t).sin(), 3.028e-5),
                dq: round(
                    sensor.gain * filtered + sensor.offset + noise.sample(&mut random),
                    3.876e-3,
                ),
                tau: 0.0,
                temperature: None,
            };
            if k % 20 != 7 {
                reading = Some(new);
            }
            gates.push(2000 * k, &[reading.unwrap_or(new)]);
        }
        gates.report().joints[0].velocity.unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        /// Gain, lag and offset come back within their errors, whatever the filter.
        #[test]
        fn a_sensor_is_recognised(
            seed in 0u64..1000,
            gain in 0.8..1.25f64,
            lag in -4e-3..4e-3f64,
            offset in -0.1..0.1f64,
            filter in 0.0..4e-3f64,
        ) {
            let found = check(seed, 20.0, Sensor { gain, lag, offset, filter });
            // 9 blocks of freedom: five errors are one in a thousand; and the expansion's own error is (ω d)³/6 ≈ 2 %.
            prop_assert!((found.gain / gain - 1.0).abs() < 5.0 * found.gain_std + 0.01, "{found:?}");
            prop_assert!((found.lag - lag - filter).abs() < 5.0 * found.lag_std + 3e-4, "{found:?}");
            prop_assert!((found.offset - offset).abs() < 5.0 * found.offset_std + 5e-3, "{found:?}");
        }
    }

    /// A sensor without fault is never blamed, though it filters; one that reads 5 % too high always is.
    #[test]
    fn only_a_real_gain_is_significant() {
        let sensor = |gain| Sensor {
            gain,
            lag: 1e-3,
            offset: 0.02,
            filter: 3e-3,
        };
        for seed in 0..100 {
            let good = check(seed, 10.0, sensor(1.01));
            assert!(!good.differs_from(1.0, 12), "seed {seed}: {good:?}");
            let bad = check(seed, 10.0, sensor(1.05));
            assert!(bad.differs_from(1.0, 12), "seed {seed}: {bad:?}");
        }
    }

    #[test]
    fn a_joint_at_rest_has_no_verdict() {
        let mut gates = DataGates::new([Joint {
            name: "FR_hip".into(),
            effort: 23.7,
        }]);
        for k in 0..10_000u64 {
            let reading = Reading {
                q: 3e-5 * (k % 3) as f64,
                dq: 0.01 * (k % 5) as f64,
                tau: 1.0,
                temperature: Some(30.0),
            };
            gates.push(2000 * k, &[reading]);
        }
        let report = gates.report();
        assert_eq!(report.joints[0].velocity, None);
        assert_eq!(report.joints[0].moving_percent, 0.0);
        assert_eq!(report.joints[0].temperature, Some([30.0, 30.0]));
    }
}
