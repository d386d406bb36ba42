//! A robot with elastic joints under periodic excitation: a log for frequency responses, and a slow one of the same robot.
//!
//! Each joint has a motor of inertia J with viscous and Coulomb friction, a spring and a damper, and behind it a link of the tree; gravity acts
//! on the links. Links may bend about axes without a motor. Motors are decoupled, so that Coulomb friction is an impulse of at most F_c Δt against each one's velocity, exact in sticking
//! too. Positions move half a step before and after the forces (position Verlet): second order, and it keeps a spring's energy.
//!
//! A controller of the sampling rate plays a plan, sample by sample ([`FrfCommand`]): feed-forward torque, and feedback on position and velocity.
//! Who makes the plan, and how responses are estimated, nothing here knows. `robot` beside: the mechanics.

mod robot;

use nalgebra::{Isometry3, Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

use crate::TrueValue;
use robot::Robot;

/// The longest step, s: with 120 Hz the fastest spring, ω Δt is 0.2 and its frequency right within 0.2 %; at 30 Hz within 0.01 %.
const STEP: f64 = 0.25e-3;
/// Bandwidth of the controller of slow motion, Hz, and its damping ratio.
const BANDWIDTH: f64 = 2.0;
const CONTROL_DAMPING: f64 = 0.7;
/// Noise of a motor's encoder, rad; of its velocity, rad/s; of the torque, as a share of the greatest effort.
const NOISE: [f64; 3] = [2e-6, 1e-3, 1e-3];
/// The middle share of a joint's range where slow motion goes.
const RANGE: f64 = 0.6;

/// A joint: what drives it, and the link behind it.
#[derive(Debug, Clone)]
pub struct ElasticJoint {
    /// Its name.
    pub name: String,
    /// The joint that carries it.
    pub parent: Option<usize>,
    /// Its frame in that of what carries it, at zero.
    pub placement: Isometry3<f64>,
    /// Its axis in its own frame.
    pub axis: Vector3<f64>,
    /// Whether it slides.
    pub slides: bool,
    /// Range, rad or m.
    pub limits: [f64; 2],
    /// Greatest torque, N m.
    pub effort: f64,
    /// The link's mass, kg.
    pub mass: f64,
    /// Its centre of mass in the joint's frame, m.
    pub com: Vector3<f64>,
    /// Its inertia about that, kg m².
    pub inertia: Matrix3<f64>,
    /// The motor's inertia, kg m²; none: half of what the joint moves.
    pub armature: Option<f64>,
    /// Viscous friction, N m s/rad.
    pub viscous: f64,
    /// Coulomb friction, N m.
    pub coulomb: f64,
    /// Stiffness, N m/rad, and damping, N m s/rad; none: stiff.
    pub spring: Option<[f64; 2]>,
    /// The same of what bends in front of it about the two axes across its own; none: rigid.
    pub bends: [Option<[f64; 2]>; 2],
}

/// What to record.
#[derive(Debug, Clone)]
pub struct FrfSimulation {
    /// The robot, parents first.
    pub joints: Vec<ElasticJoint>,
    /// Gravity's direction in the base's frame.
    pub down: Vector3<f64>,
    /// Samples per second.
    pub rate: f64,
    /// How far masses are off the description: relative standard deviation.
    pub inertia_error: f64,
    /// Multiple of the sensors' noise.
    pub noise: f64,
    /// Seed of the robot's masses, of its slow motion and of the noise.
    pub seed: u64,
}

/// What the controller is asked for at a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct FrfCommand {
    /// Position of each motor, rad or m.
    pub q: Vec<f64>,
    /// Velocity.
    pub dq: Vec<f64>,
    /// Feed-forward torque, the excitation in it, N m.
    pub tau: Vec<f64>,
    /// The excitation alone, N m: it goes into the log.
    pub reference: Vec<f64>,
}

