//! Poses of an arm whose kinematics is known to be wrong: what a tracker measures of targets on it.
//!
//! Nothing here is the calibration's: frames are rigid motions of quaternions, gravity's torques are slopes of the potential energy by finite
//! differences, deflections are found by iteration where they are, not at first order.

use nalgebra::{Isometry3, Point3, Translation3, Unit, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::StandardNormal;

use crate::TrueValue;

/// Gravity, m/s².
const GRAVITY: f64 = 9.81;
/// A joint's or link's turn over which the potential energy is differenced, rad.
const DIFFERENCE: f64 = 1e-4;
/// Times that deflections are found anew where the deflected arm is.
const ROUNDS: usize = 4;
/// Share of a joint's range that poses keep to.
const RANGE: f64 = 0.95;

/// A joint of the arm and the link that it moves.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseJoint {
    /// Its name.
    pub name: String,
    /// The joint that carries it.
    pub parent: Option<usize>,
    /// Its frame in the parent's at zero.
    pub placement: Isometry3<f64>,
    /// Its axis, of unit length, in its frame.
    pub axis: Vector3<f64>,
    /// Whether it slides.
    pub slides: bool,
    /// Lower and upper stop, rad or m.
    pub limits: [f64; 2],
    /// The link's mass, kg.
    pub mass: f64,
    /// Its centre of mass in the joint's frame, m.
    pub com: Vector3<f64>,
}

/// What is wrong with the arm, by `NAME[:JOINT]=VALUE`.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseHidden {
    /// What.
    pub kind: PoseKind,
    /// At which joint; all if none is named.
    pub joint: Option<String>,
    /// How much, in the kind's unit.
    pub value: f64,
}

/// What can be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseKind {
    /// A joint yields to gravity: stiffness, N m/rad.
    Elasticity,
    /// A link bends across the joint's axis, about both axes: stiffness, N m/rad.
    LinkElasticity,
    /// Once per turn of the joint, phase at random: amplitude, rad.
    GearEccentricity,
    /// A share more than the joint is read to move.
    GearRatio,
    /// rad per rad of the joint that carries it.
    JointCoupling,
    /// Play, rad, by the side from which the joint came.
    Backlash,
    /// Outside the catalogue: eleven times per turn, phase at random: amplitude, rad.
    GearRipple,
    /// A zero of a joint, rad.
    JointOffset,
}

impl PoseKind {
    /// All of them, by their names.
    pub const ALL: [(&'static str, Self); 8] = [
        ("elasticity", Self::Elasticity),
        ("link_elasticity", Self::LinkElasticity),
        ("gear_eccentricity", Self::GearEccentricity),
        ("gear_ratio", Self::GearRatio),
        ("joint_coupling", Self::JointCoupling),
        ("backlash", Self::Backlash),
        ("gear_ripple", Self::GearRipple),
        ("joint_offset", Self::JointOffset),
    ];
}

/// What to measure.
#[derive(Debug, Clone)]
pub struct PoseSimulation {
    /// The arm, parents first.
    pub joints: Vec<PoseJoint>,
    /// The link that carries the target.
    pub tip: usize,
    /// Gravity's direction in the base's frame.
    pub down: Vector3<f64>,
    /// How many poses.
    pub poses: usize,
    /// Where the joints are asked to be, instead of at random.
    pub at: Vec<Vec<f64>>,
    /// Standard deviations of what frames are off by: m and rad.
    pub geometry: [f64; 2],
    /// What else is wrong.
    pub hidden: Vec<PoseHidden>,
    /// Noise of each place's coordinate, m, and of each angle of an orientation, rad; without the latter no orientation is measured.
    pub noise: [Option<f64>; 2],
    /// Seed of all that is random; the arm's errors do not change with the number of poses.
    pub seed: u64,
}

/// A measured pose.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedPose {
    /// What the joints' encoders say, rad or m.
    pub q: Vec<f64>,
    /// From which side each came: 1 or −1.
    pub side: Vec<f64>,
    /// The target's place in the tracker's frame, m.
    pub place: Vector3<f64>,
    /// Its orientation there.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// Where the target truly was, m.
    pub truth: Vector3<f64>,
}

