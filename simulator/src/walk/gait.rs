//! What the legs are asked to do: joint angles over time, and how the robot's weight is shared among its feet.
//!
//! A gait is where each foot is to be under a level trunk, and how the trunk is to stand above them; inverse kinematics makes angles of it: a Go2's
//! in closed form, any other leg's by steps from the last angles (`stance`). Beside the step itself all trunks roll, pitch and shift a little, and
//! all walks wander, so that a log tells more than one motion over and over. It begins at rest and grows over a second. Sizes and frequencies are a
//! Go2's; of another robot ways grow with its legs' length and times with the length's root.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use nalgebra::{DVector, Rotation3, Vector2, Vector3};
use proprio_core::go2::{FOOT_SPHERE, JOINTS_PER_LEG, LEGS, Leg};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::plant::Torques;
use super::robot::WalkRobot;

/// How a robot goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Gait {
    /// Two diagonal feet at a time, some foot always on the ground: 2.2 steps a second.
    Trot,
    /// A trot with a flight after each step.
    Flying,
    /// Off the ground with all four feet at once, on the spot: 2.4 times a second.
    Hop,
    /// All four feet stay where they are and the trunk sways above them.
    Sway,
}

impl Gait {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Trot, Self::Flying, Self::Hop, Self::Sway];

    /// `trot`, `flying`, `hop` or `sway`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Trot => "trot",
            Self::Flying => "flying",
            Self::Hop => "hop",
            Self::Sway => "sway",
        }
    }

    /// Steps per second, share of a step in which a foot is to be on the ground, and how high it is lifted in between, m.
    const fn step(self) -> (f64, f64, f64) {
        match self {
            Self::Trot => (2.2, 0.55, 0.07),
            Self::Flying => (2.6, 0.40, 0.07),
            Self::Hop => (2.4, 0.60, 0.03),
            Self::Sway => (1.0, 1.0, 0.0),
        }
    }
}

/// Height of a Go2's trunk above the ground, m.
const HEIGHT: f64 = 0.29;
/// Phases that a gait draws.
const PHASES: usize = 12;
/// How far joints move that no foot hangs on, an arm's and a waist's, rad, and how fast, Hz: their bodies are identified by it and throw nobody down.
const IDLE: (f64, f64) = (0.15, 0.6);
/// How long a gait takes to grow, s.
const EASE: f64 = 1.0;
/// How far below the ground a flying trot's feet push, m: they take off by it.
const PUSH: f64 = 0.01;
/// Share of a stance over which a foot takes its part of the weight, and gives it up.
const SHIFT: f64 = 0.15;
const GRAVITY: f64 = 9.81;

/// A gait with the phases of its slow motions.
pub(super) struct Reference {
    gait: Gait,
    phases: [f64; PHASES],
    robot: Arc<WalkRobot>,
    /// Height of the trunk above the ground, m.
    height: f64,
    /// Where each foot is below a level trunk, m, and whether it steps half a step late.
    feet: Vec<(Vector2<f64>, bool)>,
    legs: Legs,
}

/// How angles are found.
enum Legs {
    /// A Go2's.
    ClosedForm([LegGeometry; LEGS]),
    /// By steps from the last angles; and the joints that no foot hangs on, with their middles.
    Steps {
        last: Torques,
        idle: Vec<(usize, f64)>,
    },
}

/// Where a leg begins and how long it is, m.
#[derive(Clone, Copy)]
struct LegGeometry {
    /// Hip's axis in the trunk.
    hip: Vector3<f64>,
    /// From the hip's axis out to the thigh.
    out: f64,
    /// Thigh and calf.
    links: [f64; 2],
}

/// The reference at an instant.
pub(super) struct Wanted {
    /// rad.
    pub(super) q: Torques,
    /// What each foot is to carry of the robot's weight; one in all on average.
    pub(super) shares: Vec<f64>,
}

