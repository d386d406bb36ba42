//! A whole robot on its feet: it trots, flies, hops or sways over ground that gives way, and is logged with its IMU and its feet.
//!
//! A Go2, or any robot with feet and an IMU ([`WalkRobot`]); its bodies are the CAD or something near it; joints have the effects of
//! `simulator`'s pinned legs. Nothing holds the trunk but the ground (`ground`), so that mass, centre of mass and friction are in the log as they
//! are in that of a robot. `robot` is what is known of it, `stance` how it stands, `gait` what the legs are asked to do, `walker` the motors'
//! controllers, `plant` the mechanics over the bodies of `mechanics`, `imu` the sensors; `tests` hold it against mechanics. A joint's stops and the
//! limbs' touching each other are not simulated: no gait comes near them.

mod gait;
mod ground;
mod imu;
mod mechanics;
mod plant;
mod robot;
mod stance;
#[cfg(test)]
mod tests;
mod walker;

use std::sync::Arc;

use proprio_core::go2::LEGS;
use proprio_core::inertia::InertialParameters;
use proprio_core::tree::Body;
use rand_chacha::ChaCha8Rng;

use super::effect::{Effect, Site};
use super::{
    BODY_STREAM, HiddenEffect, HiddenKind, NOISE_STREAM, REFERENCE_STREAM, Sensors,
    SimulatedSample, inertia_error, random, truth_of_body, truth_of_joint,
};
use crate::TrueValue;
pub use gait::Gait;
use ground::Ground;
use imu::{Imu, Pads};
use mechanics::mechanics;
use plant::{Plant, Torques};
pub use robot::{JointFacts, WalkFoot, WalkJoint, WalkRobot};
use walker::Walker;

/// Random numbers of their own, beyond those of pinned legs: the trunk's body, the IMU's biases, the feet's pads.
const TRUNK_STREAM: u64 = BODY_STREAM + LEGS as u64;
const IMU_STREAM: u64 = TRUNK_STREAM + 1;
const PAD_STREAM: u64 = TRUNK_STREAM + 2;

/// What to simulate.
#[derive(Debug, Clone)]
pub struct Walk {
    /// Who goes.
    pub robot: Arc<WalkRobot>,
    /// How it goes.
    pub gait: Gait,
    /// Length, s; before it the robot stands for a second, which is not logged.
    pub duration: f64,
    /// Samples per second.
    pub rate: f64,
    /// What is added to the rigid bodies, of the kinds of [`walking`](super::hidden::walking); of several entries for one effect and
    /// place the last holds.
    pub effects: Vec<HiddenEffect<WalkJoint>>,
    /// How far the bodies are off the CAD, as of [`Simulation`](super::Simulation::inertia_error).
    pub inertia_error: f64,
    /// Coulomb friction between feet and ground; a robot's rubber has 0.9 on most floors.
    pub ground_friction: f64,
    /// What lies between the motion and the log; its noise is a multiple of the IMU's noise and biases too.
    pub sensors: Sensors,
    /// Chooses the gait's slow motions and all that is random.
    pub seed: u64,
}

/// One sample of a simulated walk.
#[derive(Debug, Clone, PartialEq)]
pub struct WalkSample {
    /// Time and joints, in the robot's order.
    pub joints: SimulatedSample,
    /// Angular velocity as the gyro reads it, rad/s, in its axes.
    pub gyro: [f64; 3],
    /// Specific force as the accelerometer reads it, m/s², in its axes.
    pub acc: [f64; 3],
    /// Counts of the feet's pads in the robot's order, in no unit.
    pub foot: Vec<f64>,
}

/// A walk that came to an end.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WalkError {
    /// A robot that cannot be simulated.
    #[error("this robot cannot walk: {0}")]
    Robot(String),
    /// A foot that cannot be where it has to.
    #[error("this robot cannot stand on its foot {foot}: {why}")]
    Stance {
        /// Its name.
        foot: String,
        /// What is in the way.
        why: String,
    },
    /// A gait that lifts more feet than its controller, which holds positions, can balance.
    #[error("a robot on {feet} feet falls in a {gait}: joint controllers alone do not balance it", gait = .gait.name())]
    Gait {
        /// Which.
        gait: Gait,
        /// How many feet the robot has.
        feet: usize,
    },
    /// The motion left the real numbers.
    #[error("the simulated robot's motion diverged after {0:.3} s")]
    Diverged(f64),
    /// The robot lies on the ground; before time zero it was to stand.
    #[error("the simulated robot {}", fell(*.0))]
    Fell(f64),
}

fn fell(t: f64) -> String {
    if t < 0.0 {
        "cannot stand".to_owned()
    } else {
        format!("fell after {t:.1} s")
    }
}