/// The arm as it is.
struct Arm<'a> {
    of: &'a PoseSimulation,
    shift: Vec<Vector3<f64>>,
    turn: Vec<Vector3<f64>>,
    /// By kind and joint.
    values: Vec<Vec<f64>>,
    phases: Vec<f64>,
    mount: Isometry3<f64>,
    target: Isometry3<f64>,
}

fn normal3(rng: &mut ChaCha8Rng, std: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal))
}

impl PoseSimulation {
    /// What was measured, and the truth by the names that `calibrate` has.
    pub fn run(&self) -> (Vec<SimulatedPose>, Vec<TrueValue>) {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let arm = Arm::new(self, &mut rng);
        let truth = arm.truth();
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(1);
        let pose = |n: usize| {
            let q: Vec<f64> = match self.at.get(n) {
                Some(q) => q.clone(),
                None => self
                    .joints
                    .iter()
                    .map(|joint| anywhere(joint, &mut rng))
                    .collect(),
            };
            let side: Vec<f64> = q
                .iter()
                .map(|_| if rng.random::<bool>() { 1.0 } else { -1.0 })
                .collect();
            let seen = arm.mount * arm.target_at(&q, &side);
            let noise = normal3(&mut rng, self.noise[0].unwrap_or(0.0));
            let turned = normal3(&mut rng, self.noise[1].unwrap_or(0.0));
            SimulatedPose {
                q,
                side,
                place: seen.translation.vector + noise,
                orientation: self.noise[1]
                    .map(|_| UnitQuaternion::from_scaled_axis(turned) * seen.rotation),
                truth: seen.translation.vector,
            }
        };
        let count = if self.at.is_empty() {
            self.poses
        } else {
            self.at.len()
        };
        ((0..count).map(pose).collect(), truth)
    }
}

/// A position within a joint's range; of a joint without stops within a turn.
fn anywhere(joint: &PoseJoint, rng: &mut ChaCha8Rng) -> f64 {
    let [low, high] = joint.limits;
    let [low, high] = if low.is_finite() && high.is_finite() {
        [low, high]
    } else {
        [-std::f64::consts::PI, std::f64::consts::PI]
    };
    let middle = 0.5 * (low + high);
    middle + RANGE * (high - low) * (rng.random::<f64>() - 0.5)
}

impl<'a> Arm<'a> {
    fn new(of: &'a PoseSimulation, rng: &mut ChaCha8Rng) -> Self {
        let count = of.joints.len();
        let [m, rad] = of.geometry;
        let shift = (0..count).map(|_| normal3(rng, m)).collect();
        let mut turn: Vec<Vector3<f64>> = (0..count).map(|_| normal3(rng, rad)).collect();
        let phases = (0..count)
            .map(|_| rng.random::<f64>() * std::f64::consts::TAU)
            .collect();
        let mut values = vec![vec![0.0; count]; PoseKind::ALL.len()];
        for hidden in &of.hidden {
            for (j, joint) in of.joints.iter().enumerate() {
                if hidden.joint.as_ref().is_none_or(|name| *name == joint.name) {
                    values[hidden.kind as usize][j] = hidden.value;
                    if hidden.kind == PoseKind::JointOffset {
                        turn[j] += joint.axis * hidden.value;
                    }
                }
            }
        }
        let far = normal3(rng, 1.0) + Vector3::new(2.0, 0.0, 0.5);
        let about = normal3(rng, 1.0);
        let at_tip = normal3(rng, 0.05) + Vector3::new(0.0, 0.0, 0.1);
        Self {
            of,
            shift,
            turn,
            values,
            phases,
            mount: Isometry3::new(far, about),
            target: Isometry3::new(at_tip, normal3(rng, 0.5)),
        }
    }

