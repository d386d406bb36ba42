//! Which feet may carry a force: all but those that are surely in the air, by the figures of the board ([`proprio_core::walk::stance`]).
//!
//! A foot that is projected out without need costs three equations of a window. A force that is not projected out moves the
//! masses: 10 N for all the time are 10 % of a Go2. So a foot counts as in the air only if everything that was measured says so:
//!
//! - *torque*: what the leg's motors do beyond what its own bodies need (by the CAD, with the accelerations of base and joints)
//!   is less than a force of [`Legged::least_force`], 9 % of the robot's weight, at the foot;
//! - *count*: the foot's sensor reads as low as it does in the air. Its offset and gain are unknown, so low is a share of its own
//!   range; a sensor that reads nothing has no range and is not asked;
//! - *height*: it is [`Legged::least_height`] above the lowest of the feet that carry a force by torque, along gravity. With no such foot (flight, or
//!   a robot that hangs) it is not asked;
//! - *guard*: and all of that for [`GUARD`] before and after.

use nalgebra::{DMatrix, DVector, Vector3};
use proprio_core::spatial::Motion;
use proprio_core::walk::stance::{GUARD, LEAST_RANGE, LOW, SPREAD, TAIL};
use proprio_core::window::Settings;
use serde::Serialize;

use super::channels::Channels;
use super::legged::{Legged, LeggedFoot};
use super::supported::{self, Support};
use super::transmitted::{self, Needed};
use super::walk::Walk;
use crate::equation::free_tree::{Moving, OF_BASE};
use crate::robust;

/// Feet that stay as they are for longer than this on average do not step, s: ten windows of the long kind.
const LONG_STANCE: f64 = 0.8;
/// Windows have at least this many samples.
const LEAST_STEPS: f64 = 2.5;

/// Why feet were projected out, as shares of the time, foot by foot in the robot's order (a Go2's is the SDK's).
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct StanceShares {
    /// The torques told a force.
    pub torque: Vec<f64>,
    /// The torques did not, the foot's sensor did.
    pub count: Vec<f64>,
    /// Neither did, but it was no higher than feet that carry a force.
    pub height: Vec<f64>,
    /// It was close in time to such a sample.
    pub guard: Vec<f64>,
    /// In the air.
    pub air: Vec<f64>,
}

/// A stretch of time in which one thing is said of a foot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootEpisode {
    /// Which foot, in the robot's order.
    pub leg: usize,
    /// What speaks against the air first, or that nothing does.
    pub reason: Reason,
    /// From and to, s since the log's start.
    pub time: [f64; 2],
}

/// Which feet may carry a force, sample by sample.
#[derive(Clone)]
pub(crate) struct Stance {
    pub(super) loaded: Vec<Vec<bool>>,
    /// A foot touched down here: impacts are short and hard.
    pub(super) touch_down: Vec<bool>,
    /// When feet strike or leave the ground by their legs' torques, s in order; each is told less than [`SPREAD`] early or late.
    pub(super) strikes: Vec<f64>,
    /// The torque that each joint's gear transmits, N m, by the motion and the other joints.
    pub(super) transmitted: Channels,
    /// How long its windows are, µs.
    pub(super) window_us: u64,
    /// Something beyond the feet carries the robot here, or no IMU tells how it moves: nothing follows from its base's equations.
    pub(super) held: Vec<bool>,
    /// By the accelerometer the feet pull at the ground.
    pub(super) overturned: bool,
    pub(super) shares: StanceShares,
    /// Leg by leg, in the order of time.
    pub(super) episodes: Vec<FootEpisode>,
}

/// The reason that speaks against air first, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The leg's torques tell a force.
    Torque,
    /// The foot's sensor does.
    Count,
    /// It is no higher than feet that carry a force.
    Height,
    /// Close in time to one of these.
    Guard,
    /// In the air.
    Air,
}

