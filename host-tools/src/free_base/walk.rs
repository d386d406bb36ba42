//! A log of the whole robot with its IMU, as the rows of a free base need it.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use proprio_core::tree::GRAVITY;

use nalgebra::{Rotation3, Vector3};

use super::channels::Channels;
use super::error::FreeBaseError;
use super::legged::Legged;
use super::stiction::Rest;
use crate::log::{LogReader, Samples, Selection};
use crate::model::Robot;

/// Length of the stretches over which the mean specific force is told, s: a gyro's bias turns nothing much meanwhile.
const STRETCH: f64 = 2.0;
/// After a longer pause than this (s) nothing is known of how the IMU's axes have turned.
const LONGEST_STEP: f64 = 0.1;
/// Vertical velocity that a robot may have in the second in which a log begins or ends, on average, m/s: on its feet, which let it rise or sink by
/// some centimetres, and swung by hand.
const VERTICAL_SPEED: [f64; 2] = [0.05, 0.5];
/// What a velocity that changes sideways adds to the length of the mean specific force, m/s²: 0.3 m/s² beside gravity.
const SIDEWAYS: f64 = 0.005;

/// A sample of a motion as the robot's sensors would read it if they had no noise.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Played {
    /// s.
    pub(crate) t: f64,
    /// Joint positions, rad.
    pub(crate) q: Vec<f64>,
    /// rad/s.
    pub(crate) dq: Vec<f64>,
    /// Motor torques, N m.
    pub(crate) tau: Vec<f64>,
    /// Angular velocity at the IMU, rad/s.
    pub(crate) gyro: Vector3<f64>,
    /// Specific force at the IMU, m/s².
    pub(crate) acc: Vector3<f64>,
    /// Unit vector along gravity in the IMU's axes.
    pub(crate) down: Vector3<f64>,
}

/// The samples of a log, without those that repeat the one before.
#[derive(Clone)]
pub(crate) struct Walk {
    pub(super) path: PathBuf,
    /// Whether an IMU was recorded. Without, the trunk is taken to be level and not to be accelerated.
    pub(super) imu: bool,
    pub(super) time_us: Vec<u64>,
    pub(crate) q: Channels,
    pub(crate) dq: Channels,
    pub(crate) tau: Channels,
    pub(super) gyro: Vec<Vector3<f64>>,
    /// As the gyro was read; none where it was not smoothed.
    pub(super) gyro_read: Vec<Vector3<f64>>,
    pub(super) acc: Vec<Vector3<f64>>,
    /// Unit vector along gravity in the IMU's axes.
    pub(super) down: Vec<Vector3<f64>>,
    /// What the feet read, where recorded; not a number of a foot without a sensor.
    pub(super) count: Option<Channels>,
    pub(super) samples: Samples,
    /// The time between samples, the middle one, s.
    pub(crate) period: f64,
    /// Joints near standstill, by their velocities as they were smoothed.
    pub(crate) rest: Arc<Rest>,
}

/// What a log tells of the accelerometer's bias along gravity: a robot that does not leave the ground for good is accelerated by
/// gravity on average.
pub(super) struct GravityTold {
    /// The direction up, in the IMU's axes, on average.
    pub(super) up: Vector3<f64>,
    /// How much too long the mean specific force is, m/s².
    pub(super) excess: f64,
    /// Its standard deviation.
    pub(super) std: f64,
}