/// What follows from several parameters, named as by `identify --free-base`.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Quantity {
    /// `total_mass`, `trunk_com_x`.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
}

impl Walk {
    /// 20 s at 500 Hz of a Go2's rigid bodies with real sensors on a good floor.
    pub fn new(gait: Gait) -> Self {
        Self {
            robot: Arc::new(WalkRobot::go2()),
            gait,
            duration: 20.0,
            rate: 500.0,
            effects: Vec::new(),
            inertia_error: 0.0,
            ground_friction: 0.9,
            sensors: Sensors::default(),
            seed: 1,
        }
    }

    /// The samples, one after the other.
    ///
    /// # Errors
    /// An item is a [`WalkError`], and the last, if the robot cannot walk so, falls, or its motion is no longer finite.
    pub fn samples(&self) -> impl Iterator<Item = Result<WalkSample, WalkError>> + '_ {
        let mut walker = self.walker();
        let imu = self.imu();
        let (feet, heavier) = (self.robot.feet.len(), self.robot.heavier);
        let mut pads = Pads::new(feet, heavier, &mut random(self.seed, PAD_STREAM));
        let mut rng = random(self.seed, NOISE_STREAM);
        let (mut previous, mut noise) = (None::<WalkSample>, Vec::new());
        let mut failed = false;
        let count = (self.duration * self.rate).round() as u64;
        (0..=count).map_while(move |k| {
            if failed {
                return None;
            }
            let sensors = &self.sensors;
            let t = sensors.sampling_time(k, self.rate, &mut rng);
            let walker = walker.as_mut().map_err(|error| error.clone());
            let truth = walker.and_then(|walker| {
                walker.advance_to(t)?;
                walker.truth()
            });
            failed = truth.is_err();
            Some(truth.map(|truth| {
                noise = sensors.torque_noise_after(&noise, truth.q.len(), self.rate, &mut rng);
                let foot = pads.read(t, &truth.normal, sensors, &mut rng);
                let repeated = previous.is_some() && sensors.repeated(&mut rng);
                let mut sample = match previous.take().filter(|_| repeated) {
                    Some(previous) => previous,
                    None => self.measured(&truth, &noise, foot, &imu, &mut rng),
                };
                sample.joints.t = t;
                previous = Some(sample.clone());
                sample
            }))
        })
    }

    fn measured(
        &self,
        truth: &walker::Truth,
        noise: &[f64],
        foot: Vec<f64>,
        imu: &Imu,
        rng: &mut ChaCha8Rng,
    ) -> WalkSample {
        let values = |torques: &Torques| torques.as_slice().to_vec();
        let joints = SimulatedSample {
            t: 0.0,
            q: values(&truth.q),
            dq: values(&truth.dq),
            tau: values(&truth.tau),
            temp: None,
            q_link: None,
        };
        let own = |joint: usize| self.robot.sensors[joint];
        let joints = self.sensors.measure_anew(joints, noise, own, rng);
        let (gyro, acc) = imu.read(&truth.gyro, &truth.acc, &self.sensors, rng);
        WalkSample {
            joints,
            gyro,
            acc,
            foot,
        }
    }

    fn imu(&self) -> Imu {
        Imu::new(&self.sensors, &mut random(self.seed, IMU_STREAM))
    }

    fn walker(&self) -> Result<Walker, WalkError> {
        let (gait, feet) = (self.gait, self.robot.feet.len());
        if gait != Gait::Sway && feet < LEGS {
            return Err(WalkError::Gait { gait, feet });
        }
        let mut rng = random(self.seed, REFERENCE_STREAM);
        let walker = self
            .plant()
            .and_then(|plant| Walker::new(self, plant, &mut rng));
        walker.ok_or_else(|| WalkError::Robot("its bodies make no tree".to_owned()))
    }

    fn plant(&self) -> Option<Plant> {
        let effects = (0..self.robot.facts().len()).map(|j| self.effects_at(j));
        let ground = Ground::new(self.ground_friction, &self.robot);
        let bodies = self.robot.bodies.iter().zip(self.loaded_bodies());
        let bodies: Vec<Body<f64>> = bodies
            .map(|(body, inertia)| Body { inertia, ..*body })
            .collect();
        Plant::new(&self.robot, &bodies, effects.collect(), ground)
    }

    /// What a joint has, in the order of the catalogue.
    fn effects_at(&self, j: usize) -> Vec<Box<dyn Effect>> {
        let site = Site {
            gear: self.robot.facts()[j].gear,
            centre: self.robot.centre[j],
            duration: self.duration,
        };
        let joints = self.robot.joints();
        let hidden = HiddenEffect::at_joint(&self.effects, &joints[j]).into_iter();
        hidden.map(|e| e.kind().build(e.values(), &site)).collect()
    }

    /// The true bodies, the trunk first, without payloads.
    pub fn bodies(&self) -> Vec<InertialParameters<f64>> {
        let cad = self.robot.bodies.iter().map(|body| body.inertia);
        let mut bodies: Vec<InertialParameters<f64>> = cad.collect();
        let perturb = |body: &mut InertialParameters<f64>, rng: &mut ChaCha8Rng| {
            *body = inertia_error::perturbed(body, self.inertia_error, rng);
        };
        perturb(&mut bodies[0], &mut random(self.seed, TRUNK_STREAM));
        for (n, limb) in self.robot.limbs().into_iter().enumerate() {
            let stream = BODY_STREAM + WalkRobot::stream_of_limb(n);
            let mut rng = random(self.seed, stream);
            bodies[limb]
                .iter_mut()
                .for_each(|body| perturb(body, &mut rng));
        }
        bodies
    }

    /// The bodies with what they carry.
    fn loaded_bodies(&self) -> Vec<InertialParameters<f64>> {
        let mut bodies = self.bodies();
        for j in 0..self.robot.facts().len() {
            let effects = self.effects_at(j);
            bodies[1 + j] = effects.iter().fold(bodies[1 + j], |sum, e| sum + e.load());
        }
        if let Some(load) = self.on_trunk() {
            let site = Site {
                gear: 1.0,
                centre: 0.0,
                duration: self.duration,
            };
            bodies[0] = bodies[0] + load.kind().build(load.values(), &site).load();
        }
        bodies
    }

    /// The payload on the trunk.
    fn on_trunk(&self) -> Option<&HiddenEffect<WalkJoint>> {
        let is =
            |e: &&HiddenEffect<WalkJoint>| e.kind() == HiddenKind::Payload && e.joint().is_none();
        self.effects.iter().rfind(is)
    }

    /// The truth by the names of `identify --free-base`: bodies (without payloads), the effects that are estimated by default (zero
    /// where there is none), all others, the trunk's payload, what the IMU adds to its readings, and the ground's friction.
    pub fn truth(&self) -> Vec<TrueValue> {
        let bodies = self.bodies();
        let joints = self.robot.facts().iter().map(|joint| joint.name.as_str());
        let names = std::iter::once("base").chain(joints);
        let mut truth: Vec<TrueValue> = names
            .zip(&bodies)
            .flat_map(|(name, body)| truth_of_body(name, body))
            .collect();
        for joint in self.robot.joints() {
            truth.extend(truth_of_joint(&self.effects, &joint, |_| 0.0));
        }
        truth.extend(self.on_trunk().into_iter().flat_map(|e| e.parameters()));
        let imu = self.imu();
        for (what, unit, bias) in [
            ("acc_bias", "m/s^2", imu.acc_bias),
            ("gyro_bias", "rad/s", imu.gyro_bias),
        ] {
            let axes = ["x", "y", "z"].into_iter().zip(bias.iter());
            truth.extend(axes.map(|(axis, &value)| TrueValue {
                name: format!("{what}.{axis}:imu"),
                unit,
                value,
            }));
        }
        truth.push(TrueValue {
            name: "friction:ground".to_owned(),
            unit: "1",
            value: self.ground_friction,
        });
        truth
    }

    /// Masses and centres of mass, payloads among them: the trunk's about its origin, and the whole robot's about it with each joint where
    /// its facts have it: a Go2's hips at 0, thighs at 0.8 and calves at −1.6 rad.
    pub fn quantities(&self) -> Vec<Quantity> {
        let bodies = self.loaded_bodies();
        let frames = mechanics(&self.robot.bodies).map(|own| own.held(&self.robot.standing()).0);
        let whole = bodies
            .iter()
            .zip(frames.iter().flatten())
            .fold(InertialParameters::zero(), |sum, (body, frame)| {
                sum + body.in_parent(frame)
            });
        let of = |name, unit, value| Quantity { name, unit, value };
        let mut all = vec![
            of("total_mass", "kg", whole.mass()),
            of("trunk_mass", "kg", bodies[0].mass()),
        ];
        for (names, body) in [
            (["trunk_com_x", "trunk_com_y", "trunk_com_z"], &bodies[0]),
            (["robot_com_x", "robot_com_y", "robot_com_z"], &whole),
        ] {
            let com = body.first_moment() / body.mass();
            all.extend((0..3).map(|axis| of(names[axis], "m", com[axis])));
        }
        all
    }
}