/// One sample.
#[derive(Debug, Clone)]
pub struct FrfSample {
    /// Time, s.
    pub t: f64,
    /// Motor positions, rad or m, as read.
    pub q: Vec<f64>,
    /// Motor velocities as read.
    pub dq: Vec<f64>,
    /// Torques as reported, N m.
    pub tau: Vec<f64>,
    /// Excitations, N m.
    pub reference: Vec<f64>,
    /// Link positions.
    pub q_link: Vec<f64>,
}

impl FrfSimulation {
    /// The truth by the names that `frf` and `identify` have.
    pub fn truth(&self) -> Vec<TrueValue> {
        let robot = Robot::new(self);
        let mut truth = Vec::new();
        for (j, joint) in robot.driven.iter().map(|&at| &robot.axes[at]).enumerate() {
            let mut add = |name: &str, unit, value| {
                let name = format!("{name}:{}", joint.name);
                truth.push(TrueValue { name, unit, value });
            };
            add("1/k:elasticity", "rad/(N m)", 1.0 / robot.spring[j][0]);
            add("d:elasticity", "N m s/rad", robot.spring[j][1]);
            add("armature", "kg m²", robot.armature[j]);
            add("viscous", "N m s/rad", joint.viscous);
            add("coulomb", "N m", joint.coulomb);
            for (n, bend) in joint.bends.iter().enumerate() {
                let Some([k, d]) = bend else { continue };
                let name = format!("bend_{}", n + 1);
                add(&format!("{name}:link_elasticity"), "rad/(N m)", 1.0 / k);
                add(&format!("{name}_d:link_elasticity"), "N m s/rad", *d);
            }
        }
        truth
    }

    /// The first joint that moves too fast for the simulation's steps: its spring's resonance, Hz, or its damper is too much of a step.
    pub fn too_fast(&self) -> Option<(String, f64)> {
        /// ω Δt of a spring, and d Δt/inertia of a damper: half of where steps become unstable.
        const MOST: [f64; 2] = [1.0, 0.5];
        let robot = Robot::new(self);
        let inertia = robot.inertia(&vec![0.0; robot.axes.len()]);
        let springs = robot.driven.iter().zip(&robot.spring).zip(&robot.armature);
        let springs = springs
            .map(|((&at, spring), motor)| (at, *spring, 1.0 / inertia[(at, at)] + 1.0 / motor));
        // A bend moves what it carries against springs and other bends.
        let free = inertia.clone().try_inverse();
        let bends = robot.bends.iter().map(|&(at, spring)| {
            let inverse = free.as_ref().map_or(f64::INFINITY, |free| free[(at, at)]);
            (at, spring, inverse)
        });
        let is_fast = |(at, spring, inverse): (usize, [f64; 2], f64)| {
            let [k, d] = spring.map(|of| of * inverse);
            let is_fast = k.sqrt() * STEP > MOST[0] || d * STEP > MOST[1];
            (!(k.is_finite() && d.is_finite()) || is_fast).then(|| {
                let name = robot.axes[at].name.clone();
                (name, k.sqrt() / std::f64::consts::TAU)
            })
        };
        springs.chain(bends).find_map(is_fast)
    }

    /// Plays a plan, its commands one after the other, with these gains of each joint (N m/rad, N m s/rad), from rest at the first one.
    ///
    /// # Errors
    /// Whatever `sample` does.
    pub fn play<E>(
        &self,
        gains: &[[f64; 2]],
        commands: impl IntoIterator<Item = FrfCommand>,
        mut sample: impl FnMut(&FrfSample) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut robot = Robot::new(self);
        let mut control = Control::new(self, gains.to_vec());
        let mut commands = commands.into_iter().peekable();
        if let Some(first) = commands.peek() {
            robot.rest_at(&first.q);
        }
        for command in commands {
            sample(&control.step(&mut robot, &command))?;
        }
        Ok(())
    }

