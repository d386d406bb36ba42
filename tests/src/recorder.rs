//! Logs of robots that are no Go2, not made with the identification's columns: motions are given in closed form, so that velocity
//! and acceleration are exact, and torque is recursive Newton-Euler plus what the motors have, sampled with noise and steps.

use std::f64::consts::TAU;
use std::fmt::Write;

use nalgebra::SVector;
use proprio_core::spatial::Transform;
use proprio_host::model::{Limb, Model, Robot};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// What a motor has beyond the rigid bodies.
#[derive(Clone, Copy)]
pub struct Motor {
    /// Viscous friction, N m s/rad.
    pub viscous: f64,
    /// Coulomb friction, N m.
    pub coulomb: f64,
    /// Inertia of the rotor seen at the joint, kg m².
    pub armature: f64,
    /// Constant torque, N m.
    pub bias: f64,
    /// Stiffness, N m/rad, and where it is at rest, rad.
    pub spring: [f64; 2],
}

impl Motor {
    /// Joint `n`'s: each a little different.
    fn typical(n: usize) -> Self {
        let n = n as f64;
        Self {
            viscous: 0.12 + 0.03 * n,
            coulomb: 0.35 - 0.04 * n,
            armature: 0.012 + 0.002 * n,
            bias: 0.1 - 0.05 * n,
            spring: [0.0; 2],
        }
    }

    /// An effect's parameter by its name in the catalogue.
    pub fn value(&self, effect: &str) -> f64 {
        match effect {
            "viscous" => self.viscous,
            "coulomb" => self.coulomb,
            "armature" => self.armature,
            "bias" => self.bias,
            other => panic!("{other}"),
        }
    }

    fn torque(&self, q: f64, dq: f64, ddq: f64) -> f64 {
        let [stiffness, rest] = self.spring;
        self.viscous * dq
            + self.coulomb * dq.signum()
            + self.armature * ddq
            + self.bias
            + stiffness * (q - rest)
    }
}

/// Position, velocity and acceleration of a robot's joint `n` at time `t`: three sines within its limits.
fn motion(robot: &Robot, n: usize, t: f64) -> [f64; 3] {
    let [lower, upper] = robot.bodies()[n].limits;
    let (centre, reach) = if lower.is_finite() {
        (0.5 * (lower + upper), 0.5 * (upper - lower))
    } else {
        (0.0, 1.5)
    };
    let pitch = 1.0 + 0.13 * n as f64;
    let sines = [(0.55, 0.23), (0.2, 0.71), (0.08, 1.9)];
    let mut state = [centre, 0.0, 0.0];
    for (k, (share, hertz)) in sines.into_iter().enumerate() {
        let (amplitude, omega) = (share * reach, TAU * hertz * pitch);
        let (sine, cosine) = (omega * t + (n + 2 * k) as f64).sin_cos();
        state[0] += amplitude * sine;
        state[1] += amplitude * omega * cosine;
        state[2] -= amplitude * omega * omega * sine;
    }
    state
}

/// A recording of some limbs of a robot.
pub struct Recorder {
    /// The robot by its CAD.
    pub model: Model,
    /// Of each joint.
    pub motors: Vec<Motor>,
    /// Length of the log, s.
    pub duration: f64,
    /// Of the noise.
    pub seed: u64,
    /// How the base is mounted.
    pub base: Transform<f64>,
    /// What is reported of the bodies' torques: shares of what accelerates them, of centrifugal and Coriolis forces, and of gravity.
    pub parts: [f64; 3],
    /// By what the mass and the moments of inertia of each body are multiplied.
    pub bodies: Vec<f64>,
}

/// Between samples, s.
const PERIOD: f64 = 0.002;
/// Steps of the reported torque, N m.
pub const TORQUE_STEP: f64 = 0.005;

impl Recorder {
    /// 12 s of a robot whose motors are typical.
    pub fn new(robot: Robot) -> Self {
        let count = robot.bodies().len();
        Self {
            motors: (0..count).map(|n| Motor::typical(n % 5)).collect(),
            base: Transform::identity(),
            parts: [1.0; 3],
            bodies: (0..count)
                .map(|n| if n % 2 == 0 { 1.04 } else { 0.97 })
                .collect(),
            model: Model::new(robot),
            duration: 12.0,
            seed: 1,
        }
    }

    /// The motor of the joint of this name.
    pub fn motor(&mut self, joint: &str) -> &mut Motor {
        let joint = self.model.robot().joint(joint).unwrap();
        &mut self.motors[joint]
    }

    /// The torques of a limb at each moment. The true bodies are not the CAD's: each is heavier or lighter.
    fn torques<const N: usize>(&self, limb: &Limb) -> Vec<[f64; N]> {
        let robot = self.model.robot();
        let tree = self.model.limb_tree::<N>(limb).unwrap();
        let mut bodies = tree.bodies().map(|body| body.inertia);
        for (body, times) in bodies.iter_mut().zip(&self.bodies[limb.bodies.clone()]) {
            body.0 *= *times;
        }
        let tree = tree.with_inertia(&bodies);
        let at = |k: usize| {
            let state = |j: usize| motion(robot, limb.bodies.start + j, k as f64 * PERIOD);
            let [q, dq, ddq] = [0, 1, 2].map(|d| SVector::<f64, N>::from_fn(|j, _| state(j)[d]));
            let zero = SVector::<f64, N>::zeros();
            let torque = |dq: &SVector<f64, N>, ddq: &SVector<f64, N>| {
                tree.inverse_dynamics(&tree.kinematics(&self.base, &q, dq), dq, ddq)
            };
            let (weight, slow) = (torque(&zero, &zero), torque(&zero, &ddq));
            let all = torque(&dq, &ddq);
            let [inertial, centrifugal, gravity] = self.parts;
            let rigid = inertial * (slow - weight) + centrifugal * (all - slow) + gravity * weight;
            let motor = |j: usize| self.motors[limb.bodies.start + j].torque(q[j], dq[j], ddq[j]);
            std::array::from_fn(|j| rigid[j] + motor(j))
        };
        (0..self.samples()).map(at).collect()
    }

    fn samples(&self) -> usize {
        (self.duration / PERIOD) as usize
    }

    /// The log as text: joints last to first, and a column that no one knows.
    pub fn log<const N: usize>(&self, limbs: &[&Limb]) -> String {
        let robot = self.model.robot();
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let noise = Normal::new(0.0, 1.0).unwrap();
        let torques: Vec<_> = limbs.iter().map(|limb| self.torques::<N>(limb)).collect();
        let mut text = String::from("note,t");
        for limb in limbs {
            for joint in limb.bodies.clone().rev() {
                let name = &robot.bodies()[joint].name;
                write!(text, ",tau/{name},q/{name},dq/{name}").unwrap();
            }
        }
        for k in 0..self.samples() {
            let t = k as f64 * PERIOD;
            write!(text, "\nx,{t:.3}").unwrap();
            for (limb, torques) in limbs.iter().zip(&torques) {
                for joint in limb.bodies.clone().rev() {
                    let [q, dq, _] = motion(robot, joint, t);
                    let exact = torques[k][joint - limb.bodies.start];
                    let tau = exact + 0.03 * noise.sample(&mut random);
                    let tau = (tau / TORQUE_STEP).round() * TORQUE_STEP;
                    let dq = dq + 0.003 * noise.sample(&mut random);
                    write!(text, ",{tau:.4},{q:.6},{dq:.5}").unwrap();
                }
            }
        }
        text + "\n"
    }
}
