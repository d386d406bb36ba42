//! One pinned leg: its mechanics, its motors with their controller, and what the bus reports of them.

use std::sync::Arc;

use nalgebra::{Rotation3, Vector3};
use proprio_core::go2::{self, ACTUATORS, JOINTS_PER_LEG as JOINTS, JointId, Leg};
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::effect::{Effect, Site, Transmission};
use super::follow::Followed;
use super::hidden::HiddenEffect;
use super::lag::LaggingMotors;
use super::motion::{Reference, Wanted, centre};
use super::plant::{Plant, PlantJoint, State};
use super::report::ReportedTorque;
use super::suspension::LegMotion;
use super::{Diverged, Simulation};

/// Period of the controller, s: 4 kHz, between whose ticks the torque is held.
pub(super) const PERIOD: f64 = 2.5e-4;
/// Longest integration step, s.
const STEP: f64 = PERIOD / 2.0;
/// Controller gains, N m/rad and N m s/rad.
const GAIN_P: f64 = 40.0;
const GAIN_D: f64 = 1.5;
/// Motor temperatures at the start, °C: a robot that has been used a little.
const TEMPERATURES: std::ops::Range<f64> = 30.0..45.0;

pub(super) struct SimulatedLeg {
    leg: Leg,
    plant: Plant,
    state: State,
    reference: Reference,
    follow: Option<Arc<Followed>>,
    /// What the controller believes: the CAD, and how the base is said to be mounted.
    cad: Tree<f64, JOINTS, JOINTS>,
    mount: Transform<f64>,
    /// Ticks of the controller so far.
    ticks: u64,
    reported: ReportedTorque,
    motors: LaggingMotors,
    /// The torque that the motors give now, N m.
    given: Vector3<f64>,
}

/// A leg's motors and what they report, at one instant.
pub(super) struct Report {
    pub(super) q: Vector3<f64>,
    pub(super) dq: Vector3<f64>,
    pub(super) tau: Vector3<f64>,
    pub(super) temperature: Vector3<f64>,
    /// Position of the link, rad.
    pub(super) link: Vector3<f64>,
}

impl SimulatedLeg {
    pub(super) fn new(leg: Leg, simulation: &Simulation, rng: &mut ChaCha8Rng) -> Self {
        let reference = Reference::new(simulation.motion, leg, simulation.duration, rng);
        let temperature = Vector3::from_fn(|_, _| rng.random_range(TEMPERATURES));
        let [roll, pitch, yaw] = simulation.mount;
        let mount = turned(Rotation3::from_euler_angles(roll, pitch, yaw));
        let joints: [PlantJoint; JOINTS] =
            std::array::from_fn(|place| joint(simulation, leg, place));
        let mut bodies = simulation.bodies(leg);
        for (body, joint) in bodies.iter_mut().zip(&joints) {
            let effects: &Vec<Box<dyn Effect>> = &joint.effects;
            *body = effects.iter().fold(*body, |sum, e| sum + e.load());
        }
        let effects = || joints.iter().map(|joint: &PlantJoint| &joint.effects);
        let reported = ReportedTorque::new(PERIOD, effects());
        let motors = LaggingMotors::new(effects());
        let [roll, pitch] = simulation.tilt();
        let base = mount.compose(&turned(Rotation3::from_euler_angles(roll, pitch, 0.0)));
        let follow = simulation.follow.clone();
        let followed = follow.as_ref().and_then(|motion| motion.at(leg, 0.0));
        let wanted = followed.map_or_else(|| reference.at(0.0), |(wanted, ..)| wanted);
        let mut leg = Self {
            leg,
            plant: Plant::new(go2::leg(leg).with_inertia(&bodies), base, joints),
            state: State::new(wanted.q, wanted.dq, temperature),
            reference,
            follow,
            cad: go2::leg(leg),
            mount,
            ticks: 0,
            reported,
            motors,
            given: Vector3::zeros(),
        };
        leg.control();
        leg.plant.begin(&leg.state, &leg.given);
        leg
    }

    /// s.
    pub(super) fn time(&self) -> f64 {
        self.state.t
    }

    /// Which leg, and what its links do.
    pub(super) fn motion(&self) -> (Leg, LegMotion) {
        let state = &self.state;
        (
            self.leg,
            [state.q, state.dq, self.plant.last_acceleration()],
        )
    }

    /// Lets the joints feel so much of a base that moves, N m.
    pub(super) fn feel(&mut self, recoil: Vector3<f64>) {
        self.plant.recoil = recoil;
    }

    /// What the bus tells of the leg now, before noise and quanta.
    pub(super) fn report(&self) -> Report {
        let (q, dq) = self.measured();
        let mut torques = self.reported.at(self.state.t);
        let tau = Vector3::from_fn(|_, _| torques.next().unwrap_or(0.0));
        Report {
            q,
            dq,
            tau,
            temperature: self.state.temperature,
            link: self.state.q,
        }
    }

    /// Integrates up to time `t`, s.
    pub(super) fn advance_to(&mut self, t: f64) -> Result<(), Diverged> {
        while self.state.t < t - 1e-12 {
            // Half a period after the recorder's clock: a sample meets the middle of a hold, whose torque is that of the
            // instant; at a hold's start it would seem late by half a period.
            let tick = (self.ticks as f64 - 0.5) * PERIOD;
            if self.state.t > tick - 1e-12 {
                self.control();
                continue;
            }
            self.integrate_to(t.min(tick))?;
        }
        Ok(())
    }

