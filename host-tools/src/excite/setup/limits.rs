//! Where a motion begins and ends, and what it must keep to.

use proprio_core::go2::Leg;

use super::Design;
use crate::excite::clearance::Clearance;
use crate::excite::problem::{JointLimits, Limits, Problem};
use crate::excite::{ExciteError, go2};

/// A joint without stops moves this far at most, rad: two turns either way.
const WHOLE_TURNS: f64 = 2.0 * std::f64::consts::TAU;

impl Design<'_> {
    /// A bent leg, hips a little outwards, less bent where it must keep to its quarter; other robots in the middle of their range.
    pub(super) fn pose(&self, alone: bool) -> Result<Vec<f64>, ExciteError> {
        let bodies = self.model.robot().bodies();
        let usual = |b: usize| match self.leg() {
            Some(leg) => {
                let outwards = if matches!(leg, Leg::FL | Leg::RL) {
                    0.1
                } else {
                    -0.1
                };
                let [thigh, calf] = if alone { [0.9, -1.7] } else { [0.6, -1.5] };
                [outwards, thigh, calf][b - self.limb.bodies.start]
            }
            None => {
                let [lower, upper] = bodies[b].limits;
                if lower.is_finite() && upper.is_finite() {
                    (lower + upper) / 2.0
                } else {
                    0.0
                }
            }
        };
        let mut pose: Vec<f64> = self.limb.bodies.clone().map(usual).collect();
        for (name, value) in &self.settings.pose {
            let joint = self.model.robot().joint(name)?;
            if self.limb.bodies.contains(&joint) {
                pose[joint - self.limb.bodies.start] = *value;
            }
        }
        Ok(pose)
    }

    pub(super) fn limits(&self, alone: bool) -> Result<Limits, ExciteError> {
        let m = &self.settings.margins;
        let limits = |b: usize| {
            let body = &self.model.robot().bodies()[b];
            let [lower, upper] = body.limits;
            let joint = JointLimits {
                // Without stops a joint still has cables.
                position: [
                    (lower + m.position).max(-WHOLE_TURNS),
                    (upper - m.position).min(WHOLE_TURNS),
                ],
                velocity: body.velocity * m.velocity,
                acceleration: m.acceleration,
                torque: body.effort * m.torque,
                power: 0.25 * body.effort * body.velocity * m.power,
            };
            let no_room = |what| ExciteError::NoRoom {
                joint: body.name.clone(),
                what,
            };
            let exceeds =
                |x: f64, least: f64| x.partial_cmp(&least) == Some(std::cmp::Ordering::Greater);
            if !exceeds(joint.position[1] - joint.position[0], 1e-3) {
                return Err(no_room("position"));
            }
            if !exceeds(joint.velocity, 0.0) {
                return Err(no_room("velocity"));
            }
            if !exceeds(joint.torque, 0.0) {
                return Err(no_room("torque"));
            }
            Ok(joint)
        };
        Ok(Limits {
            joints: self
                .limb
                .bodies
                .clone()
                .map(limits)
                .collect::<Result<_, _>>()?,
            uncertainty: m.uncertainty,
            clearance: self.clearance(alone)?,
            margin: m.distance,
        })
    }

    /// The Go2's own shapes and those that are stated.
    fn clearance(&self, alone: bool) -> Result<Clearance, ExciteError> {
        let ground = self.settings.margins.ground;
        let own = self
            .leg()
            .map_or_else(Clearance::default, |leg| go2::clearance(leg, alone, ground));
        match &self.settings.shapes {
            Some(shapes) => Ok(own.and(shapes.of_limb(self.model, self.limb)?)),
            None => Ok(own),
        }
    }

    /// The pose itself must be within the limits.
    pub(super) fn feasible(&self, problem: &Problem) -> Result<(), ExciteError> {
        let x = vec![0.0; problem.unknowns()];
        let constraints = problem.evaluate(&x, 1.0).constraints;
        let most = |a: &usize, b: &usize| constraints[*a].total_cmp(&constraints[*b]);
        let beyond =
            || (0..constraints.len()).filter(|n| constraints[*n] > 0.0 || constraints[*n].is_nan());
        // A joint's own limit says more than what its link then comes near.
        let of_joint = beyond()
            .filter(|n| problem.constraint(*n).1.is_some())
            .max_by(most);
        let Some(worst) = of_joint.or_else(|| beyond().max_by(most)) else {
            return Ok(());
        };
        let (what, joint) = problem.constraint(worst);
        let name = |j: usize| self.model.joint_name(self.limb.bodies.start + j);
        let poses = problem.pose.iter().enumerate();
        let poses: Vec<String> = poses.map(|(j, q)| format!("{}={q:.3}", name(j))).collect();
        Err(ExciteError::Pose {
            pose: poses.join(","),
            what: joint.map_or_else(|| what.clone(), |j| format!("{what} of {}", name(j))),
            percent: 100.0 * constraints[worst],
        })
    }
}
