//! Samples in, quieter ones out, five samples later: what multiplies a parameter is made of velocities, and noise there pulls the
//! parameter to zero.
//!
//! The desktop's `free_base::speed`, a sample at a time: a joint's velocity is the slope of its position where that is quieter than the
//! reported one, told by the third differences of both so far; the gyro is smoothed by the parabola through the samples within 10 ms
//! (Savitzky & Golay 1964). Gravity's direction is that of [`GravityDirection`], which begins as a plain mean.

use super::WalkSample;
use crate::contact::GravityDirection;
use crate::go2::JOINTS;
use crate::scalar::sqrt;
use crate::tree::GRAVITY;
use crate::window::microseconds;
use crate::{Real, scalar::real};
use nalgebra::Vector3;

/// Samples to both sides.
pub(super) const SIDE: usize = 5;
const RING: usize = 2 * SIDE + 1;
/// The gyro's parabola reaches this far, s.
const REACH: f64 = 0.0101;
/// Steps longer than this are no slope, s.
const LONGEST: f64 = 0.005;
/// Steps that differ by more than this share of their mean are not even.
const UNEVEN: f64 = 0.02;
/// The accelerometer's mean forgets over this, s.
const TIME_CONSTANT: f64 = 2.0;
/// What is known of a channel's noise is forgotten by this share a sample: over 8 s.
const FORGET: f64 = 1.0 / 4096.0;

/// A sample made quieter.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quiet<T: Real> {
    pub(super) sample: WalkSample<T>,
    /// Unit vector along gravity, in the IMU's axes.
    pub(super) down: Vector3<T>,
}

impl<T: Real> Quiet<T> {
    pub(super) const NOTHING: Self = Self {
        sample: WalkSample::NOTHING,
        down: Vector3::new(T::ZERO, T::ZERO, T::ZERO),
    };
}

/// The last samples.
#[derive(Clone, Debug)]
pub(super) struct Smoother<T: Real> {
    ring: [Quiet<T>; RING],
    /// Where the next one goes, and how many there are.
    next: usize,
    filled: usize,
    /// Minus the mean specific force, m/s², and since when, s.
    gravity: Vector3<T>,
    age: T,
    /// The last three velocities, reported and slopes, and the mean square of their third differences.
    before: [[[T; JOINTS]; 3]; 2],
    noise: [[T; JOINTS]; 2],
}

impl<T: Real> Smoother<T> {
    pub(super) const fn new() -> Self {
        Self {
            ring: [Quiet::NOTHING; RING],
            next: 0,
            filled: 0,
            gravity: Vector3::new(T::ZERO, T::ZERO, T::ZERO),
            age: T::ZERO,
            before: [[[T::ZERO; JOINTS]; 3]; 2],
            noise: [[T::ZERO; JOINTS]; 2],
        }
    }

    /// Forgets all, in place.
    pub(super) fn begin(&mut self) {
        self.filled = 0;
        self.age = T::zero();
        self.before
            .as_flattened_mut()
            .as_flattened_mut()
            .fill(T::zero());
        self.noise.as_flattened_mut().fill(T::zero());
    }

    /// Forgets the samples, not what is known of noise and gravity.
    pub(super) fn restart(&mut self) {
        self.filled = 0;
    }

    /// The sample taken last.
    pub(super) fn last(&self) -> Option<&WalkSample<T>> {
        (self.filled > 0).then(|| &self.at(RING - 1).sample)
    }

    /// The n-th of the ring, the oldest first.
    fn at(&self, n: usize) -> &Quiet<T> {
        let place = self.next + n;
        let place = if place >= RING { place - RING } else { place };
        // Always there; written so that nothing can panic.
        self.ring.get(place).unwrap_or(&self.ring[0])
    }

    /// Takes a sample `step_us` after the last one, and gives the one in the middle, if there are enough.
    pub(super) fn push(&mut self, sample: &WalkSample<T>, step_us: u64) -> Option<Quiet<T>> {
        let down = self.turn_gravity(sample, step_us);
        if let Some(place) = self.ring.get_mut(self.next) {
            *place = Quiet {
                sample: *sample,
                down,
            };
        }
        self.next = if self.next + 1 >= RING {
            0
        } else {
            self.next + 1
        };
        self.filled = (self.filled + 1).min(RING);
        (self.filled == RING).then(|| self.middle())
    }

