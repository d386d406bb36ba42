//! The robot and its controller: what moves it, and what can be measured of it.

use nalgebra::{DVector, Vector3};
use rand_chacha::ChaCha8Rng;

use super::super::lag::LaggingMotors;
use super::super::report::ReportedTorque;
use super::gait::Reference;
use super::mechanics::{Mechanics, mechanics};
use super::plant::{Coordinates, Plant, State, Torques, generalised, lowest, of_joints, seen};
use super::{Walk, WalkError};

/// Period of the motors' controllers, s: 4 kHz, between whose ticks the torque is held.
const PERIOD: f64 = 2.5e-4;
/// Longest integration step, s.
pub(super) const STEP: f64 = PERIOD / 2.0;
/// Gains of a Go2, N m/rad and N m s/rad.
const GAIN_P: f64 = 80.0;
const GAIN_D: f64 = 2.0;
/// Largest gain of the velocity, as a share of the joint's own inertia over a period: at twice the inertia a held torque reverses the motion.
const HELD: f64 = 0.3;
/// How long the robot stands before the log begins, s.
const SETTLE: f64 = 1.0;
/// A trunk that is this low, as a share of its height as it stands, or so far turned that the cosine is this, lies.
const FALLEN: (f64, f64) = (0.15 / 0.29, 0.8);

pub(super) struct Walker {
    pub(super) plant: Plant,
    pub(super) state: State,
    reference: Reference,
    /// What the controller believes.
    cad: Box<dyn Mechanics>,
    /// Of each joint, N m/rad and N m s/rad.
    gains: Vec<[f64; 2]>,
    /// Ticks of the controller so far.
    ticks: u64,
    /// What is wanted at the tick to come.
    next: (Torques, Vec<f64>),
    reported: ReportedTorque,
    motors: LaggingMotors,
    /// The torque that the motors give now, N m.
    given: Torques,
}

/// What there is to measure at one instant.
pub(super) struct Truth {
    pub(super) q: Torques,
    pub(super) dq: Torques,
    pub(super) tau: Torques,
    /// Angular velocity, rad/s, and specific force at the IMU, m/s², in its axes.
    pub(super) gyro: Vector3<f64>,
    pub(super) acc: Vector3<f64>,
    /// Forces on the feet along the ground's normal, N.
    pub(super) normal: Vec<f64>,
}

impl Walker {
    /// Stands on its feet, a second before the log begins.
    pub(super) fn new(walk: &Walk, plant: Plant, rng: &mut ChaCha8Rng) -> Option<Self> {
        let mut reference = Reference::new(walk.gait, &plant.robot, rng);
        let wanted = reference.at(0.0);
        let state = State::new(
            -SETTLE,
            reference.height(),
            wanted.q.clone(),
            plant.points(),
        );
        Some(Self {
            gains: gains(&plant, &state),
            next: (wanted.q, wanted.shares),
            reported: ReportedTorque::new(PERIOD, plant.effects.iter()),
            motors: LaggingMotors::new(plant.effects.iter()),
            cad: mechanics(&plant.robot.bodies)?,
            given: Torques::zeros(state.q.len()),
            plant,
            reference,
            state,
            ticks: 0,
        })
    }

    /// Integrates up to time `t`, s.
    pub(super) fn advance_to(&mut self, t: f64) -> Result<(), WalkError> {
        while self.state.t < t - 1e-12 {
            // Half a period after the recorder's clock: a sample meets the middle of a hold, whose torque is that of the instant.
            let tick = (self.ticks as f64 - 0.5) * PERIOD - SETTLE;
            if self.state.t > tick - 1e-12 {
                self.control();
                continue;
            }
            self.integrate_to(t.min(tick))?;
        }
        Ok(())
    }

    fn integrate_to(&mut self, t: f64) -> Result<(), WalkError> {
        let steps = ((t - self.state.t) / STEP - 1e-6).ceil().max(1.0);
        let h = (t - self.state.t) / steps;
        for _ in 0..steps as u64 {
            let moved = self.plant.step(&mut self.state, &self.given, h);
            if moved.is_none() || !self.state.is_finite() {
                return Err(WalkError::Diverged(self.state.t));
            }
        }
        self.state.t = t;
        let up = (self.state.orientation * Vector3::z()).z;
        if self.state.position.z < FALLEN.0 * self.reference.height() || up < FALLEN.1 {
            return Err(WalkError::Fell(t));
        }
        Ok(())
    }