    /// Records slow motion of the same robot, of so many seconds: for friction and masses.
    ///
    /// # Errors
    /// Whatever `sample` does.
    pub fn record_slow<E>(
        &self,
        seconds: f64,
        mut sample: impl FnMut(&FrfSample) -> Result<(), E>,
    ) -> Result<(), E> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(2);
        let middle: Vec<f64> = self
            .joints
            .iter()
            .map(|j| 0.5 * (range(j)[0] + range(j)[1]))
            .collect();
        // Sines of no common frequency: slow enough for springs to follow, fast enough to tell inertia from friction.
        let sines: Vec<[[f64; 3]; 3]> = (self.joints.iter())
            .map(|joint| {
                let half = 0.5 * (range(joint)[1] - range(joint)[0]) * RANGE;
                [0.1, 0.4, 1.1].map(|about| {
                    let f = about * (1.0 + 0.4 * (rng.random::<f64>() - 0.5));
                    [
                        half.min(1.0) / (3.0 + 4.0 * about),
                        std::f64::consts::TAU * f,
                        std::f64::consts::TAU * rng.random::<f64>(),
                    ]
                })
            })
            .collect();
        let mut robot = Robot::new(self);
        let mut control = Control::new(self, slow_gains(&robot));
        robot.rest_at(&middle);
        for k in 0..(seconds * self.rate) as usize {
            let t = k as f64 / self.rate;
            // From rest within two seconds.
            let faded = (t / 2.0).min(1.0);
            let of = |n: usize| {
                let sum = |f: fn(f64) -> f64, by_speed: bool| {
                    let one =
                        |[a, w, p]: &[f64; 3]| a * if by_speed { *w } else { 1.0 } * f(w * t + p);
                    sines[n].iter().map(one).sum::<f64>() * faded
                };
                (middle[n] + sum(f64::sin, false), sum(f64::cos, true))
            };
            let (q, dq): (Vec<f64>, Vec<f64>) = (0..middle.len()).map(of).unzip();
            let reference = vec![0.0; middle.len()];
            let command = FrfCommand {
                tau: robot.holding(&q),
                q,
                dq,
                reference,
            };
            sample(&control.step(&mut robot, &command))?;
        }
        Ok(())
    }
}

/// A joint's range; of one without stops half a turn.
fn range(joint: &ElasticJoint) -> [f64; 2] {
    let [low, high] = joint.limits;
    let half = std::f64::consts::FRAC_PI_2;
    if low.is_finite() && high.is_finite() && high > low {
        [low.max(-half), high.min(half)]
    } else {
        [-half, half]
    }
}

/// Gains of slow motion: each joint alone as a mass.
fn slow_gains(robot: &Robot) -> Vec<[f64; 2]> {
    let inertia = robot.inertia(&vec![0.0; robot.axes.len()]);
    let omega = std::f64::consts::TAU * BANDWIDTH;
    let of = |(armature, &at): (&f64, &usize)| {
        let inertia = armature + inertia[(at, at)];
        [
            inertia * omega * omega,
            2.0 * CONTROL_DAMPING * omega * inertia,
        ]
    };
    robot.armature.iter().zip(&robot.driven).map(of).collect()
}

/// Feedback and feed-forward of the sampling rate.
struct Control {
    gains: Vec<[f64; 2]>,
    efforts: Vec<f64>,
    dt: f64,
    steps: usize,
    noise: f64,
    rng: ChaCha8Rng,
    sample: usize,
}

