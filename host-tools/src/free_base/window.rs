//! Windows of the momentum equation of a robot on a free base, row by row: [`proprio_core::window::FreeBaseWindow`], whose documentation derives
//! it, for any number of bodies, joints and feet, and for samples that were judged before. A test holds the two against each other on a Go2.

use nalgebra::Vector3;
use proprio_core::inertia::INERTIAL;
use proprio_core::spatial::{Motion, Transform};
use proprio_core::window::Settings;

use super::legged::Legged;
use super::projector::Projector;
use super::sensors::Sensors;
use super::stance::Stance;
use super::walk::Walk;
use crate::equation::free_tree::{FreeTree, Moving, OF_BASE, Run};

/// What became of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Push {
    Used,
    /// A window was closed, by it or just before it.
    Closed,
    /// A foot touched down or lifted off, and the open window, too short for rows, is lost.
    Cut,
    /// The time since the last one is not bridged; the open window is lost.
    Gap,
    /// It cannot be true.
    Rejected,
}

/// The rows of one closed window: mean generalised forces per unit of the parameter, times the scale.
#[derive(Debug, Clone, Default)]
pub(super) struct WindowRows {
    /// Start and end, µs.
    pub(super) span_us: [u64; 2],
    /// Equations that contact forces leave, of those that are not left out.
    pub(super) rank: usize,
    /// Joints whose equations are left out.
    pub(super) resting: Vec<bool>,
    bodies: usize,
    /// Coordinate by coordinate, of each body.
    inertial: Vec<Run>,
    /// The columns of the accelerometer's bias, per m/s², in the IMU's axes.
    pub(super) acceleration: Vec<[f64; 3]>,
    /// The right-hand side.
    pub(super) torque: Vec<f64>,
}

impl WindowRows {
    fn zero(tree: &FreeTree) -> Self {
        let coordinates = tree.coordinates();
        Self {
            bodies: tree.bodies().len(),
            inertial: vec![[0.0; INERTIAL]; coordinates * tree.bodies().len()],
            acceleration: vec![[0.0; 3]; coordinates],
            torque: vec![0.0; coordinates],
            ..Self::default()
        }
    }

    fn clear(&mut self) {
        self.inertial.fill([0.0; INERTIAL]);
        self.acceleration.fill([0.0; 3]);
        self.torque.fill(0.0);
    }

    /// The inertial columns of a coordinate, body by body.
    pub(super) fn inertial(&self, coordinate: usize) -> &[Run] {
        &self.inertial[self.bodies * coordinate..][..self.bodies]
    }

    fn times(&mut self, factor: f64) {
        let inertial = self.inertial.as_flattened_mut().iter_mut();
        let acceleration = self.acceleration.as_flattened_mut().iter_mut();
        let all = inertial.chain(acceleration).chain(&mut self.torque);
        all.for_each(|x| *x *= factor);
    }
}

/// What one sample's projector is multiplied with: half of the difference of what is integrated by parts from the sample before to the one after, and
/// the rates times half the time between them.
struct Share {
    inertial: Vec<Run>,
    /// The half differences of the last step, which the next sample's projector is multiplied with as well.
    half: Vec<Run>,
    acceleration: Vec<[f64; 3]>,
    torque: Vec<f64>,
}

/// The window being filled.
pub(super) struct Window<'a> {
    walk: &'a Walk,
    stance: &'a Stance,
    robot: &'a Legged,
    /// With the masses that the accelerometer's columns are derivatives at.
    tree: &'a FreeTree,
    sensors: &'a Sensors,
    imu: Transform<f64>,
    acc_bias: Vector3<f64>,
    settings: Settings,
    last: Option<usize>,
    start_us: u64,
    /// The robot's scale, but zero for equations that are left out of this window.
    scale: Vec<f64>,
    resting: Vec<bool>,
    /// The IMU's velocity in the falling frame, m/s, in its axes.
    velocity: Vector3<f64>,
    moving: Moving,
    /// What each coordinate needs for an acceleration of all bodies, at the last sample.
    carried: Vec<Vector3<f64>>,
    projector: Projector,
    momentum: Vec<Run>,
    next_momentum: Vec<Run>,
    coriolis: Vec<Run>,
    share: Share,
    sum: WindowRows,
    rows: WindowRows,
}

