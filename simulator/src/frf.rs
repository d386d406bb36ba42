//! A robot with elastic joints under periodic excitation: a log for frequency responses, and a slow one of the same robot.
//!
//! Each joint has a motor of inertia J with viscous and Coulomb friction, a spring and a damper, and behind it a link of the tree; gravity acts
//! on the links. Motors are decoupled, so that Coulomb friction is an impulse of at most F_c Δt against each one's velocity, exact in sticking
//! too. Positions move half a step before and after the forces (position Verlet): second order, and it keeps a spring's energy.
//!
//! A controller of the sampling rate holds the motors at a point with a slow sine on top, which keeps friction from holding them, and adds the
//! excitation: odd multisines of random phases, in n experiments whose phases differ by the Fourier matrix, so that the excitations of n
//! joints are orthogonal (Dobrowiecki, Schoukens & Guillaume 2006). Nothing here knows how responses are estimated. `robot` beside: the mechanics.

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
/// Bandwidth of the controller, Hz, and its damping ratio.
const BANDWIDTH: f64 = 2.0;
const CONTROL_DAMPING: f64 = 0.7;
/// The slow sine's amplitude, rad or m, and its cycles a period: odd, so that what it changes of the robot's inertia moves an odd line's
/// response to even ones.
const CARRIER: f64 = 0.06;
const CARRIER_CYCLES: usize = 3;
/// Excited lines, Hz.
const BAND: [f64; 2] = [1.0, 55.0];
/// Below this line, Hz, amplitudes fall in proportion, so that the velocity of low lines does not exceed the slow sine's.
const CORNER: f64 = 10.0;
/// One odd line of so many is left silent, at random: odd distortion shows there.
const SILENT: usize = 4;
/// The excitation's rms: so much of the friction and of the greatest effort, and no more than a share of the latter.
const OF_FRICTION: f64 = 0.5;
const OF_EFFORT: f64 = 0.06;
const MOST_EFFORT: f64 = 0.4;
/// Noise of a motor's encoder, rad; of its velocity, rad/s; of the torque, as a share of the greatest effort.
const NOISE: [f64; 3] = [2e-6, 1e-3, 1e-3];
/// The middle share of a joint's range where points are.
const RANGE: f64 = 0.6;
/// A move between points, s.
const MOVE: f64 = 2.0;

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
}