    fn value(&self, kind: PoseKind, joint: usize) -> f64 {
        self.values[kind as usize][joint]
    }

    /// Frames of the links, joints moved and links bent by these.
    fn links(&self, q: &[f64], bend: &[[f64; 2]]) -> Vec<Isometry3<f64>> {
        let mut links: Vec<Isometry3<f64>> = Vec::with_capacity(q.len());
        for (j, joint) in self.of.joints.iter().enumerate() {
            let carrier = joint.parent.map_or_else(Isometry3::identity, |p| links[p]);
            let wrong = Isometry3::from_parts(
                Translation3::from(self.shift[j]),
                UnitQuaternion::from_scaled_axis(self.turn[j]),
            );
            let [first, second] = across(&joint.axis);
            let bent = UnitQuaternion::from_scaled_axis(first * bend[j][0] + second * bend[j][1]);
            let moved = if joint.slides {
                Isometry3::translation(
                    joint.axis.x * q[j],
                    joint.axis.y * q[j],
                    joint.axis.z * q[j],
                )
            } else {
                let turned =
                    UnitQuaternion::from_axis_angle(&Unit::new_normalize(joint.axis), q[j]);
                Isometry3::from_parts(Translation3::identity(), turned)
            };
            links.push(carrier * joint.placement * wrong * bent * moved);
        }
        links
    }

    /// Potential energy, J.
    fn energy(&self, q: &[f64], bend: &[[f64; 2]]) -> f64 {
        let links = self.links(q, bend);
        let joints = self.of.joints.iter().zip(&links);
        let height = |(joint, link): (&PoseJoint, &Isometry3<f64>)| {
            let place = link * Point3::from(joint.com);
            -joint.mass * GRAVITY * self.of.down.dot(&place.coords)
        };
        joints.map(height).sum()
    }

    /// The target in the base's frame where the encoders say `read`.
    fn target_at(&self, read: &[f64], side: &[f64]) -> Isometry3<f64> {
        let count = read.len();
        let rigid: Vec<f64> = (0..count)
            .map(|j| {
                let carried = self.of.joints[j].parent.map_or(0.0, |p| read[p]);
                let value = |kind| self.value(kind, j);
                read[j] * (1.0 + value(PoseKind::GearRatio))
                    + value(PoseKind::JointCoupling) * carried
                    + value(PoseKind::GearEccentricity) * (read[j] + self.phases[j]).sin()
                    + value(PoseKind::GearRipple) * (11.0 * read[j] + self.phases[j]).sin()
                    + value(PoseKind::Backlash) / 2.0 * side[j]
            })
            .collect();
        let (mut q, mut bend) = (rigid.clone(), vec![[0.0; 2]; count]);
        for _ in 0..ROUNDS {
            let (mut next, mut next_bend) = (rigid.clone(), bend.clone());
            for j in 0..count {
                let k = self.value(PoseKind::Elasticity, j);
                if k > 0.0 {
                    let slope = |step: f64| {
                        let mut moved = q.clone();
                        moved[j] += step;
                        self.energy(&moved, &bend)
                    };
                    let torque = -(slope(DIFFERENCE) - slope(-DIFFERENCE)) / (2.0 * DIFFERENCE);
                    next[j] += torque / k;
                }
                let k = self.value(PoseKind::LinkElasticity, j);
                for axis in 0..2 {
                    if k > 0.0 {
                        let slope = |step: f64| {
                            let mut moved = bend.clone();
                            moved[j][axis] += step;
                            self.energy(&q, &moved)
                        };
                        let torque = -(slope(DIFFERENCE) - slope(-DIFFERENCE)) / (2.0 * DIFFERENCE);
                        next_bend[j][axis] = torque / k;
                    }
                }
            }
            (q, bend) = (next, next_bend);
        }
        self.links(&q, &bend)[self.of.tip] * self.target
    }