    /// Gravity's direction at a sample.
    fn turn_gravity(&mut self, sample: &WalkSample<T>, step_us: u64) -> Vector3<T> {
        let zero = self.age == T::zero();
        let start = if zero { -sample.acc } else { self.gravity };
        let mut filter = GravityDirection::new(&-start);
        let dt = microseconds::<T>(step_us).min(real(0.1));
        self.age = (self.age + dt.max(real(1e-6))).min(real(TIME_CONSTANT));
        filter.update(&sample.gyro, &sample.acc, dt, self.age.max(real(0.02)));
        self.gravity = filter.mean();
        let square = self.gravity.dot(&self.gravity);
        self.gravity * square.max(real(1e-6)).inverse_sqrt()
    }

    fn middle(&mut self) -> Quiet<T> {
        let mut quiet = *self.at(SIDE);
        quiet.sample.gyro = self.smoothed();
        let steps: [T; 4] = core::array::from_fn(|n| {
            let time = |n: usize| self.at(SIDE - 2 + n).sample.joints.time_us;
            microseconds(time(n + 1).saturating_sub(time(n)))
        });
        let mean = (steps[0] + steps[1] + steps[2] + steps[3]) * real(0.25);
        let even = steps
            .iter()
            .all(|step| (*step - mean).abs() <= mean * real(UNEVEN));
        let per_12 = T::one() / (mean * real(12.0));
        let per_both = T::one() / (steps[1] + steps[2]);
        let shares = [steps[2] * per_both, steps[1] * per_both];
        let q: [[T; JOINTS]; 4] = [3, 4, 6, 7].map(|n| self.at(n).sample.joints.q);
        let center = quiet.sample.joints;
        let [left, right] = [steps[1], steps[2]].map(|step| T::one() / step);
        let mut slopes = [T::zero(); JOINTS];
        for j in 0..JOINTS {
            let slope = if even {
                (real::<T>(8.0) * (q[2][j] - q[1][j]) - (q[3][j] - q[0][j])) * per_12
            } else {
                let before = (center.q[j] - q[1][j]) * left;
                let after = (q[2][j] - center.q[j]) * right;
                before * shares[0] + after * shares[1]
            };
            slopes[j] = slope;
        }
        self.listen(0, &center.dq);
        self.listen(1, &slopes);
        let fast = mean <= real(LONGEST);
        for j in 0..JOINTS {
            let quieter = self.noise[1][j] < self.noise[0][j];
            if fast & quieter {
                quiet.sample.joints.dq[j] = slopes[j];
            }
        }
        quiet
    }

    /// What of a channel no motion explains: the mean square of its third differences.
    fn listen(&mut self, channel: usize, now: &[T; JOINTS]) {
        let ([a, b, c], noise) = (&mut self.before[channel & 1], &mut self.noise[channel & 1]);
        for j in 0..JOINTS {
            let third = now[j] - real::<T>(3.0) * (c[j] - b[j]) - a[j];
            noise[j] += (third * third - noise[j]) * real(FORGET);
        }
        *a = *b;
        *b = *c;
        *c = *now;
    }

    /// The value in the middle of the parabola through the gyro's samples around it: with powers 1, x, x² of x = t / reach the first of
    /// three parameters, by Cramer's rule.
    fn smoothed(&self) -> Vector3<T> {
        let middle = self.at(SIDE).sample.joints.time_us;
        let mut s = [T::zero(); 5];
        let mut sums = [Vector3::zeros(); 3];
        for n in 0..RING {
            let sample = &self.at(n).sample;
            let time = sample.joints.time_us;
            let away = microseconds::<T>(time.abs_diff(middle)) * real(1.0 / REACH);
            let x = if time < middle { -away } else { away };
            let counts = if away <= T::one() {
                T::one()
            } else {
                T::zero()
            };
            let mut power = counts;
            for (k, s) in s.iter_mut().enumerate() {
                *s += power;
                if let Some(sum) = sums.get_mut(k) {
                    *sum += sample.gyro * power;
                }
                power *= x;
            }
        }
        let [s0, s1, s2, s3, s4] = s;
        let minors = [s2 * s4 - s3 * s3, s2 * s3 - s1 * s4, s1 * s3 - s2 * s2];
        let whole = s0 * minors[0] + s1 * minors[1] + s2 * minors[2];
        // Fewer than three samples within reach have no parabola.
        let none = whole <= real(1e-9);
        let per_whole = T::one() / if none { T::one() } else { whole };
        let fitted = (sums[0] * minors[0] + sums[1] * minors[1] + sums[2] * minors[2]) * per_whole;
        if none {
            self.at(SIDE).sample.gyro
        } else {
            fitted
        }
    }
}

