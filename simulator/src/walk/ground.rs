//! Ground that gives way: what it does to the sphere at a foot's end.
//!
//! Along the normal a spring with Hunt and Crossley's damping (1975), f = k δ (1 + c δ̇), never less than nothing: the force begins
//! and ends with the depth δ, so that a touch-down has no jump, and no foot is pulled. Along the ground a bristle: a spring with a
//! damper beside it, and Coulomb's friction in series, which lets it slide once it would carry more than μ f. A foot that stands
//! does so on a spring and does not creep. Both can only take energy.

use nalgebra::{Vector2, Vector3};
use proprio_core::go2::LEGS;

use super::robot::WalkRobot;

/// Flat ground at height zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ground {
    /// k, N/m.
    pub(super) stiffness: f64,
    /// c, s/m.
    pub(super) damping: f64,
    /// Of the bristle, N/m and N s/m.
    pub(super) bristle: (f64, f64),
    /// μ.
    pub(super) friction: f64,
}

/// How a foot meets the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meeting {
    /// How deep the sphere is in the ground, m; negative in the air.
    pub(super) depth: f64,
    /// How fast that grows, m/s.
    pub(super) rate: f64,
    /// Velocity along the ground of the foot's point that touches it, m/s.
    pub(super) sliding: Vector2<f64>,
    /// How far the bristle is bent, m.
    pub(super) bent: Vector2<f64>,
}

/// What the ground answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Answer {
    /// Force on the foot in the world, N.
    pub(super) force: Vector3<f64>,
    /// How fast the bristle bends, m/s.
    pub(super) bending: Vector2<f64>,
}

impl Ground {
    /// Under a quarter of a Go2 it sinks by 0.8 mm, and under a point of any other robot by as much, so long as all bear its weight alike. Damping
    /// takes as many of the robot's own times: a pendulum's of its legs' length.
    pub(super) fn new(friction: f64, robot: &WalkRobot) -> Self {
        let points: usize = robot.feet.iter().map(|foot| foot.points.len()).sum();
        let stiffer = robot.heavier * (LEGS as f64 / points as f64);
        let slower = robot.longer.sqrt();
        Self {
            stiffness: 5e4 * stiffer,
            damping: 3.0 / slower,
            bristle: (5e4 * stiffer, 100.0 * stiffer * slower),
            friction,
        }
    }

    /// The answer in the middle of a step of `h` seconds, at whose beginning the bristle is bent as the meeting says: the midpoint rule.
    pub(super) fn answer(&self, meeting: &Meeting, h: f64) -> Answer {
        let depth = meeting.depth.max(0.0);
        let normal = (self.stiffness * depth * (1.0 + self.damping * meeting.rate)).max(0.0);
        let (stiffness, damping) = self.bristle;
        let resistance = damping + stiffness * h / 2.0;
        let bent = meeting.bent * stiffness;
        // What it would be if nothing slid.
        let stuck = bent + meeting.sliding * resistance;
        let most = self.friction * normal;
        let size = stuck.norm();
        let carried = if size > most {
            stuck * (most / size)
        } else {
            stuck
        };
        Answer {
            force: Vector3::new(-carried.x, -carried.y, normal),
            bending: (carried - bent) / resistance,
        }
    }

    /// Energy in its springs, J.
    #[cfg(test)]
    pub(super) fn energy(&self, depth: f64, bent: &Vector2<f64>) -> f64 {
        let depth = depth.max(0.0);
        0.5 * (self.stiffness * depth * depth + self.bristle.0 * bent.norm_squared())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of 4 kg on the ground, pushed ever more up to less or to more than friction holds: it moves by the spring's give and
    /// no further, or slides as Coulomb says.
    #[test]
    fn a_push_below_friction_moves_nothing_for_long() {
        let (ground, mass, h) = (Ground::new(0.9, &WalkRobot::go2()), 4.0, 1.25e-4);
        let weight = mass * 9.81;
        for (push, slides) in [(0.8 * weight, false), (1.0 * weight, true)] {
            let (mut x, mut v, mut bent) = (0.0, 0.0, Vector2::zeros());
            let mut places = Vec::new();
            for n in 0..16_000 {
                let meeting = Meeting {
                    depth: weight / ground.stiffness,
                    rate: 0.0,
                    sliding: Vector2::new(v, 0.0),
                    bent,
                };
                let answer = ground.answer(&meeting, h);
                let force: Vector2<f64> = answer.force.xy();
                assert!(force.norm() <= ground.friction * answer.force.z * (1.0 + 1e-12));
                let pushed = push * (f64::from(n) / 4000.0).min(1.0);
                v += h * (pushed + force.x) / mass;
                x += h * v;
                bent += answer.bending * h;
                places.push(x);
            }
            if slides {
                let (gone, time) = (x - places[8000], 8000.0 * h);
                let acceleration = push / mass - 0.9 * 9.81;
                let expected = acceleration * time * (0.525 + time / 2.0);
                assert!((gone / expected - 1.0).abs() < 0.02, "{gone} {expected}");
            } else {
                assert!((x - push / ground.bristle.0).abs() < 1e-6, "{x}");
                assert!((x - places[8000]).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn nothing_is_pulled_and_nothing_pushed_in_the_air() {
        let ground = Ground::new(0.9, &WalkRobot::go2());
        let meeting = |depth, rate| Meeting {
            depth,
            rate,
            sliding: Vector2::new(0.3, 0.1),
            bent: Vector2::new(1e-3, 0.0),
        };
        for (depth, rate) in [(-1e-3, 0.0), (-1e-3, 5.0), (1e-3, -5.0)] {
            let answer = ground.answer(&meeting(depth, rate), 1e-4);
            assert_eq!(answer.force, Vector3::zeros());
            // The bristle straightens by itself.
            assert!(answer.bending.x < 0.0);
        }
        assert!(ground.answer(&meeting(1e-3, 0.1), 1e-4).force.z > 50.0);
    }
}