    /// A tick of the controllers: PD on the reference and a feed-forward torque, within what the motors can give.
    fn control(&mut self) {
        let (q, dq) = self.measured();
        let later = self.reference.at(self.state.t + PERIOD);
        let later = (later.q, later.shares);
        let (wanted, shares) = std::mem::replace(&mut self.next, later);
        let speed = (&self.next.0 - &wanted) / PERIOD;
        let forward = self.forward(&wanted, &shares);
        let own = self.state.dq();
        let mut reported = Torques::zeros(q.len());
        let mut given = Torques::zeros(q.len());
        for (j, facts) in self.plant.robot.facts().iter().enumerate() {
            let [gain_p, gain_d] = self.gains[j];
            let asked = (wanted[j] - q[j]) * gain_p + (speed[j] - dq[j]) * gain_d + forward[j];
            reported[j] = asked.clamp(-facts.effort, facts.effort);
            let seen = seen(self.state.t, self.state.q[j], own[j]);
            let effects = self.plant.effects[j].iter();
            given[j] = effects.fold(reported[j], |tau, e| e.true_torque(tau, &seen));
        }
        self.motors.follow(PERIOD, given.as_mut_slice());
        self.given = given;
        let t = self.state.t;
        self.reported.hold(t, t + PERIOD / 2.0, reported.as_slice());
        self.ticks += 1;
    }

    /// Torques that hold the CAD's legs, and on the feet their shares of its weight, under a level trunk, N m.
    fn forward(&self, q: &Torques, shares: &[f64]) -> Torques {
        let (frames, mut torque) = self.cad.held(q);
        let weight = torque.fixed_rows::<3>(3).norm();
        let robot = &self.plant.robot;
        for (foot, share) in robot.feet.iter().zip(shares) {
            let force = Vector3::z() * (share * weight);
            let point = lowest(&frames[foot.body], &foot.middle(), foot.radius);
            torque -= generalised(robot, &frames, foot.body, &point, &force);
        }
        of_joints(&torque)
    }

    /// Positions and velocities as the motors report them.
    fn measured(&self) -> (Torques, Torques) {
        let (mut q, mut dq) = (self.state.q.clone(), self.state.dq());
        for (j, effects) in self.plant.effects.iter().enumerate() {
            for effect in effects {
                (q[j], dq[j]) = effect.reported(q[j], dq[j]);
            }
        }
        (q, dq)
    }

    /// What there is to measure now. What is a mean over a step is the mean of the last step and of the one to come, so that it is
    /// no half step late.
    pub(super) fn truth(&mut self) -> Result<Truth, WalkError> {
        let (q, dq) = self.measured();
        let before = self.plant.acceleration().clone();
        let forces = self.plant.on_feet(self.plant.forces());
        let mut ahead = self.state.clone();
        self.plant
            .step(&mut ahead, &self.given, STEP)
            .ok_or(WalkError::Diverged(self.state.t))?;
        let acceleration = (before + self.plant.acceleration()) / 2.0;
        let after = self.plant.on_feet(self.plant.forces());
        let normal = forces.iter().zip(&after);
        let normal = normal
            .map(|(before, after)| (before + after) / 2.0)
            .collect();
        let part = |all: &Coordinates, first| -> Vector3<f64> { all.fixed_rows::<3>(first).into() };
        let (angular, linear) = (part(&self.state.v, 0), part(&self.state.v, 3));
        let (turning, moving) = (part(&acceleration, 0), part(&acceleration, 3));
        let imu = &self.plant.robot.imu;
        let at = imu.translation;
        let gravity = self.state.orientation.inverse() * self.plant.mechanics.gravity();
        let own = moving + angular.cross(&linear);
        let acc = own + turning.cross(&at) + angular.cross(&angular.cross(&at)) - gravity;
        Ok(Truth {
            q,
            dq,
            tau: DVector::from_iterator(self.given.len(), self.reported.at(self.state.t)),
            gyro: imu.rotation.tr_mul(&angular),
            acc: imu.rotation.tr_mul(&acc),
            normal,
        })
    }
}

/// The controllers' gains. A joint whose body and rotor weigh little beside the robot has smaller ones, which a torque that is held for a period bears.
fn gains(plant: &Plant, state: &State) -> Vec<[f64; 2]> {
    let robot = &plant.robot;
    let usual = [GAIN_P, GAIN_D];
    if robot.stance.is_none() {
        return vec![usual; robot.facts().len()];
    }
    let unit = robot.heavier * robot.longer;
    let slower = robot.longer.sqrt();
    let [gain_p, gain_d] = [GAIN_P * unit, GAIN_D * unit * slower];
    let inertia = plant.inertia_of_joints(state);
    let of = |own: &f64| {
        let share = (HELD * own / PERIOD / gain_d).min(1.0);
        [gain_p * share, gain_d * share]
    };
    inertia.iter().map(of).collect()
}