impl Walk {
    /// As it was recorded: without gravity's direction, and without what is known of joints at rest.
    pub(super) fn read(
        path: &Path,
        (robot, legged): (&Robot, &Legged),
    ) -> Result<(Self, Vec<String>), FreeBaseError> {
        let mut log = LogReader::open_of(path, Selection::Everything, robot)?;
        let missing = |what: &'static str| FreeBaseError::Missing {
            path: path.to_owned(),
            what,
        };
        let columns = log.columns();
        if columns.joints().count() < legged.joints() {
            return Err(missing("all joints of all legs"));
        }
        let imu = match (columns.has_gyro(), columns.has_acc()) {
            (true, true) => true,
            (false, false) => false,
            (false, _) => return Err(missing("gyro/x|y|z")),
            (_, false) => return Err(missing("acc/x|y|z")),
        };
        let mut walk = Self::empty(path, legged, columns.has_feet());
        walk.imu = imu;
        let mut start = None;
        while let Some(row) = log.next_row()? {
            let t = row.t() - *start.get_or_insert(row.t());
            let (q, dq, tau) = (row.q(), row.dq(), row.tau());
            walk.samples.total += 1;
            let time_us = (t * 1e6).round() as u64;
            let before = [&walk.q, &walk.dq, &walk.tau].map(Channels::last);
            if before == [Some(q), Some(dq), Some(tau)] {
                walk.samples.repeated += 1;
                continue;
            }
            if walk.time_us.last().is_some_and(|last| time_us <= *last) {
                walk.samples.late += 1;
                continue;
            }
            let (gyro, acc) = match imu {
                true => (*row.gyro(), *row.acc()),
                false => ([0.0; 3], [0.0, 0.0, GRAVITY]),
            };
            if !gyro.iter().chain(&acc).all(|x| x.is_finite()) {
                walk.samples.rejected += 1;
                continue;
            }
            walk.time_us.push(time_us);
            walk.q.push(q);
            walk.dq.push(dq);
            walk.tau.push(tau);
            walk.gyro.push(gyro.into());
            walk.acc.push(acc.into());
            if let Some(count) = &mut walk.count {
                let of = |foot: &super::legged::LeggedFoot| match foot.sensor {
                    true => row.foot().get(foot.limb).copied().unwrap_or(f64::NAN),
                    false => f64::NAN,
                };
                count.push(&legged.feet.iter().map(of).collect::<Vec<_>>());
            }
        }
        walk.period = walk.middle_step();
        let warnings = log.finish()?;
        let warnings = warnings.iter().map(|w| format!("{}: {w}", path.display()));
        let warnings = warnings.collect();
        Ok((walk, warnings))
    }

    /// A motion that was not recorded, its samples in the order of time: nothing is smoothed, for nothing has noise.
    pub(super) fn of_motion(played: &[Played], legged: &Legged) -> Self {
        let mut walk = Self::empty(Path::new(""), legged, false);
        walk.time_us = played.iter().map(|s| (s.t * 1e6).round() as u64).collect();
        for sample in played {
            walk.q.push(&sample.q);
            walk.dq.push(&sample.dq);
            walk.tau.push(&sample.tau);
        }
        walk.gyro = played.iter().map(|s| s.gyro).collect();
        walk.acc = played.iter().map(|s| s.acc).collect();
        walk.down = played.iter().map(|s| s.down).collect();
        walk.period = walk.middle_step();
        walk.rest = Arc::new(Rest::of(&walk.dq, walk.period));
        walk
    }

    fn empty(path: &Path, legged: &Legged, feet: bool) -> Self {
        let none = || Channels::new(legged.joints());
        Self {
            path: path.to_owned(),
            imu: true,
            time_us: Vec::new(),
            q: none(),
            dq: none(),
            tau: none(),
            gyro: Vec::new(),
            gyro_read: Vec::new(),
            acc: Vec::new(),
            down: Vec::new(),
            count: feet.then(|| Channels::new(legged.feet.len())),
            samples: Samples::default(),
            period: 0.0,
            rest: Arc::new(Rest::of(&none(), 0.0)),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.time_us.len()
    }

    pub(super) fn duration(&self) -> f64 {
        self.time_us.last().map_or(0.0, |us| *us as f64 * 1e-6)
    }

    pub(crate) fn seconds(&self, n: usize) -> f64 {
        self.time_us[n] as f64 * 1e-6
    }

    /// The first sample at this time or later; the number of samples if there is none.
    pub(crate) fn index_at(&self, seconds: f64) -> usize {
        self.time_us
            .partition_point(|t| (*t as f64) < seconds * 1e6)
    }

    /// The rate of change at sample n of what is read at each sample, by its neighbours; zero beside a gap.
    pub(super) fn rate(&self, n: usize, of: impl Fn(usize) -> f64) -> f64 {
        let (before, after) = (n.saturating_sub(1), (n + 1).min(self.len() - 1));
        let time = self.seconds(after) - self.seconds(before);
        if time > 0.0 && time < 3.0 * self.period {
            (of(after) - of(before)) / time
        } else {
            0.0
        }
    }

    fn middle_step(&self) -> f64 {
        let mut steps: Vec<u64> = self.time_us.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_unstable();
        steps
            .get(steps.len() / 2)
            .map_or(0.0, |us| *us as f64 * 1e-6)
    }

    /// The mean of the specific force in axes that the gyro keeps from turning, over stretches of two seconds: gravity, but for
    /// what the velocity has changed by. Stretches overlap by half under Hann's window, so that all of them weigh each instant alike and
    /// the log begins and ends gently: a step's velocity, at whatever moment of it the log is cut, is no vertical motion of a second.
    /// `held` by a hand, a robot moves faster.
    pub(super) fn gravity(&self, held: bool) -> Option<GravityTold> {
        if !self.imu {
            return None;
        }
        let (mut lengths, mut up, mut count) = (0.0, Vector3::zeros(), 0.0);
        let mut pieces = 0.0;
        for piece in self.pieces() {
            let before = count;
            let mut first = piece.start;
            loop {
                let last = self.index_at(self.seconds(first) + STRETCH);
                if last >= piece.end {
                    break;
                }
                let (specific, own_up) = self.stretch(first, last);
                lengths += specific.norm();
                up += own_up;
                count += 1.0;
                first = self.index_at(self.seconds(first) + STRETCH / 2.0);
            }
            pieces += f64::from(u8::from(count > before));
        }
        // Each piece begins and ends with a velocity of its own.
        let speed = VERTICAL_SPEED[usize::from(held)] * f64::sqrt(2.0 * pieces);
        (count > 0.0).then(|| GravityTold {
            up: up / count,
            excess: lengths / count - GRAVITY,
            std: (speed / (count * STRETCH / 2.0)).hypot(SIDEWAYS),
        })
    }

    /// The samples without a long pause between them: across one nothing tells how the axes have turned.
    pub(super) fn pieces(&self) -> Vec<Range<usize>> {
        let mut pieces = Vec::new();
        let mut first = 0;
        for n in 1..=self.len() {
            if n == self.len() || self.seconds(n) - self.seconds(n - 1) > LONGEST_STEP {
                pieces.push(first..n);
                first = n;
            }
        }
        pieces
    }

    /// Means over a stretch under Hann's window: the specific force in the axes of its beginning, and the direction up in the IMU's.
    fn stretch(&self, first: usize, last: usize) -> (Vector3<f64>, Vector3<f64>) {
        let [start, end] = [first, last].map(|n| self.seconds(n));
        let weight = |n: usize| {
            let phase = std::f64::consts::TAU * (self.seconds(n) - start) / (end - start);
            0.5 * (1.0 - phase.cos())
        };
        let (mut turned, mut sum) = (Rotation3::identity(), Vector3::zeros());
        let (mut up, mut weights) = (Vector3::zeros(), 0.0);
        for n in first..last {
            let half = 0.5 * (self.seconds(n + 1) - self.seconds(n));
            let next =
                turned * Rotation3::from_scaled_axis((self.gyro[n] + self.gyro[n + 1]) * half);
            let [own, after] = [n, n + 1].map(|n| weight(n) * half);
            sum += turned * self.acc[n] * own + next * self.acc[n + 1] * after;
            up -= self.down[n] * own + self.down[n + 1] * after;
            weights += own + after;
            turned = next;
        }
        (sum / weights, up / weights)
    }
}
