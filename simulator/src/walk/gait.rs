//! What the legs are asked to do: joint angles over time, and how the robot's weight is shared among its feet.
//!
//! A gait is where each foot is to be under a level trunk, and how the trunk is to stand above them; a leg's inverse kinematics
//! makes angles of it. Beside the step itself all trunks roll, pitch and shift a little, and all walks wander, so that a log tells
//! more than one motion over and over. It begins at rest and grows over a second.

use std::f64::consts::{PI, TAU};

use nalgebra::{Rotation3, Vector2, Vector3};
use proprio_core::go2::{FOOT_SPHERE, JOINTS_PER_LEG, LEGS, Leg};
use proprio_core::tree::Tree;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::plant::Torques;

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

/// Height of the trunk above the ground, m.
pub(super) const HEIGHT: f64 = 0.29;
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
    phases: [f64; 2 * LEGS + 4],
    legs: [LegGeometry; LEGS],
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
    pub(super) shares: [f64; LEGS],
}

impl Reference {
    /// Draws the phases; `tree` gives the legs' lengths.
    pub(super) fn new(gait: Gait, tree: &Tree<f64, 13, 18>, rng: &mut ChaCha8Rng) -> Self {
        let origin = |leg: usize, place: usize| {
            tree.bodies()[1 + JOINTS_PER_LEG * leg + place]
                .placement
                .translation
        };
        Self {
            gait,
            phases: std::array::from_fn(|_| rng.random_range(0.0..TAU)),
            legs: std::array::from_fn(|leg| LegGeometry {
                hip: origin(leg, 0),
                out: origin(leg, 1).y,
                links: [-origin(leg, 2).z, -FOOT_SPHERE.0[2]],
            }),
        }
    }

    /// At time `t`, s; before zero the robot stands.
    pub(super) fn at(&self, t: f64) -> Wanted {
        let t = t.max(0.0);
        let ease = 0.5 - 0.5 * (PI * (t / EASE).min(1.0)).cos();
        let (height, turned, shift) = self.trunk(t, ease);
        let (mut q, mut shares) = (Torques::zeros(), [0.0; LEGS]);
        for leg in Leg::ALL {
            let n = leg.index();
            let (foot, share) = self.foot(leg, t, ease);
            let LegGeometry { hip, out, .. } = self.legs[n];
            let under = Vector3::new(hip.x - shift.x, hip.y + out - shift.y, -height);
            let from_hip = turned.inverse() * (under + foot) - hip;
            let angles = self.legs[n].angles(&from_hip);
            q.fixed_rows_mut::<JOINTS_PER_LEG>(JOINTS_PER_LEG * n)
                .copy_from(&angles);
            shares[n] = (1.0 - ease) / LEGS as f64 + ease * share;
        }
        Wanted { q, shares }
    }

    /// Two sines that never repeat together, within ±1; `n` tells one from another.
    fn tone(&self, n: usize, t: f64, frequency: f64) -> f64 {
        let phase = |k: usize| self.phases[k % self.phases.len()];
        let sine = |times: f64, k| (TAU * frequency * times * t + phase(k)).sin();
        0.6 * sine(1.0, n) + 0.4 * sine(2.3, n + 6)
    }

    /// Height of the trunk above the feet's centres (m), how it is turned, and how far it is shifted over them (m).
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
        let [roll, pitch, yaw, x, y, z]: [f64; 6] =
            std::array::from_fn(|n| ease * sizes[n] * self.tone(n, t, frequencies[n]));
        let bounce = if self.gait == Gait::Hop {
            ease * self.bounce(t)
        } else {
            0.0
        };
        (
            HEIGHT + z + bounce - FOOT_SPHERE.1,
            Rotation3::from_euler_angles(roll, pitch, yaw),
            Vector2::new(x, y),
        )
    }

    /// How much higher a hopping trunk is than at touch-down, m: a fall under gravity, and a constant acceleration off the ground.
    fn bounce(&self, t: f64) -> f64 {
        let (frequency, duty, _) = self.gait.step();
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
    fn foot(&self, leg: Leg, t: f64, ease: f64) -> (Vector3<f64>, f64) {
        if self.gait == Gait::Sway {
            return (Vector3::zeros(), 1.0 / LEGS as f64);
        }
        let (frequency, duty, lift) = self.gait.step();
        let late = self.gait != Gait::Hop && matches!(leg, Leg::FL | Leg::RR);
        let phase = (frequency * t + if late { 0.5 } else { 0.0 }).rem_euclid(1.0);
        let stride = self.speed(leg, t, ease) * (duty / frequency);
        if phase >= duty {
            let done = (phase - duty) / (1.0 - duty);
            let ahead = done - (TAU * done).sin() / TAU - 0.5;
            let up = lift * ease * 0.5 * (1.0 - (TAU * done).cos());
            return ((stride * ahead).push(up), 0.0);
        }
        let done = phase / duty;
        let down = if self.gait == Gait::Flying {
            PUSH * ease * (PI * done).sin()
        } else {
            0.0
        };
        // Over a whole step all feet's shares are one on average.
        let rise = (done / SHIFT).min((1.0 - done) / SHIFT).min(1.0);
        let share = rise / (LEGS as f64 * duty * (1.0 - SHIFT));
        ((stride * (0.5 - done)).push(-down), share)
    }

    /// Velocity of the ground under a foot, as the walk wanders, m/s.
    fn speed(&self, leg: Leg, t: f64, ease: f64) -> Vector2<f64> {
        let share = if self.gait == Gait::Hop { 0.3 } else { 1.0 };
        let wander = |size: f64, n, frequency| share * size * ease * self.tone(n, t, frequency);
        let (ahead, aside) = (wander(0.25, 2, 0.11), wander(0.1, 3, 0.13));
        let about = wander(0.3, 4, 0.1);
        let LegGeometry { hip, out, .. } = self.legs[leg.index()];
        Vector2::new(ahead - about * (hip.y + out), aside + about * hip.x)
    }
}

impl LegGeometry {
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
        Reference::new(gait, &go2::free(), &mut rng)
    }

    /// Angles within the joints' stops, steps between neighbouring instants that a joint can follow, and weights that make one.
    #[test]
    fn references_are_smooth_and_within_the_joints_stops() {
        for (gait, seed) in Gait::ALL
            .into_iter()
            .flat_map(|gait| [(gait, 1), (gait, 2)])
        {
            let reference = reference(gait, seed);
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
        let (reference, tree) = (reference(Gait::Trot, 1), go2::free::<f64>());
        for leg in Leg::ALL {
            let n = leg.index();
            let out = reference.legs[n].out;
            for x in [-0.1, 0.0, 0.12] {
                let asked = Vector3::new(x, out + 0.05, -0.27);
                let angles = reference.legs[n].angles(&asked);
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
