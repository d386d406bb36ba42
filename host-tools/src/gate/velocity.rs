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
const AROUND: usize = 9;

/// Time between the ends of stretches, s, and how many of it make a stretch of 0.2 s.
const STEP: f64 = 0.05;
const STEPS: usize = 4;

/// What is known of a joint at an instant, from positions alone except for the integral.
#[derive(Debug, Clone, Copy, Default)]
struct Point {
    t: f64,
    integral: f64,
    q: f64,
    dq: f64,
    ddq: f64,
}

/// The times of the last samples, which all joints share, and when stretches end.
#[derive(Debug, Clone, Default)]
pub(in super::super) struct Times {
    /// s since the log's first sample.
    last: [f64; AROUND],
    /// How many there are since the last gap.
    held: usize,
    /// When the next stretch ends, s.
    next_end: f64,
}

impl Times {
    /// Takes a sample's time, s; `anew`: it is the first, or the first after a gap. The parabola around the middle of the
    /// last samples, if a stretch ends there.
    pub(in super::super) fn push(&mut self, now: f64, anew: bool) -> Option<Parabola> {
        if anew {
            (self.held, self.next_end) = (0, 0.0);
        }
        self.last.rotate_left(1);
        self.last[AROUND - 1] = now;
        self.held = (self.held + 1).min(AROUND);
        let middle = self.last[AROUND / 2];
        if self.held < AROUND || middle < self.next_end {
            return None;
        }
        self.next_end = middle + STEP;
        Parabola::at(&self.last)
    }
}

/// A joint's motion around the present: the last positions and integrals of the velocity.
#[derive(Debug, Clone, Default)]
struct Trail {
    q: [f64; AROUND],
    integral: [f64; AROUND],
    last_dq: f64,
}

impl Trail {
    fn push(&mut self, dt: f64, q: f64, dq: f64) {
        self.q.rotate_left(1);
        self.integral.rotate_left(1);
        self.q[AROUND - 1] = q;
        self.integral[AROUND - 1] = self.integral[AROUND - 2] + 0.5 * dt * (self.last_dq + dq);
        self.last_dq = dq;
    }

    fn middle(&self, fit: &Parabola) -> Point {
        let [q, dq, ddq] = fit.through(&self.q);
        Point {
            t: fit.middle,
            integral: self.integral[AROUND / 2],
            q,
            dq,
            ddq,
        }
    }
}

/// The least-squares parabola through values at given times: its value, slope and curvature at the middle one.
#[derive(Debug, Clone)]
pub(in super::super) struct Parabola {
    /// s.
    middle: f64,
    weights: SMatrix<f64, 3, AROUND>,
}

impl Parabola {
    /// None if the times do not carry a parabola.
    fn at(times: &[f64; AROUND]) -> Option<Self> {
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
            .then_some(Self { middle, weights })
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
    /// Σ (∫q̇ dt − Δq)².
    excess: f64,
}

impl Sums {
    /// Gain, lag and offset; `quantum` is that of the position, rad.
    fn solve(&self, quantum: f64) -> Option<[f64; 3]> {
        let mut square = self.square;
        square[(0, 0)] -= self.count * quantum * quantum / 6.0;
        let scale = square
            .diagonal()
            .map(|d| if d > 0.0 { d.sqrt().recip() } else { 0.0 });
        let scaled = SMatrix::from_diagonal(&scale) * square * SMatrix::from_diagonal(&scale)
            + SMatrix::identity() * 1e-9;
        let x = scaled
            .cholesky()?
            .solve(&self.product.component_mul(&scale));
        let x = x.component_mul(&scale);
        let gain = 1.0 + x[0];
        (gain > 0.0).then_some([gain, -x[1] / gain, x[3]])
    }

    /// Σ (∫q̇ dt / gain − Δq)².
    fn misfit(&self, gain: f64) -> f64 {
        let (moved, product) = (self.square[(0, 0)], self.product[0]);
        let integral = self.excess + 2.0 * product + moved;
        integral / (gain * gain) - 2.0 * (product + moved) / gain + moved
    }
}

impl Merge for Sums {
    fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.square += other.square;
        self.product += other.product;
        self.excess += other.excess;
    }
}

/// What the stretches of a joint say of its reported velocity.
#[derive(Debug, Clone)]
pub(in super::super) struct VelocityCheck {
    trail: Trail,
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
    /// A check whose errors come from the spread over blocks of time of `length` s.
    pub(in super::super) fn over_blocks_of(length: f64) -> Self {
        Self {
            trail: Trail::default(),
            recent: [Point::default(); STEPS],
            held: 0,
            sums: Blocks::of_length(length),
        }
    }

    /// A gap: no stretch reaches over it.
    pub(in super::super) fn interrupt(&mut self) {
        self.held = 0;
    }

    /// Takes a sample `dt` seconds after the last; 0 starts anew.
    pub(in super::super) fn push(&mut self, dt: f64, q: f64, dq: f64) {
        self.trail.push(dt, q, dq);
    }

    /// A stretch ends in the middle of the last samples.
    pub(in super::super) fn end_stretch(&mut self, around: &Parabola) {
        let end = self.trail.middle(around);
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
        sums.excess += y * y;
    }

    /// The verdict; `quantum` is that of the position, rad. None where the joint hardly moves.
    pub(in super::super) fn result(&self, quantum: f64) -> Option<VelocityGain> {
        let total = self.sums.total();
        // Rms of Δq below half a degree is noise, play and creep.
        if total.square[(0, 0)] < total.count * 0.01f64.powi(2) {
            return None;
        }
        let solve = |sums: &Sums| sums.solve(quantum);
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

    /// What the gain does where it was not found: 1 − Σ (∫q̇ dt / g − Δq)² over that with g = 1, each block with the gain of
    /// all others; and its error, from the spread over blocks. None where a block's others have no verdict.
    pub(in super::super) fn held_out_gain(&self, quantum: f64) -> Option<[f64; 2]> {
        let blocks = self.sums.each_and_rest(|sums| sums.count == 0.0);
        let (mut falls, mut before) = (Vec::new(), 0.0);
        for (own, rest) in &blocks {
            let [gain, ..] = rest.solve(quantum)?;
            falls.push(own.misfit(1.0) - own.misfit(gain));
            before += own.misfit(1.0);
        }
        let n = falls.len() as f64;
        let fall: f64 = falls.iter().sum();
        let scatter: f64 = falls.iter().map(|x| (x - fall / n).powi(2)).sum();
        (before > 0.0 && n > 1.0)
            .then(|| [fall / before, (scatter * n / (n - 1.0)).sqrt() / before])
    }
}

#[cfg(test)]
mod tests;