impl<'a> Window<'a> {
    pub(super) fn new(
        (walk, stance): (&'a Walk, &'a Stance),
        robot: &'a Legged,
        tree: &'a FreeTree,
        sensors: &'a Sensors,
    ) -> Self {
        let usual = Settings::default();
        let runs = vec![[0.0; INERTIAL]; tree.runs()];
        let coordinates = tree.coordinates();
        Self {
            walk,
            stance,
            robot,
            tree,
            imu: sensors.imu(robot),
            acc_bias: sensors.acc_bias(),
            sensors,
            settings: Settings {
                window_us: stance.window_us,
                max_gap_us: usual.max_gap_us.max((1.6 * walk.period * 1e6) as u64),
                ..usual
            },
            last: None,
            start_us: 0,
            scale: robot.scale.clone(),
            resting: vec![false; robot.joints()],
            velocity: Vector3::zeros(),
            moving: Moving::default(),
            carried: vec![Vector3::zeros(); coordinates],
            projector: Projector::default(),
            momentum: runs.clone(),
            next_momentum: runs.clone(),
            coriolis: runs.clone(),
            share: Share {
                inertial: runs.clone(),
                half: runs,
                acceleration: vec![[0.0; 3]; coordinates],
                torque: vec![0.0; robot.joints()],
            },
            sum: WindowRows::zero(tree),
            rows: WindowRows::zero(tree),
        }
    }

    /// The rows of the window closed last; of use after [`Push::Closed`].
    pub(super) fn rows(&self) -> &WindowRows {
        &self.rows
    }

    /// Forgets the open window and the last sample.
    pub(super) fn clear(&mut self) {
        self.last = None;
    }

    /// Takes the next sample of the walk.
    pub(super) fn push(&mut self, n: usize) -> Push {
        if !self.is_plausible(n) {
            return Push::Rejected;
        }
        let now = self.walk.time_us[n];
        let Some(last) = self.last else {
            self.open(n);
            return Push::Used;
        };
        let before = self.walk.time_us[last];
        if now - before > self.settings.max_gap_us {
            self.open(n);
            return Push::Gap;
        }
        if self.stance.loaded[n] != self.stance.loaded[last] {
            // Closed at the last sample, if there is enough of it to be worth a row.
            let closed = self.close(before, self.settings.window_us / 2);
            self.open(n);
            return if closed { Push::Closed } else { Push::Cut };
        }
        self.advance(last, n, (now - before) as f64 * 1e-6);
        if now - self.start_us >= self.settings.window_us && self.close(now, 0) {
            self.open(n);
            return Push::Closed;
        }
        Push::Used
    }

    fn open(&mut self, n: usize) {
        self.start_us = self.walk.time_us[n];
        self.velocity = Vector3::zeros();
        self.sum.clear();
        self.share.inertial.fill([0.0; INERTIAL]);
        self.share.clear_rates();
        let rest = &self.walk.rest;
        self.resting = rest.within(&self.walk.time_us, n, self.stance.window_us);
        self.scale = self.robot.scale_beside(&self.resting);
        self.measure(n);
        std::mem::swap(&mut self.momentum, &mut self.next_momentum);
        self.project(n);
        self.last = Some(n);
    }

    /// Takes the window one step further, of so many seconds.
    fn advance(&mut self, last: usize, n: usize, step: f64) {
        self.accelerate(last, n, step);
        // The last sample's trapezium of the time between, then this one's.
        self.add_rates(last, 0.5 * step);
        self.measure(n);
        self.share
            .add_half_difference(&self.momentum, &self.next_momentum);
        self.add_projected();
        self.share.keep_differences();
        std::mem::swap(&mut self.momentum, &mut self.next_momentum);
        self.project(n);
        self.add_rates(n, 0.5 * step);
        self.last = Some(n);
    }

    /// Ends the window with the sample at `now_us`, if it is at least `least_us` long and has an inside.
    fn close(&mut self, now_us: u64, least_us: u64) -> bool {
        if now_us < self.start_us + least_us.max(1) {
            return false;
        }
        self.add_projected();
        std::mem::swap(&mut self.rows, &mut self.sum);
        let seconds = (now_us - self.start_us) as f64 * 1e-6;
        self.rows.times(1.0 / seconds);
        self.rows.span_us = [self.start_us, now_us];
        let left_out = self.resting.iter().filter(|resting| **resting).count();
        self.rows.rank = self.scale.len() - left_out - self.projector.rank();
        self.rows.resting.clone_from(&self.resting);
        true
    }

    /// The IMU's velocity one sample later (Heun's method).
    fn accelerate(&mut self, last: usize, n: usize, step: f64) {
        let rate = |at: usize, v: &Vector3<f64>| {
            self.walk.acc[at] - self.acc_bias - self.walk.gyro[at].cross(v)
        };
        let first = rate(last, &self.velocity);
        let second = rate(n, &(self.velocity + first * step));
        self.velocity += (first + second) * (step * 0.5);
    }

    /// Kinematics, momentum, Coriolis-transpose and what an acceleration of all needs at a sample.
    fn measure(&mut self, n: usize) {
        let base = self.imu.act(&Motion::new(self.walk.gyro[n], self.velocity));
        let (q, dq) = (&self.walk.q[n], &self.walk.dq[n]);
        self.tree.update(q, base, dq, &mut self.moving);
        self.tree
            .regressors(&self.moving, &mut self.next_momentum, &mut self.coriolis);
        self.tree.carried(&self.moving.pose, &mut self.carried);
    }