impl Stance {
    pub(super) fn of(walk: &Walk, robot: &Legged) -> Self {
        let low = low_counts(walk, robot.feet.len());
        let feet = 0..robot.feet.len();
        let mut judge = Judge::new(robot);
        let mut support = Vec::with_capacity(walk.len());
        let mut needed = Vec::with_capacity(walk.len());
        let mut reasons: Vec<Vec<Reason>> = (0..walk.len())
            .map(|n| {
                let Told {
                    force,
                    height,
                    support: carried,
                    needed: own,
                } = judge.told(walk, n);
                support.push(carried);
                needed.push(own);
                let is_pressed = |f: &usize| force[*f] >= robot.least_force;
                let ground = feet.clone().filter(is_pressed);
                let ground = ground.map(|f| height[f]).fold(f64::INFINITY, f64::min);
                let reason = |f: usize| {
                    let counts = walk.count.as_ref().map_or(f64::NAN, |count| count[n][f]);
                    if is_pressed(&f) {
                        Reason::Torque
                    } else if counts > low[f] {
                        Reason::Count
                    } else if height[f] < ground + robot.least_height && ground.is_finite() {
                        Reason::Height
                    } else {
                        Reason::Air
                    }
                };
                feet.clone().map(reason).collect()
            })
            .collect();
        let pressed = |n: usize, f: usize| reasons[n][f] == Reason::Torque;
        let strikes =
            (1..walk.len()).filter(|n| feet.clone().any(|f| pressed(*n, f) != pressed(n - 1, f)));
        let strikes = strikes.map(|n| walk.seconds(n)).collect();
        let down = |n: usize| n > 0 && feet.clone().any(|f| pressed(n, f) && !pressed(n - 1, f));
        let touch_down = (0..walk.len()).map(down).collect();
        let carries = |n: usize, f: usize| reasons[n][f] != Reason::Air;
        let transmitted = transmitted::of(walk, robot, &needed, carries);
        guard(walk, &mut reasons);
        let loaded: Vec<Vec<bool>> = reasons
            .iter()
            .map(|own| own.iter().map(|reason| *reason != Reason::Air).collect())
            .collect();
        Self {
            transmitted,
            window_us: usual_window_us(walk, &loaded),
            loaded,
            touch_down,
            strikes,
            held: if walk.imu {
                supported::samples(walk, &support, robot.weight)
            } else {
                vec![true; walk.len()]
            },
            overturned: walk.imu && supported::is_overturned(&support),
            shares: shares(&reasons, robot.feet.len()),
            episodes: episodes(walk, &reasons, robot.feet.len()),
        }
    }
}

/// How long windows of a log are whose feet are loaded so, µs. The gyro's noise at a window's ends counts the less the longer it is: twice the usual
/// length where feet step, for a step ends a window; four times where they stay for so long that steps cost nothing (of twenty sways the mass
/// was 0.2 % too small with windows of 40 ms, and the centre of mass 0.5 mm too high; 0.0 % and 0.1 mm with 80). Longer ones at a low rate.
fn usual_window_us(walk: &Walk, loaded: &[Vec<bool>]) -> u64 {
    let changes = loaded.windows(2).filter(|two| two[0] != two[1]).count();
    let usual = Settings::default().window_us;
    let times = if changes as f64 * LONG_STANCE < walk.duration() {
        4
    } else {
        2
    };
    (times * usual).max((LEAST_STEPS * walk.period * 1e6) as u64)
}

/// Samples of which the same is said, leg by leg.
fn episodes(walk: &Walk, reasons: &[Vec<Reason>], feet: usize) -> Vec<FootEpisode> {
    let mut all: Vec<FootEpisode> = Vec::new();
    for leg in 0..feet {
        for (n, reason) in reasons.iter().map(|reasons| reasons[leg]).enumerate() {
            let now = walk.seconds(n);
            let own = |last: &&mut FootEpisode| {
                let follows = now - last.time[1] < 2.0 * walk.period;
                n > 0 && follows && last.reason == reason
            };
            match all.last_mut().filter(own) {
                Some(last) => last.time[1] = now,
                None => all.push(FootEpisode {
                    leg,
                    reason,
                    time: [now, now + walk.period],
                }),
            }
        }
    }
    all
}