/// The length of the mean specific force in axes that the gyro keeps from turning, over stretches of 2 s: gravity, but for what the
/// velocity has changed by. A robot that does not leave the ground for good is accelerated by gravity on average, so that this tells
/// the accelerometer's bias along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct GravityLength<T: Real> {
    turned: [Vector3<T>; 3],
    sum: Vector3<T>,
    up: Vector3<T>,
    seconds: T,
    /// Of whole stretches.
    lengths: T,
    ups: Vector3<T>,
    all: T,
}

/// Length of a stretch, s.
const STRETCH: f64 = 2.0;
/// Vertical velocity that a robot may have when its log begins or ends, m/s.
const VERTICAL_SPEED: f64 = 0.2;

impl<T: Real> GravityLength<T> {
    pub(super) const fn new() -> Self {
        let zero = Vector3::new(T::ZERO, T::ZERO, T::ZERO);
        Self {
            turned: [zero; 3],
            sum: zero,
            up: zero,
            seconds: T::ZERO,
            lengths: T::ZERO,
            ups: zero,
            all: T::ZERO,
        }
    }

    /// Begins a stretch anew.
    pub(super) fn restart(&mut self) {
        self.seconds = T::zero();
    }

    /// The time from one sample to the next.
    pub(super) fn add(&mut self, last: &Quiet<T>, now: &Quiet<T>) {
        let (a, b) = (&last.sample, &now.sample);
        let step_us = b.joints.time_us.saturating_sub(a.joints.time_us);
        let half = microseconds::<T>(step_us) * real(0.5);
        let begins = self.seconds == T::zero();
        if begins {
            self.turned = [Vector3::x(), Vector3::y(), Vector3::z()];
            self.sum = Vector3::zeros();
            self.up = Vector3::zeros();
        }
        // The rotation's columns, each turned by the body's rotation from right.
        let step = super::pose::turned(&((a.gyro + b.gyro) * half));
        let [x, y, z] = self.turned;
        let mix = |v: Vector3<T>| x * v.x + y * v.y + z * v.z;
        let next = [0, 1, 2].map(|n| mix(step.column(n).into_owned()));
        let [nx, ny, nz] = next;
        self.sum += (mix(a.acc) + nx * b.acc.x + ny * b.acc.y + nz * b.acc.z) * half;
        self.up -= last.down * (half * real(2.0));
        self.turned = next;
        self.seconds += half * real(2.0);
        let ends = self.seconds >= real(STRETCH);
        let counts = if ends { T::one() } else { T::zero() };
        self.lengths += sqrt(self.sum.dot(&self.sum)) * counts;
        self.ups += self.up * counts;
        self.all += self.seconds * counts;
        if ends {
            self.seconds = T::zero();
        }
    }

    /// The equation for the bias: its three coefficients and the right-hand side, in units of its noise. Zeros before the first stretch.
    pub(super) fn row(&self) -> [T; 4] {
        let none = self.all == T::zero();
        let per_second = if none { T::zero() } else { T::one() / self.all };
        let weight = self.all * real(1.0 / (VERTICAL_SPEED * core::f64::consts::SQRT_2));
        let up = self.ups * (per_second * weight);
        let excess = (self.lengths * per_second - real(GRAVITY)) * weight;
        [up.x, up.y, up.z, if none { T::zero() } else { excess }]
    }
}