    /// The projector at the sample that was just measured.
    fn project(&mut self, n: usize) {
        let down = self.imu.rotation * self.walk.down[n];
        let points = self.sensors.points(self.robot, &self.stance.loaded[n]);
        let pose = &self.moving.pose;
        self.projector
            .update(self.tree, pose, points.iter(), &down, &self.scale);
    }

    /// The rates at the sample that was measured last, for `duration` (s).
    fn add_rates(&mut self, n: usize, duration: f64) {
        let rates = self.coriolis.as_flattened();
        let sums = self.share.inertial.as_flattened_mut().iter_mut();
        sums.zip(rates)
            .for_each(|(sum, rate)| *sum -= rate * duration);
        let torques = self.share.torque.iter_mut().zip(&self.walk.tau[n]);
        torques.for_each(|(sum, tau)| *sum += tau * duration);
        for (sum, carried) in self.share.acceleration.iter_mut().zip(&self.carried) {
            let felt = self.imu.rotation.tr_mul(carried);
            (0..3).for_each(|k| sum[k] -= felt[k] * duration);
        }
    }

    /// Adds P D times the share.
    fn add_projected(&mut self) {
        let (width, bodies) = (self.scale.len(), self.sum.bodies);
        let directions: Vec<&[f64]> = self.projector.directions().collect();
        let mut parts = vec![[0.0; INERTIAL]; directions.len()];
        for b in 0..bodies {
            parts.fill([0.0; INERTIAL]);
            // Only what moves the body has entries of it.
            let runs = &self.share.inertial[self.tree.runs_of(b)];
            for (&c, run) in self.tree.movers(b).iter().zip(runs) {
                let scaled = run.map(|x| x * self.scale[c]);
                // A foot's force reaches the base and its own leg: most numbers are zero.
                for (part, direction) in parts.iter_mut().zip(&directions) {
                    if direction[c] != 0.0 {
                        add(part, &scaled, direction[c]);
                    }
                }
                add(&mut self.sum.inertial[bodies * c + b], &scaled, 1.0);
            }
            for c in 0..width {
                let mut taken = [0.0; INERTIAL];
                for (part, direction) in parts.iter().zip(&directions) {
                    if direction[c] != 0.0 {
                        add(&mut taken, part, direction[c]);
                    }
                }
                add(&mut self.sum.inertial[bodies * c + b], &taken, -1.0);
            }
        }
        let mut column = vec![0.0; width];
        for n in 0..3 {
            for (c, to) in column.iter_mut().enumerate() {
                *to = self.share.acceleration[c][n] * self.scale[c];
            }
            self.projector.apply(&mut column);
            let sums = self.sum.acceleration.iter_mut().zip(&column);
            sums.for_each(|(sum, x)| sum[n] += x);
        }
        column[..OF_BASE].fill(0.0);
        for (j, torque) in self.share.torque.iter().enumerate() {
            column[OF_BASE + j] = torque * self.scale[OF_BASE + j];
        }
        self.projector.apply(&mut column);
        let sums = self.sum.torque.iter_mut().zip(&column);
        sums.for_each(|(sum, x)| *sum += x);
    }

    fn is_plausible(&self, n: usize) -> bool {
        let (q, dq, tau) = (&self.walk.q[n], &self.walk.dq[n], &self.walk.tau[n]);
        let joints = self.robot.limits.iter().enumerate().all(|(j, limits)| {
            let [lower, upper] = limits.position;
            q[j].is_finite()
                && dq[j].is_finite()
                && tau[j].is_finite()
                && (lower..=upper).contains(&q[j])
                && dq[j].abs() <= limits.speed
                && tau[j].abs() <= limits.torque
        });
        let vectors = [&self.walk.gyro[n], &self.walk.acc[n], &self.walk.down[n]];
        joints && vectors.iter().all(|v| v.iter().all(|x| x.is_finite()))
    }
}

/// a += b times a number.
#[inline(always)]
fn add(a: &mut Run, b: &Run, times: f64) {
    a.iter_mut().zip(b).for_each(|(a, b)| *a += b * times);
}

impl Share {
    fn clear_rates(&mut self) {
        self.acceleration.fill([0.0; 3]);
        self.torque.fill(0.0);
    }

    /// Adds half of what the momentum changed by since the last sample.
    fn add_half_difference(&mut self, before: &[Run], now: &[Run]) {
        let halves = self.half.as_flattened_mut().iter_mut();
        let sums = self.inertial.as_flattened_mut().iter_mut();
        let both = before.as_flattened().iter().zip(now.as_flattened());
        for ((half, sum), (before, now)) in halves.zip(sums).zip(both) {
            *half = (now - before) * 0.5;
            *sum += *half;
        }
    }

    /// Begins the next sample's share with its half of the step's differences.
    fn keep_differences(&mut self) {
        self.inertial.copy_from_slice(&self.half);
        self.clear_rates();
    }
}