impl Control {
    fn new(of: &FrfSimulation, gains: Vec<[f64; 2]>) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(of.seed);
        rng.set_stream(3);
        let dt = 1.0 / of.rate;
        Self {
            gains,
            efforts: of.joints.iter().map(|joint| joint.effort).collect(),
            dt,
            steps: (dt / STEP).ceil() as usize,
            noise: of.noise,
            rng,
            sample: 0,
        }
    }

    /// Reads the sensors, sets torques for one sampling period and moves the robot through it.
    fn step(&mut self, robot: &mut Robot, command: &FrfCommand) -> FrfSample {
        let n = command.q.len();
        let mut noise = |size: f64| size * self.noise * self.rng.sample::<f64, _>(StandardNormal);
        let q: Vec<f64> = robot.motor[0].iter().map(|q| q + noise(NOISE[0])).collect();
        let dq: Vec<f64> = robot.motor[1].iter().map(|v| v + noise(NOISE[1])).collect();
        let links = robot.driven.iter().map(|&at| robot.link[0][at]);
        let q_link: Vec<f64> = links.map(|q| q + noise(NOISE[0])).collect();
        let torque: Vec<f64> = (0..n)
            .map(|j| {
                let [stiff, damped] = self.gains[j];
                let [ahead, faster] = [command.q[j] - q[j], command.dq[j] - dq[j]];
                command.tau[j] + stiff * ahead + damped * faster
            })
            .collect();
        let tau = torque
            .iter()
            .zip(&self.efforts)
            .map(|(tau, effort)| tau + noise(NOISE[2] * effort));
        let sample = FrfSample {
            t: self.sample as f64 * self.dt,
            q,
            dq,
            tau: tau.collect(),
            reference: command.reference.clone(),
            q_link,
        };
        self.sample += 1;
        robot.advance(&torque, self.dt, self.steps);
        sample
    }
}

#[cfg(test)]
mod tests {
    use super::robot::GRAVITY;
    use super::*;

    /// A beam of 1 m with 2 kg at its end about y, from the horizontal.
    fn beam() -> FrfSimulation {
        let joint = ElasticJoint {
            name: "j".to_owned(),
            parent: None,
            placement: Isometry3::identity(),
            axis: Vector3::y(),
            slides: false,
            limits: [-1.0, 1.0],
            effort: 100.0,
            mass: 2.0,
            com: Vector3::x(),
            inertia: Matrix3::zeros(),
            armature: Some(0.5),
            viscous: 0.0,
            coulomb: 3.0,
            spring: Some([5e3, 2.0]),
            bends: [None; 2],
        };
        FrfSimulation {
            joints: vec![joint],
            down: -Vector3::z(),
            rate: 500.0,
            inertia_error: 0.0,
            noise: 0.0,
            seed: 1,
        }
    }

    #[test]
    fn a_beam_has_its_weight_and_inertia() {
        let robot = Robot::new(&beam());
        let torque = robot.torques(&[0.0], &[0.0], &[0.0]);
        // About y, lifting x is negative: gravity pulls the beam towards positive angles.
        assert!((torque[0].abs() - 2.0 * GRAVITY).abs() < 1e-12);
        assert!((robot.inertia(&[0.4])[(0, 0)] - 2.0).abs() < 1e-12);
    }

    /// Free of friction and damping, motor and link swing against each other at √(k (1/H + 1/J)), and the energy stays.
    #[test]
    fn the_spring_swings_at_its_resonance() {
        let mut of = beam();
        of.joints[0].coulomb = 0.0;
        of.joints[0].spring = Some([5e3, 0.0]);
        of.down = Vector3::zeros();
        let f = frequency(&of, 1e-4, 20_000);
        let exact = (5e3_f64 * (1.0 / 2.0 + 1.0 / 0.5)).sqrt() / std::f64::consts::TAU;
        assert!((f / exact - 1.0).abs() < 2e-4, "{f} of {exact} Hz");
    }

    /// Of the spring's swing after the motor was turned by 0.01 rad, Hz, by its zeros; no swing is larger than the first.
    fn frequency(of: &FrfSimulation, dt: f64, steps: usize) -> f64 {
        let mut robot = Robot::new(of);
        robot.motor[0][0] = 0.01;
        let mut crossings = Vec::new();
        let bend = |r: &Robot| r.motor[0][0] - r.link[0][0];
        for k in 0..steps {
            let before = bend(&robot);
            robot.advance(&[0.0], dt, 1);
            let after = bend(&robot);
            if before < 0.0 && after >= 0.0 {
                crossings.push((k as f64 + before / (before - after)) * dt);
            }
        }
        assert!(bend(&robot).abs() <= 0.0101);
        let swings = (crossings.len() - 1) as f64;
        swings / (crossings[crossings.len() - 1] - crossings[0])
    }

