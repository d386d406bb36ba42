//! The robot: motors in front of springs in front of links, and the forces between them; links that bend turn about further axes, which have a spring and
//! a damper but no motor and no mass of their own.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Rotation3, Unit, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

use super::{ElasticJoint, FrfSimulation};
use crate::poses::across;

/// m/s².
pub(super) const GRAVITY: f64 = 9.81;
/// Resonance of a joint that is not said to be elastic, Hz, and its damping ratio.
const STIFF: f64 = 120.0;
const STIFF_DAMPING: f64 = 0.05;

/// The robot as it is and where it is.
///
/// Its coordinates are all axes of the tree, bends in front of the joint that they are stated of; of motors there are fewer.
pub(super) struct Robot {
    pub(super) axes: Vec<ElasticJoint>,
    /// The coordinate of each motor's joint.
    pub(super) driven: Vec<usize>,
    pub(super) down: Vector3<f64>,
    pub(super) armature: Vec<f64>,
    pub(super) spring: Vec<[f64; 2]>,
    /// Coordinate, stiffness and damping of each bend.
    pub(super) bends: Vec<(usize, [f64; 2])>,
    /// Motors, and links by coordinate: positions and velocities.
    pub(super) motor: [Vec<f64>; 2],
    pub(super) link: [Vec<f64>; 2],
    /// H⁻¹ where it was last computed.
    pub(super) inverse: DMatrix<f64>,
}