impl Reference {
    /// Draws the phases.
    pub(super) fn new(gait: Gait, robot: &Arc<WalkRobot>, rng: &mut ChaCha8Rng) -> Self {
        let phases = std::array::from_fn(|_| rng.random_range(0.0..TAU));
        let (height, home, legs) = match &robot.stance {
            Some(stance) => {
                let idle = stance.idle(robot, IDLE.0);
                let last = stance.q.clone();
                (
                    stance.height,
                    stance.home.clone(),
                    Legs::Steps { last, idle },
                )
            }
            None => {
                let legs = Leg::ALL.map(|leg| LegGeometry::of(robot, leg));
                let home = |leg: &LegGeometry| Vector2::new(leg.hip.x, leg.hip.y + leg.out);
                let home = legs.iter().map(home).collect();
                (HEIGHT, home, Legs::ClosedForm(legs))
            }
        };
        Self {
            gait,
            phases,
            robot: Arc::clone(robot),
            height,
            feet: late(&home)
                .into_iter()
                .zip(home)
                .map(|(late, home)| (home, late))
                .collect(),
            legs,
        }
    }

    /// Height of the trunk above the ground, m.
    pub(super) fn height(&self) -> f64 {
        self.height
    }

    /// How many times as fast as a Go2's all motions are.
    fn faster(&self) -> f64 {
        1.0 / self.robot.longer.sqrt()
    }

    /// Steps per second, share of a step in which a foot is to be on the ground, and how high it is lifted in between, m.
    fn step(&self) -> (f64, f64, f64) {
        let (frequency, duty, lift) = self.gait.step();
        (frequency * self.faster(), duty, lift * self.robot.longer)
    }

    /// At time `t`, s; before zero the robot stands. Times come in order.
    pub(super) fn at(&mut self, t: f64) -> Wanted {
        let t = t.max(0.0);
        let ease = 0.5 - 0.5 * (PI * (t / EASE).min(1.0)).cos();
        let (height, turned, shift) = self.trunk(t, ease);
        let count = self.feet.len() as f64;
        let back = turned.inverse();
        let (mut places, mut shares) = (Vec::new(), Vec::new());
        for (n, (home, _)) in self.feet.iter().enumerate() {
            let (foot, share) = self.foot(n, t, ease);
            let height = height - self.robot.feet[n].radius;
            let under = Vector3::new(home.x - shift.x, home.y - shift.y, -height);
            places.push(back * (under + foot));
            shares.push((1.0 - ease) / count + ease * share);
        }
        let mut q = DVector::zeros(self.robot.facts().len());
        match &self.legs {
            Legs::ClosedForm(legs) => {
                for (n, (leg, place)) in legs.iter().zip(&places).enumerate() {
                    q.fixed_rows_mut::<JOINTS_PER_LEG>(JOINTS_PER_LEG * n)
                        .copy_from(&leg.angles(&(place - leg.hip)));
                }
            }
            Legs::Steps { last, idle } => {
                q.copy_from(last);
                let chains = self.robot.stance.iter().flat_map(|stance| &stance.chains);
                for (chain, place) in chains.zip(&places) {
                    chain.reach(&self.robot, &mut q, place, &back);
                }
                let (size, frequency) = IDLE;
                for &(j, middle) in idle {
                    // No two alike: a tenth between neighbours, over a range of two.
                    let own = frequency * self.faster() * (1.0 + 0.1 * (j % 10) as f64);
                    q[j] = middle + size * ease * self.tone(j, t, own);
                }
                for (q, facts) in q.iter_mut().zip(self.robot.facts()) {
                    *q = q.max(facts.limits[0]).min(facts.limits[1]);
                }
            }
        }
        if let Legs::Steps { last, .. } = &mut self.legs {
            last.copy_from(&q);
        }
        Wanted { q, shares }
    }

    /// Two sines that never repeat together, within ±1; `n` tells one from another.
    fn tone(&self, n: usize, t: f64, frequency: f64) -> f64 {
        let phase = |k: usize| self.phases[k % self.phases.len()];
        let sine = |times: f64, k| (TAU * frequency * times * t + phase(k)).sin();
        0.6 * sine(1.0, n) + 0.4 * sine(2.3, n + 6)
    }

