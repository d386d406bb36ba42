//! What an effect's parameters are taken to be before any data, at a joint of any robot: zero, within what the joint's limits and the robot's
//! own size leave room for. The catalogue's own numbers are a Go2's ([`Effect::prior`](proprio_core::effect::EffectKind::prior_of)).
//!
//! A prior is there so that what the data do not tell stays small, not to tell the value: it must never be narrower than what such a
//! joint can have.

use proprio_core::effect::{EffectKind, Form, Prior};
use proprio_core::go2::{Actuator, JOINTS_PER_LEG};

use super::robot::{Body, JointKind, Motor, Robot, go2_motor};

/// No drive takes longer than this to its greatest velocity with all its effort and nothing to carry, s.
const SLOWEST: f64 = 1.0;
/// No gear gives way by more than this under all its effort, rad. A Go2's prior is that of its hip; where the stated effort is greater, it
/// is often no drive's, and a Go2's holds.
const SOFTEST: f64 = 0.25;
const SOFT: f64 = 0.01;
/// Share of its viscous friction by which a joint's changes with a degree: grease's viscosity halves within some tens of degrees.
const PER_DEGREE: f64 = 0.01;
/// A load's mass as a share of the limb's, which is what arms are rated for (a tenth to a third), and of the limb's reach how far its
/// centre of mass is from the body's and its radius of gyration: a Go2's leg has the catalogue's prior by them.
const LOAD: f64 = 0.25;
const LOAD_OFFSET: f64 = 0.2;
const LOAD_GYRATION: f64 = 0.3;

impl Robot {
    /// What an effect's first parameter at a joint is taken to be before any data.
    pub fn effect_prior(&self, effect: EffectKind, joint: usize) -> Prior {
        self.parameter_prior(effect, joint, 0)
    }

    /// What one of an effect's parameters at a joint is taken to be before any data: of a Go2's drive what the catalogue says, of another
    /// one nothing, up to what its limits of effort and velocity, and a load's mass and size, leave room for.
    ///
    /// Where the motor is not known, rotor inertia is taken to be zero within the inertia that the joint moves, for a motor is geared to
    /// match its load; or within what leaves the drive time to reach its greatest velocity, if that is more: an arm's wrist carries
    /// little of its own.
    pub fn parameter_prior(&self, effect: EffectKind, joint: usize, parameter: usize) -> Prior {
        let body = &self.bodies()[joint];
        // One from outside the catalogue brings its own, of any drive.
        if let EffectKind::Own(own) = effect {
            return own.prior(parameter);
        }
        let unit = effect.description().parameters[parameter].unit;
        let room = match (effect.description().form, unit) {
            (Form::Inertia, _) => self.room_for_load(joint, unit),
            // Of all torques only a rotor's has an inertia.
            (_, "kg m^2") => {
                (body.motor.is_none()).then(|| self.moved_inertia(joint).max(body.rotor_room()))
            }
            _ => body.room_for(unit),
        };
        if let (false, Some(std)) = (body.is_go2s(), room) {
            return Prior { mean: 0.0, std };
        }
        let motor = body.motor.unwrap_or(Motor {
            gear: 0.0,
            rotor_inertia: 0.0,
        });
        let actuator = Actuator {
            gear: motor.gear,
            rotor_inertia: motor.rotor_inertia,
            effort: body.effort,
            velocity: body.velocity,
        };
        effect.prior_of(&actuator, parameter)
    }

    /// Inertia (kg m² or kg) that a joint moves at zero position, by the CAD.
    fn moved_inertia(&self, joint: usize) -> f64 {
        let bodies = self.bodies();
        let mut composite: Vec<_> = bodies.iter().map(|body| body.inertia).collect();
        for b in self.subtree(joint).skip(1).rev() {
            let carried = composite[b].in_parent(&bodies[b].placement);
            if let Some(parent) = bodies[b].parent {
                composite[parent] = composite[parent] + carried;
            }
        }
        let (phi, axis) = (&composite[joint], &bodies[joint].axis);
        match bodies[joint].kind {
            JointKind::Prismatic => phi.mass(),
            _ => axis.dot(&(phi.rotational_inertia() * axis)),
        }
    }

