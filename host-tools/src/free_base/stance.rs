//! Which feet may carry a force: all but those that are surely in the air, by the figures of the board ([`proprio_core::walk::stance`]).
//!
//! A foot that is projected out without need costs three equations of a window. A force that is not projected out moves the
//! masses: 10 N for all the time are 10 % of a Go2. So a foot counts as in the air only if everything that was measured says so:
//!
//! - *torque*: what the leg's motors do beyond what its own bodies need (by the CAD, with the accelerations of base and joints)
//!   is less than a force of [`FORCE`] at the foot;
//! - *count*: the foot's sensor reads as low as it does in the air. Its offset and gain are unknown, so low is a share of its own
//!   range; a sensor that reads nothing has no range and is not asked;
//! - *height*: it is [`HEIGHT`] above the lowest of the feet that carry a force by torque, along gravity. With no such foot (flight, or
//!   a robot that hangs) it is not asked;
//! - *guard*: and all of that for [`GUARD`] before and after.

use nalgebra::{Matrix3, SVector, Vector3};
use proprio_core::go2::{self, JOINTS_PER_LEG, LEGS};
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use proprio_core::walk::stance::{FORCE, GUARD, HEIGHT, LEAST_RANGE, LOW, SPREAD, TAIL};
use proprio_core::window::Settings;
use serde::Serialize;

use super::held::{self, Support};
use super::walk::Walk;
use crate::robust;

/// Feet that stay as they are for longer than this on average do not step, s: ten windows of the long kind.
const LONG_STANCE: f64 = 0.8;
/// Windows have at least this many samples.
const LEAST_STEPS: f64 = 2.5;

/// Why feet were projected out, as shares of the time, leg by leg in SDK order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct StanceShares {
    /// The torques told a force.
    pub torque: [f64; LEGS],
    /// The torques did not, the foot's sensor did.
    pub count: [f64; LEGS],
    /// Neither did, but it was no higher than feet that carry a force.
    pub height: [f64; LEGS],
    /// It was close in time to such a sample.
    pub guard: [f64; LEGS],
    /// In the air.
    pub air: [f64; LEGS],
}

/// A stretch of time in which one thing is said of a foot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FootEpisode {
    /// Which leg's, in SDK order.
    pub leg: usize,
    /// What speaks against the air first, or that nothing does.
    pub reason: Reason,
    /// From and to, s since the log's start.
    pub time: [f64; 2],
}

/// Which feet may carry a force, sample by sample.
#[derive(Clone)]
pub(crate) struct Stance {
    pub(super) loaded: Vec<[bool; LEGS]>,
    /// A foot touched down here: impacts are short and hard.
    pub(super) touch_down: Vec<bool>,
    /// When feet strike or leave the ground by their legs' torques, s in order; each is told less than [`SPREAD`] early or late.
    pub(super) strikes: Vec<f64>,
    /// How long its windows are, µs.
    pub(super) window_us: u64,
    /// Something beyond the feet carries the robot here, or no IMU tells how it moves: nothing follows from its base's equations.
    pub(super) held: Vec<bool>,
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
    pub(super) fn of(walk: &Walk, imu: &Transform<f64>) -> Self {
        let low = low_counts(walk);
        let legs = Legs::new(imu);
        let mut support = Vec::with_capacity(walk.len());
        let mut reasons: Vec<[Reason; LEGS]> = (0..walk.len())
            .map(|n| {
                let (force, height, carried) = legs.told(walk, n);
                support.push(carried);
                let ground = (0..LEGS)
                    .filter(|f| force[*f] >= FORCE)
                    .map(|f| height[f])
                    .fold(f64::INFINITY, f64::min);
                std::array::from_fn(|f| {
                    let counts = walk.count.as_ref().map_or(f64::NAN, |count| count[n][f]);
                    if force[f] >= FORCE {
                        Reason::Torque
                    } else if counts > low[f] {
                        Reason::Count
                    } else if height[f] < ground + HEIGHT && ground.is_finite() {
                        Reason::Height
                    } else {
                        Reason::Air
                    }
                })
            })
            .collect();
        let pressed = |n: usize| reasons[n].map(|reason| reason == Reason::Torque);
        let strikes = (1..walk.len()).filter(|n| pressed(*n) != pressed(n - 1));
        let strikes = strikes.map(|n| walk.seconds(n)).collect();
        let touch_down = (0..walk.len())
            .map(|n| {
                let on = |f: usize| {
                    reasons[n][f] == Reason::Torque && n > 0 && reasons[n - 1][f] != Reason::Torque
                };
                (0..LEGS).any(on)
            })
            .collect();
        guard(walk, &mut reasons);
        let loaded: Vec<_> = reasons
            .iter()
            .map(|r| r.map(|r| r != Reason::Air))
            .collect();
        Self {
            window_us: usual_window_us(walk, &loaded),
            loaded,
            touch_down,
            strikes,
            held: if walk.imu {
                held::samples(walk, &support)
            } else {
                vec![true; walk.len()]
            },
            shares: shares(&reasons),
            episodes: episodes(walk, &reasons),
        }
    }
}