/// What to record.
#[derive(Debug, Clone)]
pub struct FrfSimulation {
    /// The robot, parents first.
    pub joints: Vec<ElasticJoint>,
    /// Gravity's direction in the base's frame.
    pub down: Vector3<f64>,
    /// How many points.
    pub points: usize,
    /// Blocks of random phases at each.
    pub blocks: usize,
    /// Periods of each experiment, the first of them transient.
    pub periods: usize,
    /// A period, s.
    pub period: f64,
    /// Samples per second.
    pub rate: f64,
    /// How far masses are off the description: relative standard deviation.
    pub inertia_error: f64,
    /// Excitation as a multiple of what friction and effort suggest.
    pub excitation: f64,
    /// Multiple of the sensors' noise.
    pub noise: f64,
    /// Seed of all that is random; robot and points do not change with the number of blocks.
    pub seed: u64,
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
        for (j, joint) in robot.joints.iter().enumerate() {
            let mut add = |name: &str, unit, value| {
                let name = format!("{name}:{}", joint.name);
                truth.push(TrueValue { name, unit, value });
            };
            add("1/k:elasticity", "rad/(N m)", 1.0 / robot.spring[j][0]);
            add("d:elasticity", "N m s/rad", robot.spring[j][1]);
            add("armature", "kg m²", robot.armature[j]);
            add("viscous", "N m s/rad", joint.viscous);
            add("coulomb", "N m", joint.coulomb);
        }
        truth
    }

    /// The first joint that moves too fast for the simulation's steps: its spring's resonance, Hz, or its damper is too much of a step.
    pub fn too_fast(&self) -> Option<(String, f64)> {
        /// ω Δt of a spring, and d Δt/inertia of a damper: half of where steps become unstable.
        const MOST: [f64; 2] = [1.0, 0.5];
        let robot = Robot::new(self);
        let inertia = robot.inertia(&vec![0.0; self.joints.len()]);
        let speed = |j: usize| {
            let inverse = 1.0 / inertia[(j, j)] + 1.0 / robot.armature[j];
            let [k, d] = robot.spring[j].map(|of| of * inverse);
            let is_fast = k.sqrt() * STEP > MOST[0] || d * STEP > MOST[1];
            (!(k.is_finite() && d.is_finite()) || is_fast)
                .then_some(k.sqrt() / std::f64::consts::TAU)
        };
        let joints = self.joints.iter().enumerate();
        let mut fast = joints.filter_map(|(j, joint)| Some((joint.name.clone(), speed(j)?)));
        fast.next()
    }

    /// Records the experiments: point after point, block after block, as many experiments in each as joints.
    ///
    /// # Errors
    /// Whatever `sample` does.
    pub fn record<E>(&self, mut sample: impl FnMut(&FrfSample) -> Result<(), E>) -> Result<(), E> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(1);
        let points: Vec<Vec<f64>> = (0..self.points).map(|_| self.somewhere(&mut rng)).collect();
        let mut robot = Robot::new(self);
        let mut control = Control::new(self, &robot);
        robot.rest_at(&points[0]);
        let n = self.joints.len();
        let length = (self.period * self.rate).round() as usize;
        let lines = self.lines(&mut rng);
        let mut last = points[0].clone();
        for point in &points {
            let moves = (MOVE * self.rate) as usize;
            for k in 0..moves {
                let share = 0.5 - 0.5 * (std::f64::consts::PI * k as f64 / moves as f64).cos();
                let goal: Vec<f64> = last
                    .iter()
                    .zip(point)
                    .map(|(a, b)| a + share * (b - a))
                    .collect();
                let still = vec![0.0; n];
                sample(&control.step(&mut robot, [&goal, &still], &still))?;
            }
            last.clone_from(point);
            for _ in 0..self.blocks {
                let phases = self.phases(&lines, &mut rng);
                for experiment in 0..n {
                    let signals = self.signals(&lines, &phases, experiment, length);
                    for k in 0..self.periods * length {
                        let (goal, speed) = self.carried(point, k as f64 / self.rate);
                        let drive: Vec<f64> = signals.iter().map(|s| s[k % length]).collect();
                        sample(&control.step(&mut robot, [&goal, &speed], &drive))?;
                    }
                }
            }
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
        let mut control = Control::new(self, &robot);
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
            let (goal, speed): (Vec<f64>, Vec<f64>) = (0..middle.len()).map(of).unzip();
            let still = vec![0.0; middle.len()];
            sample(&control.step(&mut robot, [&goal, &speed], &still))?;
        }
        Ok(())
    }

    fn somewhere(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let of = |joint: &ElasticJoint| {
            let [low, high] = range(joint);
            0.5 * (low + high) + RANGE * (high - low) * (rng.random::<f64>() - 0.5)
        };
        self.joints.iter().map(of).collect()
    }

    /// The excited odd lines.
    fn lines(&self, rng: &mut ChaCha8Rng) -> Vec<usize> {
        let top = BAND[1].min(0.35 * self.rate);
        let odd = (1..)
            .step_by(2)
            .skip_while(|line| *line <= CARRIER_CYCLES || (*line as f64) < BAND[0] * self.period);
        let odd: Vec<usize> = odd
            .take_while(|line| *line as f64 <= top * self.period)
            .collect();
        let mut lines = Vec::new();
        for group in odd.chunks(SILENT) {
            let left_out = rng.random_range(0..SILENT);
            lines.extend(
                group
                    .iter()
                    .enumerate()
                    .filter(|(k, _)| *k != left_out)
                    .map(|(_, l)| *l),
            );
        }
        lines
    }

    fn phases(&self, lines: &[usize], rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
        let mut phase = || std::f64::consts::TAU * rng.random::<f64>();
        let joints = 0..self.joints.len();
        joints
            .map(|_| lines.iter().map(|_| phase()).collect())
            .collect()
    }

    /// One period of each joint's excitation in an experiment.
    fn signals(
        &self,
        lines: &[usize],
        phases: &[Vec<f64>],
        experiment: usize,
        length: usize,
    ) -> Vec<Vec<f64>> {
        let n = self.joints.len();
        let of = |(j, phases): (usize, &Vec<f64>)| {
            let joint = &self.joints[j];
            let rms = OF_FRICTION * joint.coulomb + OF_EFFORT * joint.effort;
            let rms = self.excitation * rms.min(MOST_EFFORT * joint.effort);
            let shape = |line: &usize| (*line as f64 / (CORNER * self.period)).min(1.0);
            let power: f64 = lines.iter().map(|line| shape(line).powi(2)).sum();
            let amplitude = rms * (2.0 / power.max(1e-12)).sqrt();
            let turned = std::f64::consts::TAU * (j * experiment) as f64 / n as f64;
            let at = |k: usize| {
                let sine = |(line, phase): (&usize, &f64)| {
                    let angle = (line * k % length) as f64 / length as f64;
                    shape(line) * (std::f64::consts::TAU * angle + phase + turned).cos()
                };
                amplitude * lines.iter().zip(phases).map(sine).sum::<f64>()
            };
            (0..length).map(at).collect()
        };
        phases.iter().enumerate().map(of).collect()
    }

    /// A point with the slow sine on it: positions and velocities.
    fn carried(&self, point: &[f64], t: f64) -> (Vec<f64>, Vec<f64>) {
        let omega = std::f64::consts::TAU * CARRIER_CYCLES as f64 / self.period;
        let of = |(j, q): (usize, &f64)| {
            // Joints reverse one after the other.
            let angle = omega * t + j as f64;
            (q + CARRIER * angle.sin(), CARRIER * omega * angle.cos())
        };
        point.iter().enumerate().map(of).unzip()
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
    fn new(of: &FrfSimulation, robot: &Robot) -> Self {
        let inertia = robot.inertia(&vec![0.0; of.joints.len()]);
        let gains = robot.armature.iter().enumerate().map(|(j, armature)| {
            let (omega, inertia) = (
                std::f64::consts::TAU * BANDWIDTH,
                armature + inertia[(j, j)],
            );
            [
                inertia * omega * omega,
                2.0 * CONTROL_DAMPING * omega * inertia,
            ]
        });
        let mut rng = ChaCha8Rng::seed_from_u64(of.seed);
        rng.set_stream(3);
        let dt = 1.0 / of.rate;
        Self {
            gains: gains.collect(),
            efforts: of.joints.iter().map(|joint| joint.effort).collect(),
            dt,
            steps: (dt / STEP).ceil() as usize,
            noise: of.noise,
            rng,
            sample: 0,
        }
    }

    /// Reads the sensors, sets torques for one sampling period and moves the robot through it.
    fn step(&mut self, robot: &mut Robot, [goal, speed]: [&[f64]; 2], drive: &[f64]) -> FrfSample {
        let n = goal.len();
        let mut noise = |size: f64| size * self.noise * self.rng.sample::<f64, _>(StandardNormal);
        let q: Vec<f64> = robot.motor[0].iter().map(|q| q + noise(NOISE[0])).collect();
        let dq: Vec<f64> = robot.motor[1].iter().map(|v| v + noise(NOISE[1])).collect();
        let q_link: Vec<f64> = robot.link[0].iter().map(|q| q + noise(NOISE[0])).collect();
        let zero = vec![0.0; n];
        let gravity = robot.torques(goal, &zero, &zero);
        let torque: Vec<f64> = (0..n)
            .map(|j| {
                let [stiff, damped] = self.gains[j];
                gravity[j] + stiff * (goal[j] - q[j]) + damped * (speed[j] - dq[j]) + drive[j]
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
            reference: drive.to_vec(),
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
        };
        FrfSimulation {
            joints: vec![joint],
            down: -Vector3::z(),
            points: 1,
            blocks: 1,
            periods: 3,
            period: 1.0,
            rate: 500.0,
            inertia_error: 0.0,
            excitation: 1.0,
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
        let mut robot = Robot::new(&of);
        robot.motor[0][0] = 0.01;
        let mut crossings = Vec::new();
        let dt = 1e-4;
        let bend = |r: &Robot| r.motor[0][0] - r.link[0][0];
        for k in 0..20_000 {
            let before = bend(&robot);
            robot.advance(&[0.0], dt, 1);
            let after = bend(&robot);
            if before < 0.0 && after >= 0.0 {
                crossings.push((k as f64 + before / (before - after)) * dt);
            }
        }
        let swings = (crossings.len() - 1) as f64;
        let f = swings / (crossings[crossings.len() - 1] - crossings[0]);
        let exact = (5e3_f64 * (1.0 / 2.0 + 1.0 / 0.5)).sqrt() / std::f64::consts::TAU;
        assert!((f / exact - 1.0).abs() < 2e-4, "{f} of {exact} Hz");
        assert!(bend(&robot).abs() <= 0.0101);
    }

    /// Below its friction a motor stays where it is; the reference is periodic.
    #[test]
    fn friction_holds_and_the_excitation_repeats() {
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

        let mut rows = Vec::new();
        beam()
            .record(|s| {
                rows.push(s.clone());
                Ok::<(), ()>(())
            })
            .unwrap();
        let first = rows.len() - 3 * 500;
        for k in first..first + 1000 {
            assert_eq!(rows[k].reference, rows[k + 500].reference);
        }
        assert!(rows[first].reference[0].abs() > 0.0);
    }
}
