//! Which feet may carry a force: all but those that are surely in the air. The figures are the desktop's too, which looks at a whole log; the
//! board judges eleven samples later.
//!
//! A foot that is eliminated without need costs rows; a force that is not moves the masses. So a foot counts as in the air only if
//!
//! - *torque*: what its leg's motors do beyond what the CAD's leg needs is less than a force of [`FORCE`];
//! - *count*: its sensor reads as low as it does in the air: a share of its own range so far, told by running quantiles. A sensor that
//!   reads nothing has no range and is not asked;
//! - *height*: it is [`HEIGHT`] above the lowest foot that carries a force by torque;
//! - *guard*: and all of that for [`GUARD`] before and after.

use super::leg::{Felt, LegFrame};
use super::smoother::Quiet;
use crate::go2::{self, JOINTS, JOINTS_PER_LEG, LEGS};
use crate::spatial::Transform;
use crate::window::microseconds;
use crate::{Real, scalar::real};
use nalgebra::Vector3;

/// Force at a foot, N, below which a swinging leg's torques cannot tell it from friction and the CAD's errors.
pub const FORCE: f64 = 14.0;
/// Height above the feet on the ground, m: more than the ground's softness (some millimetres) and an error of the tilt (3 mrad over 0.4 m) make.
pub const HEIGHT: f64 = 0.012;
/// Time before and after, s.
pub const GUARD: f64 = 0.016;
/// Accelerations are differences over this time to both sides, s; torques are means over it.
pub const SPREAD: f64 = 0.006;
/// This much time before a touch-down belongs to no window, s: impacts are short and hard, and what one does to the base is smoothed over 6 ms
/// to both sides.
pub const BEFORE_IMPACT: f64 = 0.006;
/// This much after it, s. It is told by torques that are averaged over [`SPREAD`] to both sides, which rise that much before the foot strikes:
/// never late, so the time after it is longer for that.
pub const AFTER_IMPACT: f64 = BEFORE_IMPACT + SPREAD;
/// Low is this share of a sensor's range.
pub const LOW: f64 = 0.25;
/// The range is told by the counts that this share is below and above.
pub const TAIL: f64 = 0.05;
/// A sensor whose range is less reads nothing, counts.
pub const LEAST_RANGE: f64 = 8.0;

/// A time, s, in samples of 2 ms.
const fn samples(time: f64) -> usize {
    (500.0 * time + 0.5) as usize
}

/// [`GUARD`] and [`SPREAD`] in samples.
const GUARD_SAMPLES: usize = samples(GUARD);
const SPREAD_SAMPLES: usize = samples(SPREAD);
/// Bits of the touch-downs that are too near a sample, which is as many samples back as the guard is long; one bit back is one sample back.
const NEAR: u32 = {
    let before = samples(BEFORE_IMPACT);
    ((1 << (before + samples(AFTER_IMPACT) + 1)) - 1) << (GUARD_SAMPLES - before)
};
/// How far a quantile moves with a sample, as a share of the range.
const STEP: f64 = 0.01;

/// Samples kept: those that an acceleration needs, and those that wait for the guard.
const RING: usize = 2 * SPREAD_SAMPLES + 1 + GUARD_SAMPLES - SPREAD_SAMPLES;

/// A sample whose feet are judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Judged<T: Real> {
    pub(super) quiet: Quiet<T>,
    /// Which feet may carry a force.
    pub(super) loaded: [bool; LEGS],
    /// Whether a foot touches down so near that this sample belongs to no window.
    pub(super) impact: bool,
}

/// A foot's sensor: running quantiles of what it reads.
#[derive(Clone, Copy, Debug)]
struct Sensor<T> {
    low: T,
    high: T,
    begun: bool,
}

/// The judge and the samples that wait for it.
#[derive(Clone, Debug)]
pub(super) struct Judge<T: Real> {
    imu: Transform<T>,
    ring: [Quiet<T>; RING],
    next: usize,
    filled: usize,
    sensors: [Sensor<T>; LEGS],
    /// Judged samples since a foot was on the ground.
    since: [usize; LEGS],
    /// Whether the torques told a force, and, bit by bit, whether a foot touched down in one of the last samples.
    pressed: [bool; LEGS],
    touch_downs: u32,
}

impl<T: Real> Judge<T> {
    pub(super) const fn new() -> Self {
        Self {
            imu: super::no_transform(),
            ring: [Quiet::NOTHING; RING],
            next: 0,
            filled: 0,
            sensors: [Sensor {
                low: T::ZERO,
                high: T::ZERO,
                begun: false,
            }; LEGS],
            since: [0; LEGS],
            pressed: [false; LEGS],
            touch_downs: 0,
        }
    }

    pub(super) fn begin(&mut self, imu: &Transform<T>) {
        self.restart();
        self.sensors
            .iter_mut()
            .for_each(|sensor| sensor.begun = false);
        self.imu = *imu;
    }

    /// Forgets the samples, not the sensors' ranges.
    pub(super) fn restart(&mut self) {
        self.filled = 0;
        self.since = [0; LEGS];
        self.pressed = [true; LEGS];
        self.touch_downs = 0;
    }

    /// The n-th of the ring, the oldest first.
    fn at(&self, n: usize) -> &Quiet<T> {
        let place = self.next + n;
        let place = if place >= RING { place - RING } else { place };
        self.ring.get(place).unwrap_or(&self.ring[0])
    }