/// Widens what is on the ground by the guard.
fn guard(walk: &Walk, reasons: &mut [Vec<Reason>]) {
    for f in 0..reasons.first().map_or(0, Vec::len) {
        let grounded: Vec<f64> = (0..walk.len())
            .filter(|n| reasons[*n][f] != Reason::Air)
            .map(|n| walk.seconds(n))
            .collect();
        for (n, reason) in reasons.iter_mut().enumerate() {
            let t = walk.seconds(n);
            let next = grounded.partition_point(|g| *g < t - GUARD);
            let near = grounded.get(next).is_some_and(|g| *g <= t + GUARD);
            if reason[f] == Reason::Air && near {
                reason[f] = Reason::Guard;
            }
        }
    }
}

fn shares(reasons: &[Vec<Reason>], feet: usize) -> StanceShares {
    let share = |reason: Reason| {
        let of = |f: usize| {
            let n = reasons.iter().filter(|r| r[f] == reason).count();
            n as f64 / reasons.len().max(1) as f64
        };
        (0..feet).map(of).collect()
    };
    StanceShares {
        torque: share(Reason::Torque),
        count: share(Reason::Count),
        height: share(Reason::Height),
        guard: share(Reason::Guard),
        air: share(Reason::Air),
    }
}

/// Counts above these speak of a force; infinite for a sensor that reads nothing. A sensor's range is at least as many of its own quanta as a Go2's
/// counts ([`LEAST_RANGE`]): what it reads besides is noise, in whatever unit.
fn low_counts(walk: &Walk, feet: usize) -> Vec<f64> {
    let of = |f: usize| {
        let own = || {
            let counts = walk.count.iter().flat_map(|counts| counts.of(f));
            counts.filter(|count| count.is_finite())
        };
        let at = |share: f64| robust::quantile(own(), share);
        match (at(TAIL), at(1.0 - TAIL)) {
            (Some(least), Some(most)) if most - least >= LEAST_RANGE * quantum(own()) => {
                least + LOW * (most - least)
            }
            _ => f64::INFINITY,
        }
    };
    (0..feet).map(of).collect()
}

/// The least step of a sensor's readings, in its unit, but no more than a count.
fn quantum(readings: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = readings.collect();
    sorted.sort_by(f64::total_cmp);
    let steps = sorted.windows(2).map(|pair| pair[1] - pair[0]);
    steps.filter(|step| *step > 0.0).fold(1.0, f64::min)
}

/// What is told of a sample.
struct Told {
    /// Each foot's force by its leg's torques, N.
    force: Vec<f64>,
    /// Each foot's height along gravity, in the base's frame, m.
    height: Vec<f64>,
    /// What all of them carry.
    support: Support,
    needed: Needed,
}

/// The robot by the CAD.
struct Judge<'a> {
    robot: &'a Legged,
    moving: Moving,
}

impl<'a> Judge<'a> {
    fn new(robot: &'a Legged) -> Self {
        Self {
            robot,
            moving: Moving::default(),
        }
    }