    /// A bend across the joint swings by itself, free of it, at √(k_e/H); what is hidden at one is one.
    #[test]
    fn a_bend_swings_at_its_own_resonance() {
        let mut of = beam();
        of.down = Vector3::zeros();
        // Across y are x, along the beam, and z: about z its mass of 2 kg at 1 m turns.
        of.joints[0].bends = [None, Some([8e3, 0.0])];
        let mut robot = Robot::new(&of);
        assert_eq!((robot.axes.len(), robot.driven.clone()), (2, vec![1]));
        robot.link[0][0] = 0.01;
        let period = std::f64::consts::TAU / (8e3_f64 / 2.0).sqrt();
        let steps = 1000;
        robot.advance(&[0.0], period, steps);
        assert!(
            (robot.link[0][0] - 0.01).abs() < 1e-7,
            "{}",
            robot.link[0][0]
        );
        robot.advance(&[0.0], 0.5 * period, steps);
        assert!(
            (robot.link[0][0] + 0.01).abs() < 1e-7,
            "{}",
            robot.link[0][0]
        );
        assert!(robot.link[0][1].abs() < 1e-12 && robot.motor[0][0].abs() < 1e-12);
        let truth = of.truth();
        let bend = truth.iter().find(|t| t.name == "bend_2:link_elasticity:j");
        assert!(bend.is_some_and(|t| t.value == 1.0 / 8e3));
    }

    /// A damper that saw the velocity half a step late would be a spring of d ω² Δt/2 more: here the frequency would be 3e-4 too high.
    #[test]
    fn the_damper_does_not_lag() {
        let mut of = beam();
        of.joints[0].coulomb = 0.0;
        of.joints[0].spring = Some([5e3, 2.0]);
        of.down = Vector3::zeros();
        let inverse = 1.0 / 2.0 + 1.0 / 0.5_f64;
        let decay = 0.5 * 2.0 * inverse;
        let exact = (5e3 * inverse - decay * decay).sqrt() / std::f64::consts::TAU;
        let f = frequency(&of, STEP, 8000);
        assert!((f / exact - 1.0).abs() < 1e-4, "{f} of {exact} Hz");
    }

    /// Below its friction a motor stays where it is; a plan is played as it stands, and the same seed plays it alike.
    #[test]
    fn friction_holds_and_a_plan_is_played() {
        let mut robot = Robot::new(&FrfSimulation {
            down: Vector3::zeros(),
            ..beam()
        });
        for _ in 0..500 {
            robot.advance(&[2.9], 0.002, 8);
        }
        assert_eq!(robot.motor[1][0], 0.0);
        robot.advance(&[3.5], 0.002, 8);
        assert!(robot.motor[1][0] > 0.0);

        let of = FrfSimulation {
            down: Vector3::zeros(),
            ..beam()
        };
        let commands = (0..500).map(|k| FrfCommand {
            q: vec![0.1],
            dq: vec![0.0],
            tau: vec![f64::from(k)],
            reference: vec![0.5 * f64::from(k)],
        });
        let record = || {
            let mut rows = Vec::new();
            let kept = of.play(&[[0.0, 0.0]], commands.clone(), |s| {
                rows.push(s.clone());
                Ok::<(), ()>(())
            });
            assert_eq!(kept, Ok(()));
            rows
        };
        let rows = record();
        assert_eq!(rows.len(), 500);
        assert_eq!(rows[0].q, [0.1]);
        assert_eq!(rows[9].tau, [9.0]);
        assert_eq!(rows[9].reference, [4.5]);
        assert_eq!(record()[499].q, rows[499].q);
    }
}