    fn integrate_to(&mut self, t: f64) -> Result<(), Diverged> {
        let steps = ((t - self.state.t) / STEP - 1e-6).ceil().max(1.0);
        let h = (t - self.state.t) / steps;
        for _ in 0..steps as u64 {
            let moved = self.plant.step(&mut self.state, &self.given, h);
            let state = self.state.q.iter().chain(self.state.dq.iter());
            if !moved || state.into_iter().any(|value| !value.is_finite()) {
                let (leg, t) = (self.leg, self.state.t);
                return Err(Diverged { leg, t });
            }
        }
        self.state.t = t;
        Ok(())
    }

    /// What is asked for at time `t`, the torque that goes with it by the CAD or by the motion that is followed, and the gains.
    fn asked(&self, t: f64) -> (Wanted, Vector3<f64>, [Vector3<f64>; 2]) {
        if let Some(asked) = self
            .follow
            .as_ref()
            .and_then(|motion| motion.at(self.leg, t))
        {
            return asked;
        }
        let wanted = self.reference.at(t);
        let k = self.cad.kinematics(&self.mount, &wanted.q, &wanted.dq);
        let forward = self.cad.inverse_dynamics(&k, &wanted.dq, &wanted.ddq);
        (wanted, forward, [GAIN_P, GAIN_D].map(Vector3::repeat))
    }

    /// A tick of the controller: PD on the reference and a feed-forward torque, within what the motor can give.
    fn control(&mut self) {
        let t = self.state.t;
        let (q, dq) = self.measured();
        let (wanted, forward, [gain_p, gain_d]) = self.asked(t);
        let back = (wanted.q - q).component_mul(&gain_p) + (wanted.dq - dq).component_mul(&gain_d);
        let (mut reported, mut asked) = (Vector3::zeros(), Vector3::zeros());
        for j in 0..JOINTS {
            let effort = ACTUATORS[j].effort;
            reported[j] = (forward[j] + back[j]).clamp(-effort, effort);
            let seen = self.plant.seen(j, 0, &self.state, 0.0);
            let effects = self.plant.joints[j].effects.iter();
            asked[j] = effects.fold(reported[j], |tau, e| e.true_torque(tau, &seen));
        }
        self.motors.follow(PERIOD, asked.as_mut_slice());
        self.given = asked;
        let middle = if self.ticks == 0 {
            0.0
        } else {
            t + PERIOD / 2.0
        };
        self.reported.hold(t, middle, reported.as_slice());
        self.ticks += 1;
    }

    /// Position and velocity as the motors report them.
    fn measured(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (mut q, mut dq) = (self.state.motor_q, self.state.motor_dq);
        for (j, joint) in self.plant.joints.iter().enumerate() {
            for effect in &joint.effects {
                (q[j], dq[j]) = effect.reported(q[j], dq[j]);
            }
        }
        (q, dq)
    }
}

#[cfg(test)]
impl SimulatedLeg {
    pub(super) fn state(&self) -> &State {
        &self.state
    }

    /// The motors' true torques now, N m.
    pub(super) fn given(&self) -> Vector3<f64> {
        self.given
    }

    pub(super) fn accelerations(&self) -> super::plant::Accelerations {
        self.plant.accelerations(&self.state, &self.given).unwrap()
    }

    /// A step without motors.
    pub(super) fn step_passively(&mut self, h: f64) {
        assert!(self.plant.step(&mut self.state, &Vector3::zeros(), h));
    }
}

/// A frame turned about its parent's origin.
fn turned(rotation: Rotation3<f64>) -> Transform<f64> {
    Transform {
        rotation: *rotation.matrix(),
        ..Transform::identity()
    }
}

/// What a leg's joint has beyond the rigid bodies, in the order of the catalogue, which is that of the physics: a wrong
/// torque constant comes before a limit.
fn joint(simulation: &Simulation, leg: Leg, place: usize) -> PlantJoint {
    let actuator = &ACTUATORS[place];
    let site = Site {
        gear: actuator.gear,
        centre: centre(leg)[place],
        duration: simulation.duration,
    };
    let hidden = HiddenEffect::at_joint(&simulation.effects, &JointId::of(leg)[place]);
    let hidden = hidden.into_iter();
    let effects: Vec<Box<dyn Effect>> = hidden.map(|e| e.kind().build(e.values(), &site)).collect();
    let transmission = effects.iter().filter_map(|e| e.transmission()).reduce(both);
    let mut armature = effects.iter().map(|e| e.armature()).sum();
    let coupled_inertia = effects.iter().map(|e| e.coupled_inertia()).sum();
    if transmission.is_some() && armature == 0.0 {
        // A motor that has a position of its own has a mass.
        armature = actuator.armature();
    }
    PlantJoint {
        effects,
        armature,
        coupled_inertia,
        transmission,
        gear: actuator.gear,
    }
}

/// A spring and a play in one gear: the spring's stiffness, the play's gap.
fn both(spring: Transmission, play: Transmission) -> Transmission {
    Transmission {
        gap: spring.gap.max(play.gap),
        ..spring
    }
}