    fn told(&mut self, walk: &Walk, n: usize) -> Told {
        let (first, last) = around(walk, n);
        let seconds = (walk.seconds(last) - walk.seconds(first)).max(1e-6);
        let slope = |a: f64, b: f64| (b - a) / seconds;
        let mean = |of: &dyn Fn(usize) -> f64| {
            (first..=last).map(of).sum::<f64>() / (last - first + 1) as f64
        };
        let (robot, imu) = (self.robot, &self.robot.imu);
        let down = imu.rotation * walk.down[n];
        let w = imu.rotation * walk.gyro[n];
        let turning = imu.rotation * (walk.gyro[last] - walk.gyro[first]) / seconds;
        let acc = Vector3::from_fn(|k, _| mean(&|m| walk.acc[m][k]));
        let r = imu.translation;
        // The base's origin, from the IMU's specific force: its acceleration without gravity.
        let specific = imu.rotation * acc - turning.cross(&r) - w.cross(&w.cross(&r));
        let joints = robot.joints();
        let dq: Vec<f64> = (0..joints).map(|j| mean(&|m| walk.dq[m][j])).collect();
        let ddq: Vec<f64> = (0..joints)
            .map(|j| slope(walk.dq[first][j], walk.dq[last][j]))
            .collect();
        let base = Motion::new(w, Vector3::zeros());
        robot.tree.update(&walk.q[n], base, &dq, &mut self.moving);
        let felt = Motion::new(turning, specific);
        let needed = robot.tree.inverse_dynamics(&self.moving, felt, &ddq, &dq);
        let left: Vec<f64> = (0..joints)
            .map(|j| {
                let torque = mean(&|m| walk.tau[m][j]) - robot.armature[j] * ddq[j];
                needed[OF_BASE + j] - torque
            })
            .collect();
        let forces: Vec<Option<Vector3<f64>>> = (robot.feet.iter())
            .map(|foot| self.force(foot, &down, &left))
            .collect();
        // A push of the ground is what the leg's torques lack.
        let by_feet: Vector3<f64> = forces.iter().flatten().sum();
        let support = Support {
            needed: -Vector3::from_fn(|k, _| needed[3 + k]).dot(&down),
            by_feet: -down.dot(&by_feet),
        };
        let force = forces.iter();
        let force = force.map(|force| force.map_or(f64::INFINITY, |force| force.norm()));
        let height = robot.feet.iter().map(|foot| {
            let points = foot.points.iter();
            let lowest = points.map(|point| -down.dot(&point.place(&self.moving.pose)));
            lowest.fold(f64::INFINITY, f64::min)
        });
        Told {
            force: force.collect(),
            height: height.collect(),
            support,
            needed: Needed {
                force: needed,
                left,
            },
        }
    }

    /// The force on a foot that makes up for what is `left` of its leg's torques: at its point, or of a flat foot the wrench about the middle of its points,
    /// a couple at half the foot's size counting like a force.
    fn force(&self, foot: &LeggedFoot, down: &Vector3<f64>, left: &[f64]) -> Option<Vector3<f64>> {
        let (tree, pose) = (&self.robot.tree, &self.moving.pose);
        let count = foot.points.len() as f64;
        let places: Vec<Vector3<f64>> = (foot.points.iter())
            .map(|point| point.place(pose) + down * point.radius)
            .collect();
        let middle = places.iter().sum::<Vector3<f64>>() / count;
        let size = places
            .iter()
            .map(|place| (place - middle).norm())
            .fold(0.0, f64::max);
        let body = foot.points.first()?.body;
        let rows = if size > 0.0 { 6 } else { 3 };
        let joints = tree.movers(body).len() - OF_BASE;
        let mut own = DMatrix::zeros(rows, joints);
        let mut torques = DVector::zeros(joints);
        let velocities = tree.point_velocities(pose, body, middle);
        for (k, (c, velocity)) in velocities.skip(OF_BASE).enumerate() {
            torques[k] = left[c - OF_BASE];
            for axis in 0..3 {
                own[(axis, k)] = velocity[axis];
            }
            if rows > 3 {
                let turning = pose.along[c - OF_BASE + 1].angular * (0.5 * size);
                (0..3).for_each(|axis| own[(3 + axis, k)] = turning[axis]);
            }
        }
        // Damped: a straight leg's torques tell nothing of a force along it, and are not asked.
        let mut square = &own * own.transpose();
        (0..rows).for_each(|k| square[(k, k)] += self.robot.damping);
        let wrench = square.cholesky()?.solve(&(own * torques));
        Some(Vector3::new(wrench[0], wrench[1], wrench[2]))
    }
}

/// The samples within the spread of one.
fn around(walk: &Walk, n: usize) -> (usize, usize) {
    let near =
        |m: &usize| (walk.seconds(*m) - walk.seconds(n)).abs() <= SPREAD.max(1.01 * walk.period);
    let first = (0..n).rev().take_while(near).last().unwrap_or(n);
    let last = (n + 1..walk.len()).take_while(near).last().unwrap_or(n);
    (first, last)
}