impl Robot {
    pub(super) fn new(of: &FrfSimulation) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(of.seed);
        let mut joints = of.joints.clone();
        for joint in &mut joints {
            let factor = (of.inertia_error * rng.sample::<f64, _>(StandardNormal)).exp();
            joint.mass *= factor;
            joint.inertia *= factor;
        }
        let n = joints.len();
        let (mut axes, mut driven, mut bends) = (Vec::new(), Vec::new(), Vec::new());
        for joint in joints {
            let carrier = joint.parent.map(|parent| driven[parent]);
            let mut next = ElasticJoint {
                parent: carrier,
                ..joint.clone()
            };
            for (bend, axis) in joint.bends.iter().zip(across(&joint.axis)) {
                let Some(spring) = bend else { continue };
                bends.push((axes.len(), *spring));
                axes.push(ElasticJoint {
                    axis,
                    slides: false,
                    mass: 0.0,
                    com: Vector3::zeros(),
                    inertia: Matrix3::zeros(),
                    ..next.clone()
                });
                next.parent = Some(axes.len() - 1);
                next.placement = Isometry3::identity();
            }
            driven.push(axes.len());
            axes.push(next);
        }
        let all = axes.len();
        let mut robot = Self {
            down: of.down,
            armature: vec![0.0; n],
            spring: vec![[0.0; 2]; n],
            bends,
            motor: [vec![0.0; n], vec![0.0; n]],
            link: [vec![0.0; all], vec![0.0; all]],
            inverse: DMatrix::identity(all, all),
            axes,
            driven,
        };
        let inertia = robot.inertia(&vec![0.0; all]);
        for (j, &at) in robot.driven.iter().enumerate() {
            let own = inertia[(at, at)];
            let motor = robot.axes[at].armature.unwrap_or(0.5 * own);
            robot.armature[j] = motor;
            let omega = std::f64::consts::TAU * STIFF;
            let stiff = omega * omega * own * motor / (own + motor);
            let stiff = [stiff, 2.0 * STIFF_DAMPING * stiff / omega];
            robot.spring[j] = robot.axes[at].spring.unwrap_or(stiff);
        }
        robot
    }

    /// What motors do, by coordinate; bends do nothing.
    fn by_axis(&self, motors: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.axes.len()];
        for (&at, value) in self.driven.iter().zip(motors) {
            all[at] = *value;
        }
        all
    }

    /// Torques that hold motors at q against gravity where nothing has yielded.
    pub(super) fn holding(&self, q: &[f64]) -> Vec<f64> {
        let still = vec![0.0; self.axes.len()];
        let all = self.torques(&self.by_axis(q), &still, &still);
        self.driven.iter().map(|&at| all[at]).collect()
    }

    /// Motors and links where gravity leaves them if the motors are held at q.
    pub(super) fn rest_at(&mut self, q: &[f64]) {
        let still = vec![0.0; self.axes.len()];
        self.motor[0].copy_from_slice(q);
        self.link[0] = self.by_axis(q);
        let gravity = self.torques(&self.link[0], &still, &still);
        for (&at, [k, _]) in self.driven.iter().zip(&self.spring) {
            self.link[0][at] -= gravity[at] / k;
        }
        for (at, [k, _]) in &self.bends {
            self.link[0][*at] -= gravity[*at] / k;
        }
        self.motor[1].fill(0.0);
        self.link[1].fill(0.0);
    }

    /// Torques at the links for these positions, velocities and accelerations: forces on each body in its own frame, collected from the tips.
    pub(super) fn torques(&self, q: &[f64], dq: &[f64], ddq: &[f64]) -> Vec<f64> {
        let n = q.len();
        let mut rotations: Vec<Rotation3<f64>> = Vec::with_capacity(n);
        let mut offsets: Vec<Vector3<f64>> = Vec::with_capacity(n);
        // Angular velocity, angular acceleration and acceleration of each frame, in itself; the base falls upwards.
        let mut state: Vec<[Vector3<f64>; 3]> = Vec::with_capacity(n);
        let mut loads: Vec<[Vector3<f64>; 2]> = Vec::with_capacity(n);
        for (j, joint) in self.axes.iter().enumerate() {
            let fixed = joint.placement.rotation.to_rotation_matrix();
            let (rotation, offset) = if joint.slides {
                let slid = fixed * (joint.axis * q[j]);
                (fixed, joint.placement.translation.vector + slid)
            } else {
                let turned = Rotation3::from_axis_angle(&Unit::new_unchecked(joint.axis), q[j]);
                (fixed * turned, joint.placement.translation.vector)
            };
            let [omega, alpha, a] = match joint.parent {
                Some(p) => state[p],
                None => [Vector3::zeros(), Vector3::zeros(), -GRAVITY * self.down],
            };
            let at = a + alpha.cross(&offset) + omega.cross(&omega.cross(&offset));
            let back = rotation.inverse();
            let (mut omega, mut alpha, mut at) = (back * omega, back * alpha, back * at);
            let (speed, slope) = (joint.axis * dq[j], joint.axis * ddq[j]);
            if joint.slides {
                at += slope + 2.0 * omega.cross(&speed);
            } else {
                alpha += slope + omega.cross(&speed);
                omega += speed;
            }
            let c = &joint.com;
            let force = joint.mass * (at + alpha.cross(c) + omega.cross(&omega.cross(c)));
            let moment =
                joint.inertia * alpha + omega.cross(&(joint.inertia * omega)) + c.cross(&force);
            rotations.push(rotation);
            offsets.push(offset);
            state.push([omega, alpha, at]);
            loads.push([force, moment]);
        }
        let mut torques = vec![0.0; n];
        for j in (0..n).rev() {
            let [force, moment] = loads[j];
            let joint = &self.axes[j];
            torques[j] = joint.axis.dot(if joint.slides { &force } else { &moment });
            if let Some(p) = joint.parent {
                let carried = rotations[j] * force;
                loads[p][0] += carried;
                loads[p][1] += rotations[j] * moment + offsets[j].cross(&carried);
            }
        }
        torques
    }

    /// The links' inertia matrix, by unit accelerations.
    pub(super) fn inertia(&self, q: &[f64]) -> DMatrix<f64> {
        let n = q.len();
        let zero = vec![0.0; n];
        let still = self.torques(q, &zero, &zero);
        let mut inertia = DMatrix::zeros(n, n);
        for j in 0..n {
            let mut unit = zero.clone();
            unit[j] = 1.0;
            for (i, torque) in self.torques(q, &zero, &unit).iter().enumerate() {
                inertia[(i, j)] = torque - still[i];
            }
        }
        inertia
    }

    /// Moves through a sampling period at these motor torques. The inertia matrix is that of its middle, so that it neither leads nor lags.
    pub(super) fn advance(&mut self, torque: &[f64], period: f64, steps: usize) {
        let links = self.link[0].iter().zip(&self.link[1]);
        let middle: Vec<f64> = links.map(|(q, v)| q + 0.5 * period * v).collect();
        if let Some(inverse) = self.inertia(&middle).try_inverse() {
            self.inverse = inverse;
        }
        let dt = period / steps as f64;
        let half = |[q, v]: &mut [Vec<f64>; 2]| {
            for (q, v) in q.iter_mut().zip(v.iter()) {
                *q += 0.5 * dt * v;
            }
        };
        let zero = vec![0.0; self.axes.len()];
        for _ in 0..steps {
            half(&mut self.motor);
            half(&mut self.link);
            let bias = self.torques(&self.link[0], &self.link[1], &zero);
            let speed = [self.motor[1].clone(), self.link[1].clone()];
            // Dampers see the velocity of the step's middle, as springs see its position: that of its beginning would be half a step late, as
            // if the spring were stiffer by ω² d Δt/2. The first pass finds the velocity at the end, the second uses the mean.
            let mut ends = speed.clone();
            for _ in 0..2 {
                let mean = [0, 1].map(|of: usize| {
                    let both = speed[of].iter().zip(&ends[of]);
                    both.map(|(a, b)| 0.5 * (a + b)).collect::<Vec<f64>>()
                });
                ends = self.kicked(&speed, &mean, &bias, torque, dt);
            }
            let [motor, link] = ends;
            (self.motor[1], self.link[1]) = (motor, link);
            half(&mut self.motor);
            half(&mut self.link);
        }
    }

    /// Velocities of motors and links `dt` later, dampers seeing these mean velocities.
    fn kicked(
        &self,
        speed: &[Vec<f64>; 2],
        mean: &[Vec<f64>; 2],
        bias: &[f64],
        torque: &[f64],
        dt: f64,
    ) -> [Vec<f64>; 2] {
        let driven = self.driven.iter().enumerate();
        let spring: Vec<f64> = driven
            .map(|(j, &at)| {
                let [k, d] = self.spring[j];
                k * (self.motor[0][j] - self.link[0][at]) + d * (mean[0][j] - mean[1][at])
            })
            .collect();
        let mut force = self.by_axis(&spring);
        for &(at, [k, d]) in &self.bends {
            force[at] = -k * self.link[0][at] - d * mean[1][at];
        }
        let force = DVector::from_fn(force.len(), |i, _| force[i] - bias[i]);
        let acceleration = &self.inverse * force;
        let link = speed[1].iter().zip(acceleration.iter());
        let motor = (0..torque.len()).map(|j| {
            let joint = &self.axes[self.driven[j]];
            let by = dt / self.armature[j];
            // Friction with the velocity at the end, which keeps it stable and lets it stick.
            let free = (speed[0][j] + by * (torque[j] - spring[j])) / (1.0 + by * joint.viscous);
            let dry = by * joint.coulomb;
            free - free.clamp(-dry, dry)
        });
        [motor.collect(), link.map(|(v, a)| v + dt * a).collect()]
    }
}