/// How long windows of a log are whose feet are loaded so, µs. The gyro's noise at a window's ends counts the less the longer it is: twice the usual
/// length where feet step, for a step ends a window; four times where they stay for so long that steps cost nothing (of twenty sways the mass
/// was 0.2 % too small with windows of 40 ms, and the centre of mass 0.5 mm too high; 0.0 % and 0.1 mm with 80). Longer ones at a low rate.
fn usual_window_us(walk: &Walk, loaded: &[[bool; LEGS]]) -> u64 {
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
fn episodes(walk: &Walk, reasons: &[[Reason; LEGS]]) -> Vec<FootEpisode> {
    let mut all: Vec<FootEpisode> = Vec::new();
    for leg in 0..LEGS {
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
fn guard(walk: &Walk, reasons: &mut [[Reason; LEGS]]) {
    for f in 0..LEGS {
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

fn shares(reasons: &[[Reason; LEGS]]) -> StanceShares {
    let share = |reason: Reason| {
        std::array::from_fn(|f| {
            let n = reasons.iter().filter(|r| r[f] == reason).count();
            n as f64 / reasons.len().max(1) as f64
        })
    };
    StanceShares {
        torque: share(Reason::Torque),
        count: share(Reason::Count),
        height: share(Reason::Height),
        guard: share(Reason::Guard),
        air: share(Reason::Air),
    }
}

/// Counts above these speak of a force; infinite for a sensor that reads nothing.
fn low_counts(walk: &Walk) -> [f64; LEGS] {
    let Some(counts) = &walk.count else {
        return [f64::INFINITY; LEGS];
    };
    std::array::from_fn(|f| {
        let own = || counts.iter().map(|c| c[f]).filter(|c| c.is_finite());
        let at = |share: f64| robust::quantile(own(), share);
        match (at(TAIL), at(1.0 - TAIL)) {
            (Some(least), Some(most)) if most - least >= LEAST_RANGE => {
                least + LOW * (most - least)
            }
            _ => f64::INFINITY,
        }
    })
}

/// The robot by the CAD.
struct Legs {
    tree: Tree<f64, 13, 18>,
    imu: Transform<f64>,
}

impl Legs {
    fn new(imu: &Transform<f64>) -> Self {
        Self {
            tree: go2::free(),
            imu: *imu,
        }
    }

    /// Each foot's force (N) by its leg's torques, its height (m) along gravity, both in the base's frame, and what all of them carry.
    fn told(&self, walk: &Walk, n: usize) -> ([f64; LEGS], [f64; LEGS], Support) {
        let (first, last) = around(walk, n);
        let seconds = (walk.seconds(last) - walk.seconds(first)).max(1e-6);
        let slope = |a: f64, b: f64| (b - a) / seconds;
        let mean = |of: &dyn Fn(usize) -> f64| {
            (first..=last).map(of).sum::<f64>() / (last - first + 1) as f64
        };
        let down = self.imu.rotation * walk.down[n];
        let w = self.imu.rotation * walk.gyro[n];
        let turning = self.imu.rotation * (walk.gyro[last] - walk.gyro[first]) / seconds;
        let acc = Vector3::from_fn(|k, _| mean(&|m| walk.acc[m][k]));
        let r = self.imu.translation;
        // The base's origin, from the IMU's specific force; the tree adds gravity in the direction of the filter.
        let specific = self.imu.rotation * acc - turning.cross(&r) - w.cross(&w.cross(&r));
        let moving = specific + down * self.tree.gravity().norm();
        let base = level(&down);
        let (mut q, mut v, mut a) = (SVector::zeros(), SVector::zeros(), SVector::zeros());
        for k in 0..3 {
            (v[k], a[k], a[3 + k]) = (w[k], turning[k], moving[k]);
        }
        let mut torque = [0.0; 12];
        for j in 0..12 {
            (q[6 + j], v[6 + j]) = (walk.q[n][j], mean(&|m| walk.dq[m][j]));
            a[6 + j] = slope(walk.dq[first][j], walk.dq[last][j]);
            let armature = go2::ACTUATORS[j % JOINTS_PER_LEG].armature();
            torque[j] = mean(&|m| walk.tau[m][j]) - armature * a[6 + j];
        }
        let k = self.tree.kinematics(&base, &q, &v);
        let needed = self.tree.inverse_dynamics(&k, &v, &a);
        let feet = go2::feet();
        let forces: [Option<Vector3<f64>>; LEGS] = std::array::from_fn(|f| {
            let jacobian = self.tree.contact_jacobian(&k.placements, &feet[f], &down);
            let own = jacobian
                .fixed_columns::<JOINTS_PER_LEG>(6 + JOINTS_PER_LEG * f)
                .into_owned();
            let first = JOINTS_PER_LEG * f;
            let left = Vector3::from_fn(|k, _| needed[6 + first + k] - torque[first + k]);
            // Damped: a straight leg's torques tell nothing of a force along it, and are not asked.
            let square = own * own.transpose() + Matrix3::identity() * 1e-4;
            square.try_inverse().map(|inverse| inverse * own * left)
        });
        let force = forces.map(|force| force.map_or(f64::INFINITY, |force| force.norm()));
        // A push of the ground is what the leg's torques lack.
        let by_feet: Vector3<f64> = forces.iter().flatten().sum();
        let support = Support {
            needed: -down.dot(&needed.fixed_rows::<3>(3)),
            by_feet: -down.dot(&by_feet),
        };
        let height = std::array::from_fn(|f| {
            let centre = foot_in_base(&self.tree, &k.placements, f);
            -down.dot(&centre)
        });
        (force, height, support)
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

/// A base in whose axes gravity points `down`.
fn level(down: &Vector3<f64>) -> Transform<f64> {
    let rotation = nalgebra::Rotation3::rotation_between(down, &-Vector3::z());
    Transform {
        rotation: rotation.map_or_else(Matrix3::identity, |r| *r.matrix()),
        translation: Vector3::zeros(),
    }
}

/// Where a foot's centre is in the base, m.
fn foot_in_base(
    tree: &Tree<f64, 13, 18>,
    placements: &proprio_core::tree::Placements<f64, 13>,
    leg: usize,
) -> Vector3<f64> {
    let foot = go2::feet()[leg];
    let (mut at, mut body) = (foot.centre, foot.body);
    while let Some(parent) = tree.bodies()[body].parent {
        let placed = &placements.from_parent[body];
        at = placed.translation + placed.rotation * at;
        body = parent;
    }
    at
}
