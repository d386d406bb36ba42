//! A simulated robot whose truth is known: one to four pinned legs that follow a reference, and the log they make; and in [`walk`]
//! the whole robot on its feet; in [`poses`] an arm at rest, measured by a tracker; in [`frf`] one
//! with elastic joints under periodic excitation.
//!
//! The bodies are the Go2's CAD or, as on a real robot, something near it ([`Simulation::inertia_error`]). What is added to
//! them are effects in continuous time (`effect/`, one file each), which share nothing with the identification's columns,
//! and forward dynamics moves them (`plant`), moved by motors that may lag (`lag`). A controller of 4 kHz gives PD on the reference and the CAD's inverse
//! dynamics; the sensors add noise, the quanta of the motor bus, jitter and repeated messages. A seed gives the same log
//! everywhere, and the same reference, bodies and noise whatever is hidden.

mod dry;
mod effect;
pub mod follow;
pub mod frf;
pub mod hidden;
mod inertia_error;
mod lag;
mod leg;
mod motion;
mod plant;
pub mod poses;
mod report;
mod sensors;
mod sizes;
mod suspension;
#[cfg(test)]
mod tests;
pub mod walk;

use std::sync::Arc;

use proprio_core::estimator::EFFECTS;
use proprio_core::go2::{self, ACTUATORS, JOINTS_PER_LEG, JointId, Leg};
use proprio_core::inertia::{InertialParameters, NAMES, UNITS};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::Serialize;

pub use effect::{
    CoupledTorque, Description, HiddenKind, Instant, OwnHidden, Parameter as EffectParameter, Scope,
};
pub use follow::{FollowError, Followed};
pub use hidden::{HiddenEffect, HiddenError, HiddenJoint, Hide};
use leg::{PERIOD, SimulatedLeg};
pub use motion::Motion;
pub use sensors::Sensors;
pub use sizes::{SIZES, Sizes};
use suspension::Suspension;

/// Random numbers of each kind come from a stream of their own: references, noise, then one leg's bodies after the other.
const REFERENCE_STREAM: u64 = 0;
const NOISE_STREAM: u64 = 1;
const BODY_STREAM: u64 = 2;

/// What to simulate.
#[derive(Debug, Clone)]
pub struct Simulation {
    /// Which legs, each with its base pinned.
    pub legs: Vec<Leg>,
    /// What the joints are asked to do.
    pub motion: Motion,
    /// A motion to follow instead, with its feed-forward torque and its gains, by the legs that it moves.
    pub follow: Option<Arc<Followed>>,
    /// Length, s.
    pub duration: f64,
    /// Samples per second.
    pub rate: f64,
    /// What is added to the rigid body; of several entries for one effect and joint the last holds.
    pub effects: Vec<HiddenEffect>,
    /// How far the bodies are off the CAD: relative standard deviation of a mass, and centres of mass and inertias to match;
    /// drawn from the seed.
    pub inertia_error: f64,
    /// Roll, pitch, yaw of the base in the world, rad, which the controller knows.
    pub mount: [f64; 3],
    /// Whether the motors' temperatures are logged; they are if an effect depends on them.
    pub temperature: bool,
    /// Whether each joint has a second encoder, at its link.
    pub second_encoder: bool,
    /// What lies between the motion and the log.
    pub sensors: Sensors,
    /// Chooses the reference and all that is random.
    pub seed: u64,
}

/// A parameter of the truth, by the name that `identify` has for it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueValue {
    /// `m:FR_hip`, `coulomb:FR_hip`, `vs:stribeck:FR_hip`.
    pub name: String,
    /// SI unit.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
}

/// One sample of a simulated log, its joints leg by leg.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedSample {
    /// Time, s.
    pub t: f64,
    /// Position, rad.
    pub q: Vec<f64>,
    /// Velocity, rad/s.
    pub dq: Vec<f64>,
    /// Motor torque, N m.
    pub tau: Vec<f64>,
    /// Motor temperature, °C, where it is logged.
    pub temp: Option<Vec<f64>>,
    /// Position of a second encoder at the link, rad, where it is logged.
    pub q_link: Option<Vec<f64>>,
}

/// A simulation that left the real numbers: an effect that has no motion, such as a body of no inertia.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the simulation of leg {} diverged after {t:.3} s", .leg.name())]
pub struct Diverged {
    /// The leg that did.
    pub leg: Leg,
    /// When, s.
    pub t: f64,
}

