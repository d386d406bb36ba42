//! The robot and its controller: what moves it, and what can be measured of it.

use nalgebra::{SMatrix, SVector, Vector3};
use proprio_core::go2::{self, ACTUATORS, IMU, JOINTS, JOINTS_PER_LEG, LEGS};
use proprio_core::spatial::Transform;
use proprio_core::tree::Tree;
use rand_chacha::ChaCha8Rng;

use super::super::lag::LaggingMotors;
use super::super::report::ReportedTorque;
use super::gait::{HEIGHT, Reference};
use super::plant::{
    BODIES, COORDINATES, Plant, State, Torques, frames, generalised, lowest, positions, seen,
};
use super::{Walk, WalkError};

/// Period of the motors' controllers, s: 4 kHz, between whose ticks the torque is held.
const PERIOD: f64 = 2.5e-4;
/// Longest integration step, s.
pub(super) const STEP: f64 = PERIOD / 2.0;
/// Gains, N m/rad and N m s/rad.
const GAIN_P: f64 = 80.0;
const GAIN_D: f64 = 2.0;
/// How long the robot stands before the log begins, s.
const SETTLE: f64 = 1.0;
/// A trunk this low (m), or so far turned that the cosine is this, lies.
const FALLEN: (f64, f64) = (0.15, 0.8);

pub(super) struct Walker {
    pub(super) plant: Plant,
    pub(super) state: State,
    reference: Reference,
    /// What the controller believes.
    cad: Tree<f64, BODIES, COORDINATES>,
    /// Ticks of the controller so far.
    ticks: u64,
    /// What is wanted at the tick to come.
    next: (Torques, [f64; LEGS]),
    reported: ReportedTorque<JOINTS>,
    motors: LaggingMotors<JOINTS>,
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
    pub(super) normal: [f64; LEGS],
}

impl Walker {
    /// Stands on its feet, a second before the log begins.
    pub(super) fn new(walk: &Walk, plant: Plant, rng: &mut ChaCha8Rng) -> Self {
        let reference = Reference::new(walk.gait, &plant.tree, rng);
        let wanted = reference.at(0.0);
        Self {
            state: State::new(-SETTLE, HEIGHT, wanted.q),
            next: (wanted.q, wanted.shares),
            reported: ReportedTorque::new(PERIOD, |j| &plant.effects[j]),
            motors: LaggingMotors::new(|j| &plant.effects[j]),
            plant,
            reference,
            cad: go2::free(),
            ticks: 0,
            given: Torques::zeros(),
        }
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
        if self.state.position.z < FALLEN.0 || up < FALLEN.1 {
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
        let speed = (self.next.0 - wanted) / PERIOD;
        let asked = (wanted - q) * GAIN_P + (speed - dq) * GAIN_D + self.forward(&wanted, &shares);
        let own = self.state.dq();
        let (mut reported, mut given) = (Torques::zeros(), Torques::zeros());
        for j in 0..JOINTS {
            let effort = ACTUATORS[j % JOINTS_PER_LEG].effort;
            reported[j] = asked[j].clamp(-effort, effort);
            let seen = seen(self.state.t, self.state.q[j], own[j]);
            let effects = self.plant.effects[j].iter();
            given[j] = effects.fold(reported[j], |tau, e| e.true_torque(tau, &seen));
        }
        self.given = self.motors.follow(PERIOD, &given);
        let t = self.state.t;
        self.reported.hold(t, t + PERIOD / 2.0, reported);
        self.ticks += 1;
    }

    /// Torques that hold the CAD's legs, and on the feet their shares of its weight, under a level trunk, N m.
    fn forward(&self, q: &Torques, shares: &[f64; LEGS]) -> Torques {
        let (base, rest) = (Transform::identity(), SVector::zeros());
        let k = self.cad.kinematics(&base, &positions(q), &rest);
        let frames = frames(&k);
        let mut torque = self.cad.gravity_torque(&k);
        let weight = torque.fixed_rows::<3>(3).norm();
        for (leg, share) in shares.iter().enumerate() {
            let force = Vector3::z() * (share * weight);
            torque -= generalised(&self.cad, &frames, leg, &lowest(&frames, leg), &force);
        }
        torque.fixed_rows::<JOINTS>(COORDINATES - JOINTS).into()
    }

    /// Positions and velocities as the motors report them.
    fn measured(&self) -> (Torques, Torques) {
        let (mut q, mut dq) = (self.state.q, self.state.dq());
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
        let before = (*self.plant.acceleration(), *self.plant.forces());
        let mut ahead = self.state;
        self.plant
            .step(&mut ahead, &self.given, STEP)
            .ok_or(WalkError::Diverged(self.state.t))?;
        let acceleration = (before.0 + self.plant.acceleration()) / 2.0;
        let after = self.plant.forces();
        let normal = std::array::from_fn(|leg| (before.1[leg].z + after[leg].z) / 2.0);
        let part = |all: &SMatrix<f64, COORDINATES, 1>, first| -> Vector3<f64> {
            all.fixed_rows::<3>(first).into()
        };
        let (angular, linear) = (part(&self.state.v, 0), part(&self.state.v, 3));
        let (turning, moving) = (part(&acceleration, 0), part(&acceleration, 3));
        let at = Vector3::from(IMU);
        let gravity = self.state.orientation.inverse() * self.plant.tree.gravity();
        let own = moving + angular.cross(&linear);
        Ok(Truth {
            q,
            dq,
            tau: self.reported.at(self.state.t),
            gyro: angular,
            acc: own + turning.cross(&at) + angular.cross(&angular.cross(&at)) - gravity,
            normal,
        })
    }
}