    /// Takes the next sample; tells the oldest one's feet, if enough is known.
    pub(super) fn push(
        &mut self,
        quiet: &Quiet<T>,
        legs: &[LegFrame<T>; LEGS],
    ) -> Option<Judged<T>> {
        if let Some(place) = self.ring.get_mut(self.next) {
            *place = *quiet;
        }
        self.next = if self.next + 1 >= RING {
            0
        } else {
            self.next + 1
        };
        self.filled = (self.filled + 1).min(RING);
        for (sensor, count) in self.sensors.iter_mut().zip(&quiet.sample.count) {
            sensor.read(*count);
        }
        if self.filled < RING {
            return None;
        }
        self.judge(legs);
        Some(Judged {
            quiet: *self.at(0),
            loaded: self.since.map(|since| since <= 2 * GUARD_SAMPLES),
            impact: self.touch_downs & NEAR != 0,
        })
    }

    /// Judges the sample that has [`SPREAD`] after it.
    fn judge(&mut self, legs: &[LegFrame<T>; LEGS]) {
        let (force, height, count) = self.told(legs);
        let far = real::<T>(1e9);
        let pressed = force.map(|force| (force >= real(FORCE)) | !force.is_finite());
        let mut ground = far;
        for f in 0..LEGS {
            ground = ground.min(if pressed[f] { height[f] } else { far });
        }
        let mut touch_down = false;
        for f in 0..LEGS {
            let low = height[f] < ground + real(HEIGHT) && ground < far;
            let grounded = pressed[f] | self.sensors[f].speaks(count[f]) | low;
            let since = self.since[f].saturating_add(1);
            self.since[f] = if grounded { 0 } else { since };
            touch_down |= pressed[f] & !self.pressed[f];
        }
        self.pressed = pressed;
        self.touch_downs = self.touch_downs << 1 | u32::from(touch_down);
    }

    /// Each foot's force (N) by its leg's torques, its height (m) along gravity in the base's frame, and what its sensor reads.
    #[inline(never)]
    fn told(&self, legs: &[LegFrame<T>; LEGS]) -> ([T; LEGS], [T; LEGS], [T; LEGS]) {
        let newest = RING - 1;
        let middle = self.at(newest - SPREAD_SAMPLES);
        let (first, last) = (
            &self.at(newest - 2 * SPREAD_SAMPLES).sample,
            &self.at(newest).sample,
        );
        let span = last.joints.time_us.saturating_sub(first.joints.time_us);
        let per_second = T::one() / microseconds::<T>(span.max(1));
        let share = real::<T>(1.0 / (2 * SPREAD_SAMPLES + 1) as f64);
        let (mut dq, mut tau, mut acc) =
            ([T::zero(); JOINTS], [T::zero(); JOINTS], Vector3::zeros());
        for n in 0..=2 * SPREAD_SAMPLES {
            let sample = &self.at(newest - n).sample;
            for j in 0..JOINTS {
                dq[j] += sample.joints.dq[j] * share;
                tau[j] += sample.joints.tau[j] * share;
            }
            acc += sample.acc * share;
        }
        let axes = &self.imu.rotation;
        let (down, w) = (axes * middle.down, axes * middle.sample.gyro);
        let turning = axes * (last.gyro - first.gyro) * per_second;
        let r = &self.imu.translation;
        // An accelerometer cannot tell acceleration from gravity, nor can the joints.
        let base = Felt {
            w,
            turning,
            specific: axes * acc - turning.cross(r) - w.cross(&w.cross(r)),
        };
        let mut force = [T::zero(); LEGS];
        let mut height = [T::zero(); LEGS];
        for (leg, frame) in legs.iter().enumerate() {
            let joint = |j: usize| JOINTS_PER_LEG * leg + j;
            let own = |x: &[T; JOINTS]| core::array::from_fn(|j| x[joint(j)]);
            let posture = frame.posture(&own(&middle.sample.joints.q));
            let ddq = core::array::from_fn(|j| {
                (last.joints.dq[joint(j)] - first.joints.dq[joint(j)]) * per_second
            });
            let foot = frame.foot(&posture, &down);
            let needed = frame.torques(&posture, &own(&dq), &ddq, &base);
            let left = core::array::from_fn(|j| {
                let armature = real::<T>(go2::ACTUATORS[j].armature());
                needed[j] - tau[joint(j)] + armature * ddq[j]
            });
            force[leg] = foot.force(&left);
            height[leg] = -down.dot(&foot.centre);
        }
        (force, height, middle.sample.count)
    }
}

impl<T: Real> Sensor<T> {
    /// Moves the quantiles towards what is read.
    fn read(&mut self, count: T) {
        let count = if count.is_finite() { count } else { self.low };
        if !self.begun {
            (self.low, self.high, self.begun) = (count, count, true);
        }
        let step = (self.high - self.low).max(real(LEAST_RANGE)) * real(STEP);
        let moved = |quantile: T, tail: f64| {
            let below = if count < quantile {
                T::one()
            } else {
                T::zero()
            };
            quantile + step * (real::<T>(tail) - below)
        };
        self.low = moved(self.low, TAIL);
        self.high = moved(self.high, 1.0 - TAIL).max(self.low);
    }

    /// Whether a count speaks of a force.
    fn speaks(&self, count: T) -> bool {
        let range = self.high - self.low;
        (range >= real(LEAST_RANGE)) & (count > self.low + range * real(LOW))
    }
}