impl Simulation {
    /// `legs` follow the default reference for 20 s at 500 Hz, rigid bodies with real sensors.
    pub fn new(legs: &[Leg]) -> Self {
        Self {
            legs: legs.to_vec(),
            motion: Motion::Multisine,
            follow: None,
            duration: 20.0,
            rate: 500.0,
            effects: Vec::new(),
            inertia_error: 0.0,
            mount: [0.0; 3],
            temperature: false,
            second_encoder: false,
            sensors: Sensors::default(),
            seed: 1,
        }
    }

    /// The samples, one after the other.
    ///
    /// # Errors
    /// An item is [`Diverged`], and the last, if the motion is no longer finite.
    pub fn samples(&self) -> impl Iterator<Item = Result<SimulatedSample, Diverged>> + '_ {
        let mut rng = self.random(REFERENCE_STREAM);
        let mut legs: Vec<SimulatedLeg> = self
            .legs
            .iter()
            .map(|&leg| SimulatedLeg::new(leg, self, &mut rng))
            .collect();
        let mut rng = self.random(NOISE_STREAM);
        let thermal = self.logs_temperature();
        let suspension = self.suspension();
        let count = (self.duration * self.rate).round() as u64;
        let (mut previous, mut noise) = (None, Vec::new());
        let mut failed = false;
        (0..=count).map_while(move |k| {
            if failed {
                return None;
            }
            let t = self.sensors.sampling_time(k, self.rate, &mut rng);
            let moved = advance(&mut legs, suspension.as_ref(), t);
            let sample = moved.map(|()| {
                let truth = sample(&legs, t, thermal, self.second_encoder);
                let (sensors, joints) = (&self.sensors, truth.tau.len());
                noise = sensors.torque_noise_after(&noise, joints, self.rate, &mut rng);
                let measured = sensors.measure(truth, &noise, previous.as_ref(), &mut rng);
                previous = Some(measured.clone());
                measured
            });
            failed = sample.is_err();
            Some(sample)
        })
    }

    /// Whether the samples have temperatures.
    pub fn logs_temperature(&self) -> bool {
        self.temperature || self.built().any(|effect| effect.is_thermal())
    }

    /// The true bodies of a leg, without payloads.
    pub fn bodies(&self, leg: Leg) -> [InertialParameters<f64>; JOINTS_PER_LEG] {
        let mut rng = self.random(BODY_STREAM + leg.index() as u64);
        let cad = go2::leg::<f64>(leg).bodies().map(|body| body.inertia);
        cad.map(|body| inertia_error::perturbed(&body, self.inertia_error, &mut rng))
    }

    /// The truth by name: each leg's bodies (without payloads), the effects that are estimated by default (zero where there
    /// is none), then the parameters of all other effects, those of the base last.
    pub fn truth(&self) -> Vec<TrueValue> {
        let legs = self.legs.iter().flat_map(|&leg| self.truth_of_leg(leg));
        let base = self.effects.iter().filter(|e| e.joint().is_none());
        legs.chain(base.flat_map(|e| e.parameters())).collect()
    }

    fn truth_of_leg(&self, leg: Leg) -> Vec<TrueValue> {
        let joints = JointId::of(leg);
        let mut truth = Vec::new();
        for (&joint, body) in joints.iter().zip(&self.bodies(leg)) {
            truth.extend(truth_of_body(joint.name(), body));
        }
        for joint in joints {
            let unstated = |kind| self.unstated(kind, joint);
            truth.extend(truth_of_joint(&self.effects, &joint, unstated));
        }
        truth
    }

    /// What a joint has of an effect that nobody asked for: a motor that something parts from its link has a rotor.
    fn unstated(&self, kind: HiddenKind, joint: JointId) -> f64 {
        let parted = [HiddenKind::Elasticity, HiddenKind::Backlash];
        let mut own = self.effects.iter().filter(|e| e.joint() == Some(joint));
        if kind == HiddenKind::Armature && own.any(|e| parted.contains(&e.kind())) {
            ACTUATORS[joint.place()].armature()
        } else {
            0.0
        }
    }

    /// Roll and pitch of the base beyond the known mount, rad.
    fn tilt(&self) -> [f64; 2] {
        let tilts = self.built().map(|effect| effect.tilt());
        tilts.fold([0.0; 2], |sum, tilt| [sum[0] + tilt[0], sum[1] + tilt[1]])
    }

    /// A base that the legs move, if it is one.
    fn suspension(&self) -> Option<Suspension> {
        let share = self
            .built()
            .map(|effect| effect.recoil())
            .fold(0.0, f64::max);
        (share > 0.0).then(|| Suspension::new(share, |leg| self.bodies(leg)))
    }

    fn built(&self) -> impl Iterator<Item = Box<dyn effect::Effect>> {
        let site = effect::Site {
            gear: 1.0,
            centre: 0.0,
            duration: self.duration,
        };
        self.effects
            .iter()
            .map(move |e| e.kind().build(e.values(), &site))
    }

    fn random(&self, stream: u64) -> ChaCha8Rng {
        random(self.seed, stream)
    }
}