    /// Height of the trunk above the ground (m), how it is turned, and how far it is shifted over the feet (m).
    fn trunk(&self, t: f64, ease: f64) -> (f64, Rotation3<f64>, Vector2<f64>) {
        // Roll, pitch, yaw (rad), x, y, z (m): sizes and frequencies, Hz.
        let (sizes, frequencies) = match self.gait {
            Gait::Sway => (
                [0.12, 0.11, 0.12, 0.03, 0.03, 0.03],
                [0.45, 0.55, 0.35, 0.5, 0.4, 0.6],
            ),
            Gait::Hop => (
                [0.04, 0.04, 0.0, 0.01, 0.01, 0.01],
                [0.5, 0.7, 0.3, 0.6, 0.4, 0.8],
            ),
            Gait::Trot | Gait::Flying => (
                [0.07, 0.06, 0.0, 0.01, 0.01, 0.02],
                [0.5, 0.7, 0.3, 0.6, 0.4, 0.8],
            ),
        };
        let [roll, pitch, yaw, x, y, z]: [f64; 6] = std::array::from_fn(|n| {
            let longer = if n < 3 { 1.0 } else { self.robot.longer };
            ease * sizes[n] * longer * self.tone(n, t, frequencies[n] * self.faster())
        });
        let bounce = if self.gait == Gait::Hop {
            ease * self.bounce(t)
        } else {
            0.0
        };
        (
            self.height + z + bounce,
            Rotation3::from_euler_angles(roll, pitch, yaw),
            Vector2::new(x, y),
        )
    }

    /// How much higher a hopping trunk is than at touch-down, m: a fall under gravity, and a constant acceleration off the ground.
    fn bounce(&self, t: f64) -> f64 {
        let (frequency, duty, _) = self.step();
        let (stance, flight) = (duty / frequency, (1.0 - duty) / frequency);
        let speed = GRAVITY * flight / 2.0;
        let since = (frequency * t).rem_euclid(1.0) / frequency;
        if since < stance {
            speed * since * (since / stance - 1.0)
        } else {
            let since = since - stance;
            speed * since * (1.0 - since / flight)
        }
    }

    /// Where a foot is to be from where it stands (m), and its share of the weight.
    fn foot(&self, n: usize, t: f64, ease: f64) -> (Vector3<f64>, f64) {
        let count = self.feet.len() as f64;
        if self.gait == Gait::Sway {
            return (Vector3::zeros(), 1.0 / count);
        }
        let (frequency, duty, lift) = self.step();
        let late = self.gait != Gait::Hop && self.feet[n].1;
        let phase = (frequency * t + if late { 0.5 } else { 0.0 }).rem_euclid(1.0);
        let stride = self.speed(n, t, ease) * (duty / frequency);
        if phase >= duty {
            let done = (phase - duty) / (1.0 - duty);
            let ahead = done - (TAU * done).sin() / TAU - 0.5;
            let up = lift * ease * 0.5 * (1.0 - (TAU * done).cos());
            return ((stride * ahead).push(up), 0.0);
        }
        let done = phase / duty;
        let down = if self.gait == Gait::Flying {
            PUSH * self.robot.longer * ease * (PI * done).sin()
        } else {
            0.0
        };
        // Over a whole step all feet's shares are one on average.
        let rise = (done / SHIFT).min((1.0 - done) / SHIFT).min(1.0);
        let share = rise / (count * duty * (1.0 - SHIFT));
        ((stride * (0.5 - done)).push(-down), share)
    }

    /// Velocity of the ground under a foot, as the walk wanders, m/s.
    fn speed(&self, n: usize, t: f64, ease: f64) -> Vector2<f64> {
        let share = if self.gait == Gait::Hop { 0.3 } else { 1.0 };
        let faster = self.faster();
        let wander =
            |size: f64, n, frequency| share * size * ease * self.tone(n, t, frequency * faster);
        let pace = self.robot.longer.sqrt();
        let (ahead, aside) = (wander(0.25, 2, 0.11) * pace, wander(0.1, 3, 0.13) * pace);
        let about = wander(0.3, 4, 0.1) * faster;
        let home = self.feet[n].0;
        Vector2::new(ahead - about * home.y, aside + about * home.x)
    }
}

/// Which feet step half a step after the others: along each side every other one, beginning with the first on the left and the second on the
/// right, so that of four feet two diagonal ones go together and of six three that make a triangle.
fn late(home: &[Vector2<f64>]) -> Vec<bool> {
    let middle = home.iter().sum::<Vector2<f64>>() / home.len() as f64;
    let is_left = |n: usize| home[n].y > middle.y;
    let place = |n: usize| {
        let ahead = |other: &usize| is_left(*other) == is_left(n) && home[*other].x > home[n].x;
        (0..home.len()).filter(ahead).count()
    };
    let late = |n: usize| place(n).is_multiple_of(2) == is_left(n);
    (0..home.len()).map(late).collect()
}