    /// The truth by name; of what is not hidden nothing but the frames.
    fn truth(&self) -> Vec<TrueValue> {
        let mut truth = Vec::new();
        let mut add = |name: String, unit, value| truth.push(TrueValue { name, unit, value });
        for (j, joint) in self.of.joints.iter().enumerate() {
            let name = &joint.name;
            for k in 0..3 {
                let axis = ["x", "y", "z"][k];
                add(
                    format!("d{axis}:link_geometry:{name}"),
                    "m",
                    self.shift[j][k],
                );
                add(
                    format!("r{axis}:link_geometry:{name}"),
                    "rad",
                    self.turn[j][k],
                );
            }
            let k = self.value(PoseKind::Elasticity, j);
            if k > 0.0 {
                add(format!("1/k:elasticity:{name}"), "rad/(N m)", 1.0 / k);
            }
            let k = self.value(PoseKind::LinkElasticity, j);
            if k > 0.0 {
                for n in 1..3 {
                    add(
                        format!("bend_{n}:link_elasticity:{name}"),
                        "rad/(N m)",
                        1.0 / k,
                    );
                }
            }
            let size = self.value(PoseKind::GearEccentricity, j);
            if size != 0.0 {
                let phase = self.phases[j];
                add(
                    format!("sin:gear_eccentricity:{name}"),
                    "rad",
                    size * phase.cos(),
                );
                add(
                    format!("cos:gear_eccentricity:{name}"),
                    "rad",
                    size * phase.sin(),
                );
            }
            for (kind, key, unit) in [
                (PoseKind::GearRatio, "ratio:gear_ratio", "1"),
                (PoseKind::JointCoupling, "coupling:joint_coupling", "1"),
                (PoseKind::Backlash, "gap:backlash", "rad"),
            ] {
                let value = self.value(kind, j);
                if value != 0.0 {
                    add(format!("{key}:{name}"), unit, value);
                }
            }
        }
        truth
    }
}

/// Two axes across another: the frame's own that is least along it, made perpendicular, and the one that completes the frame.
pub(crate) fn across(axis: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let least = (0..3).min_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs()));
    let mut own = Vector3::zeros();
    own[least.unwrap_or(0)] = 1.0;
    let first = Unit::new_normalize(own - axis * own.dot(axis)).into_inner();
    [first, axis.cross(&first)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A horizontal beam of 1 m with 10 kg at its end, on a joint about y.
    fn beam(hidden: Vec<PoseHidden>) -> PoseSimulation {
        PoseSimulation {
            joints: vec![PoseJoint {
                name: "j".to_owned(),
                parent: None,
                placement: Isometry3::identity(),
                axis: Vector3::y(),
                slides: false,
                limits: [-1.0, 1.0],
                mass: 10.0,
                com: Vector3::x(),
            }],
            tip: 0,
            down: -Vector3::z(),
            poses: 1,
            at: vec![vec![0.0]],
            geometry: [0.0; 2],
            hidden,
            noise: [Some(0.0), None],
            seed: 3,
        }
    }

    #[test]
    fn a_beam_sags_by_its_torque_over_its_stiffness() {
        let sag = |hidden: Vec<PoseHidden>| {
            let simulation = beam(hidden);
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let arm = Arm::new(&simulation, &mut rng);
            let tip = arm.target_at(&[0.0], &[1.0]) * arm.target.inverse();
            (tip * Point3::from(Vector3::x())).z
        };
        let soft = PoseHidden {
            kind: PoseKind::Elasticity,
            joint: None,
            value: 1e4,
        };
        assert!((sag(vec![soft]) + 10.0 * GRAVITY / 1e4).abs() < 1e-5);
        assert_eq!(sag(Vec::new()), 0.0);
    }
}