    /// What a load on a joint's body may be, in `unit`, by the mass and the reach of its limb; `None` if they do not tell.
    fn room_for_load(&self, joint: usize, unit: &str) -> Option<f64> {
        let bodies = self.bodies();
        let root = std::iter::successors(Some(joint), |&b| bodies[b].parent).last()?;
        let limb = self.subtree(root);
        let mass: f64 = bodies[limb.clone()].iter().map(|b| b.inertia.mass()).sum();
        let links = bodies[limb].iter().skip(1);
        let reach: f64 = links.map(|b| b.placement.translation.norm()).sum();
        let room = LOAD
            * mass
            * match unit {
                "kg" => 1.0,
                "kg m" => LOAD_OFFSET * reach,
                _ => (LOAD_GYRATION * reach).powi(2),
            };
        Some(room).filter(|room| *room > 0.0)
    }
}

impl Body {
    /// Whether its drive is one of a Go2's.
    fn is_go2s(&self) -> bool {
        (0..JOINTS_PER_LEG).any(|place| self.motor == Some(go2_motor(place)))
    }

    /// The greatest rotor inertia, at the joint, that its limits leave room for, kg m² (or kg); zero if they do not tell.
    fn rotor_room(&self) -> f64 {
        self.room_for("N m s/rad")
            .map_or(0.0, |effort_over_velocity| SLOWEST * effort_over_velocity)
    }

    /// The greatest value in `unit` that this joint's limits of effort and velocity leave room for; `None` if they do not tell.
    fn room_for(&self, unit: &str) -> Option<f64> {
        let known = |limit: f64| Some(limit).filter(|limit| limit.is_finite() && *limit > 0.0);
        let effort = known(self.effort)?;
        match unit {
            "N m" => Some(effort),
            "N m s/rad" => Some(effort / known(self.velocity)?),
            "N m s/(rad °C)" => Some(PER_DEGREE * effort / known(self.velocity)?),
            "N m s^2/rad^2" => Some(effort / known(self.velocity)?.powi(2)),
            // By a radian, or a metre, from where it is slack.
            "N m/rad" => Some(effort),
            "rad/(N m)" => Some((SOFTEST / effort).max(SOFT)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use proprio_core::go2::ACTUATORS;

    use super::*;

    /// A Go2 of which nobody knows the motors.
    fn motorless() -> Robot {
        let mut robot = Robot::go2();
        for joint in 0..robot.bodies().len() {
            robot.set_motor(joint, None);
        }
        robot
    }

    #[test]
    fn the_go2_has_the_priors_of_the_core() {
        let robot = Robot::go2();
        for joint in 0..robot.bodies().len() {
            for &effect in EffectKind::ALL {
                let actuator = &ACTUATORS[joint % JOINTS_PER_LEG];
                assert_eq!(robot.effect_prior(effect, joint), effect.prior(actuator));
            }
        }
    }

    #[test]
    fn no_prior_is_half_as_wide_as_a_go2s_where_its_motors_are_not_known() {
        let (known, unknown) = (Robot::go2(), motorless());
        for joint in 0..known.bodies().len() {
            for &effect in EffectKind::ALL {
                for parameter in 0..effect.description().parameters.len() {
                    let of = |robot: &Robot| robot.parameter_prior(effect, joint, parameter).std;
                    let [known, unknown] = [of(&known), of(&unknown)];
                    assert!(unknown > 0.5 * known, "{} {parameter}", effect.name());
                }
            }
        }
    }

    #[test]
    fn a_motor_that_is_stated_is_no_go2s() {
        let mut robot = motorless();
        let before = robot.effect_prior(EffectKind::Coulomb, 0);
        let (gear, rotor_inertia) = (100.0, 1e-5);
        robot.set_motor(
            0,
            Some(Motor {
                gear,
                rotor_inertia,
            }),
        );
        assert_eq!(robot.effect_prior(EffectKind::Coulomb, 0), before);
        let armature = robot.effect_prior(EffectKind::Armature, 0).mean;
        assert!((armature - gear * gear * rotor_inertia).abs() < 1e-12);
    }
}