impl LegGeometry {
    /// A Go2's.
    fn of(robot: &WalkRobot, leg: Leg) -> Self {
        let first = 1 + JOINTS_PER_LEG * leg.index();
        let origin = |place: usize| robot.bodies[first + place].placement.translation;
        Self {
            hip: origin(0),
            out: origin(1).y,
            links: [-origin(2).z, -FOOT_SPHERE.0[2]],
        }
    }

    /// Hip, thigh and calf (rad) that put the foot's centre there, from the hip in the trunk's axes; the nearest that the leg can reach.
    fn angles(&self, foot: &Vector3<f64>) -> Vector3<f64> {
        let [thigh, calf] = self.links;
        let reach = (foot.yz().norm_squared() - self.out * self.out)
            .max(1e-4)
            .sqrt();
        let hip = foot.z.atan2(foot.y) - (-reach).atan2(self.out);
        let length = foot.x.hypot(reach).min(thigh + calf - 1e-3);
        let corner = |a: f64, b: f64, opposite: f64| {
            let cosine = (a * a + b * b - opposite * opposite) / (2.0 * a * b);
            cosine.clamp(-1.0, 1.0).acos()
        };
        let knee = corner(thigh, calf, length) - PI;
        let lean = (-foot.x).atan2(reach);
        Vector3::new(
            hip.sin().atan2(hip.cos()),
            lean + corner(thigh, length, calf),
            knee,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proprio_core::go2::{self, position_limits};
    use rand_chacha::rand_core::SeedableRng;

    fn reference(gait: Gait, seed: u64) -> Reference {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        Reference::new(gait, &Arc::new(WalkRobot::go2()), &mut rng)
    }

    /// Angles within the joints' stops, steps between neighbouring instants that a joint can follow, and weights that make one.
    #[test]
    fn references_are_smooth_and_within_the_joints_stops() {
        for (gait, seed) in Gait::ALL
            .into_iter()
            .flat_map(|gait| [(gait, 1), (gait, 2)])
        {
            let mut reference = reference(gait, seed);
            let (step, seconds) = (1e-3, 20.0);
            let count = (seconds / step) as usize;
            let (mut last, mut weight) = (reference.at(0.0).q, 0.0);
            for k in 1..=count {
                let wanted = reference.at(k as f64 * step);
                weight += wanted.shares.iter().sum::<f64>() / count as f64;
                for leg in Leg::ALL {
                    for (place, [lower, upper]) in position_limits(leg).into_iter().enumerate() {
                        let j = JOINTS_PER_LEG * leg.index() + place;
                        let (q, speed) = (wanted.q[j], (wanted.q[j] - last[j]) / step);
                        assert!(q > lower && q < upper, "{gait:?} {j} {q}");
                        assert!(speed.abs() < 15.0, "{gait:?} {j} {speed} rad/s at {k}");
                    }
                }
                last = wanted.q;
            }
            assert!((weight - 1.0).abs() < 0.02, "{gait:?} {weight}");
        }
    }

    /// The tree, which knows no inverse kinematics, puts the foot where it was asked for.
    #[test]
    fn angles_put_the_foot_where_it_was_asked_for() {
        let (robot, tree) = (WalkRobot::go2(), go2::free::<f64>());
        for leg in Leg::ALL {
            let n = leg.index();
            let geometry = LegGeometry::of(&robot, leg);
            let out = geometry.out;
            for x in [-0.1, 0.0, 0.12] {
                let asked = Vector3::new(x, out + 0.05, -0.27);
                let angles = geometry.angles(&asked);
                let first = 1 + JOINTS_PER_LEG * n;
                let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::y_axis()];
                let mut point = Vector3::new(0.0, 0.0, -0.213);
                for place in (0..JOINTS_PER_LEG).rev() {
                    point = Rotation3::from_axis_angle(&axes[place], angles[place]) * point;
                    if place > 0 {
                        point += tree.bodies()[first + place].placement.translation;
                    }
                }
                assert!((point - asked).norm() < 1e-9, "{leg:?} {point} {asked}");
            }
        }
    }
}