/// The random numbers of one kind that a seed gives.
fn random(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng
}

/// The inertial parameters of the body called `name`.
fn truth_of_body(
    name: &str,
    body: &InertialParameters<f64>,
) -> impl Iterator<Item = TrueValue> + use<> {
    let (name, body) = (name.to_owned(), body.0);
    NAMES.iter().enumerate().map(move |(n, what)| TrueValue {
        name: format!("{what}:{name}"),
        unit: UNITS[n],
        value: body[n],
    })
}

/// The effects at a joint: those that are estimated by default in any case, with a value `unstated` where nobody asked for them.
fn truth_of_joint<J: HiddenJoint>(
    effects: &[HiddenEffect<J>],
    joint: &J,
    unstated: impl Fn(HiddenKind) -> f64,
) -> Vec<TrueValue> {
    let mut truth = Vec::new();
    let default = |kind: HiddenKind| EFFECTS.iter().any(|e| e.name() == kind.name());
    let there = HiddenEffect::at_joint(effects, joint);
    let own = there.iter().map(|e| e.kind());
    let own = own.filter(|kind| !HiddenKind::ALL.contains(kind));
    for kind in HiddenKind::ALL.iter().copied().chain(own) {
        match there.iter().find(|e| e.kind() == kind) {
            Some(effect) => truth.extend(effect.parameters()),
            None if default(kind) => truth.push(TrueValue {
                name: format!("{}:{joint}", kind.name()),
                unit: kind.description().parameters[0].unit,
                value: unstated(kind),
            }),
            None => {}
        }
    }
    truth
}

/// All legs up to time `t`, s; over a base that they move, tick by tick.
fn advance(
    legs: &mut [SimulatedLeg],
    suspension: Option<&Suspension>,
    t: f64,
) -> Result<(), Diverged> {
    let Some(suspension) = suspension else {
        return legs.iter_mut().try_for_each(|leg| leg.advance_to(t));
    };
    let Some(start) = legs.first().map(SimulatedLeg::time) else {
        return Ok(());
    };
    let ticks = ((t - start) / PERIOD - 1e-6).ceil().max(0.0) as u64;
    for tick in 1..=ticks {
        let motions: Vec<_> = legs.iter().map(SimulatedLeg::motion).collect();
        for (leg, felt) in legs.iter_mut().zip(suspension.felt(&motions)) {
            leg.feel(felt);
            leg.advance_to(t.min(start + tick as f64 * PERIOD))?;
        }
    }
    Ok(())
}

/// All legs at time `t`, s.
fn sample(legs: &[SimulatedLeg], t: f64, thermal: bool, second_encoder: bool) -> SimulatedSample {
    let joints = JOINTS_PER_LEG * legs.len();
    let empty = || Vec::with_capacity(joints);
    let mut sample = SimulatedSample {
        t,
        q: empty(),
        dq: empty(),
        tau: empty(),
        temp: thermal.then(empty),
        q_link: second_encoder.then(empty),
    };
    for leg in legs {
        let report = leg.report();
        sample.q.extend(report.q.iter());
        sample.dq.extend(report.dq.iter());
        sample.tau.extend(report.tau.iter());
        if let Some(temp) = &mut sample.temp {
            temp.extend(report.temperature.iter());
        }
        if let Some(q_link) = &mut sample.q_link {
            q_link.extend(report.link.iter());
        }
    }
    sample
}
