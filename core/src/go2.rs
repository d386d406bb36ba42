//! The Unitree Go2's constants: kinematics and inertia of its URDF, motors, limits, quanta of its bus.
//!
//! Sources: `go2_description` of unitree_ros (URDF), unitree_sdk2, and figures derived from recorded data; joint side, SI.
//! Joint order is the SDK's: FR, FL, RR, RL × hip, thigh, calf. Links on fixed joints (feet, heads, the rotors' housings)
//! are lumped into the body that carries them, as Pinocchio does when it reads the URDF: 16.087 kg in all.

use crate::Real;
use crate::contact::Foot;
use crate::inertia::InertialParameters;
use crate::regressor;
pub use crate::robot::Actuator;
use crate::robot::Robot;
use crate::scalar::real;
use crate::spatial::Transform;
use crate::tree::{Body, Joint, Tree};
use core::fmt;
use nalgebra::{Matrix3, Vector3};

/// Legs of the robot.
pub const LEGS: usize = 4;
/// Joints of a leg.
pub const JOINTS_PER_LEG: usize = 3;
/// Joints of the robot.
pub const JOINTS: usize = LEGS * JOINTS_PER_LEG;

/// Names of the joints of the whole robot, in SDK order.
pub const JOINT_NAMES: [&str; JOINTS] = [
    "FR_hip", "FR_thigh", "FR_calf", "FL_hip", "FL_thigh", "FL_calf", "RR_hip", "RR_thigh",
    "RR_calf", "RL_hip", "RL_thigh", "RL_calf",
];

/// The robot as a type; its values are its legs.
pub type Go2 = Leg;

/// A leg, in SDK order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Leg {
    /// Front right.
    FR,
    /// Front left.
    FL,
    /// Rear right.
    RR,
    /// Rear left.
    RL,
}

impl Leg {
    /// All legs in SDK order.
    pub const ALL: [Self; LEGS] = [Self::FR, Self::FL, Self::RR, Self::RL];

    /// Position in SDK order.
    pub fn index(self) -> usize {
        self as usize
    }

    /// "FR", "FL", "RR" or "RL".
    pub fn name(self) -> &'static str {
        ["FR", "FL", "RR", "RL"][self as usize]
    }

    /// The leg of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|leg| leg.name() == name)
    }

    /// Names of the leg's joints: hip, thigh, calf.
    pub fn joint_names(self) -> [&'static str; JOINTS_PER_LEG] {
        let first = JOINTS_PER_LEG * self.index();
        [
            JOINT_NAMES[first],
            JOINT_NAMES[first + 1],
            JOINT_NAMES[first + 2],
        ]
    }

    /// +1 on the left, −1 on the right.
    fn side(self) -> f64 {
        if matches!(self, Self::FL | Self::RL) {
            1.0
        } else {
            -1.0
        }
    }

    /// +1 at the front, −1 at the rear.
    fn front(self) -> f64 {
        if matches!(self, Self::FR | Self::FL) {
            1.0
        } else {
            -1.0
        }
    }
}

/// A joint of the robot: its index in SDK order, 0 (`FR_hip`) to 11 (`RL_calf`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct JointId(usize);

impl JointId {
    /// Index in SDK order, 0 to 11.
    pub const fn index(self) -> usize {
        self.0
    }

    /// `FR_hip` … `RL_calf`.
    pub const fn name(self) -> &'static str {
        JOINT_NAMES[self.0]
    }

    /// The joint of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        JOINT_NAMES.iter().position(|&n| n == name).map(Self)
    }

    /// The leg this joint belongs to.
    pub const fn leg(self) -> Leg {
        Leg::ALL[self.0 / JOINTS_PER_LEG]
    }

    /// Place within the leg: 0 hip, 1 thigh, 2 calf.
    pub const fn place(self) -> usize {
        self.0 % JOINTS_PER_LEG
    }

    /// Hip, thigh and calf of a leg.
    pub fn of(leg: Leg) -> [Self; JOINTS_PER_LEG] {
        core::array::from_fn(|place| Self(JOINTS_PER_LEG * leg.index() + place))
    }

    /// All joints in SDK order.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..JOINTS).map(Self)
    }
}

impl fmt::Display for JointId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Robot<JOINTS_PER_LEG> for Leg {
    const LEGS: &'static [Self] = &Self::ALL;
    const MOTOR_IDS: [u8; JOINTS_PER_LEG] = [0, 1, 2];
    const ACTUATORS: [Actuator; JOINTS_PER_LEG] = ACTUATORS;
    const BASE_COLUMNS: [usize; JOINTS_PER_LEG] = regressor::leg::BASE_COLUMNS;
    const BAUD: u32 = 4_000_000;

    fn tree<T: Real>(self) -> Tree<T, JOINTS_PER_LEG, JOINTS_PER_LEG> {
        leg(self)
    }

    fn position_limits(self) -> [[f64; 2]; JOINTS_PER_LEG] {
        position_limits(self)
    }
}

const fn actuator(gear: f64, effort: f64, velocity: f64) -> Actuator {
    Actuator {
        gear,
        rotor_inertia: 1.118_42e-4,
        effort,
        velocity,
    }
}

/// Actuators of hip, thigh and calf. The calf's linkage multiplies the gear by 23/12.
pub const ACTUATORS: [Actuator; JOINTS_PER_LEG] = [
    actuator(6.333, 23.7, 30.1),
    actuator(6.333, 23.7, 30.1),
    actuator(6.333 * 23.0 / 12.0, 45.43, 15.70),
];

/// Lower and upper position limits of a leg's joints, rad.
#[allow(clippy::approx_constant)] // the URDF's rounding, not ours
pub fn position_limits(leg: Leg) -> [[f64; 2]; JOINTS_PER_LEG] {
    let thigh = if leg.front() > 0.0 {
        [-1.5708, 3.4907]
    } else {
        [-0.5236, 4.5379]
    };
    [[-1.0472, 1.0472], thigh, [-2.7227, -0.837_76]]
}

/// Beyond its limits by so much, rad, a joint may be at its stop: the plastic gives, and the URDF's limits are rounded. A joint's zero is taken
/// where it is so near.
pub const BEYOND_STOPS: f64 = 0.05;

/// Steps of position (rad), speed (rad/s) and torque (N m) that the bus can tell apart at one joint.
pub fn quanta(joint: usize) -> [f64; 3] {
    let turn = core::f64::consts::TAU;
    let gear = ACTUATORS[joint % JOINTS_PER_LEG].gear;
    [turn / 32768.0 / gear, turn / 256.0 / gear, gear / 256.0]
}

/// The foot's centre in the calf's frame, m.
pub const FOOT: [f64; 3] = [0.0, 0.0, -0.213];

/// The sphere that is the foot's end: its centre in the calf's frame, m, and its radius, m.
pub const FOOT_SPHERE: ([f64; 3], f64) = ([-0.002, 0.0, -0.213], 0.022);

/// The IMU's origin in the base's frame, m; its axes are the base's.
pub const IMU: [f64; 3] = [-0.025_57, 0.0, 0.042_32];

/// Standard deviation of the reported speed at standstill, rad/s.
pub const VELOCITY_NOISE: [f64; JOINTS_PER_LEG] = [0.035, 0.035, 0.022];

/// One pinned leg: hip, thigh and calf on a fixed base.
pub fn leg<T: Real>(leg: Leg) -> Tree<T, 3, 3> {
    tree(leg_bodies(leg, None))
}

/// The robot hung by its base: twelve joints in SDK order.
pub fn pinned<T: Real>() -> Tree<T, 12, 12> {
    tree(core::array::from_fn(|b| on_leg(b, None, 0)))
}

/// The free robot: the base, then twelve joints in SDK order.
pub fn free<T: Real>() -> Tree<T, 13, 18> {
    tree(core::array::from_fn(|b| match b.checked_sub(1) {
        None => Body {
            parent: None,
            placement: Transform::identity(),
            joint: Joint::Free,
            inertia: base_inertia(),
        },
        Some(n) => on_leg(n, Some(0), 1),
    }))
}

/// The feet of [`free`] in SDK order.
pub fn feet<T: Real>() -> [Foot<T>; LEGS] {
    let (centre, radius) = FOOT_SPHERE;
    core::array::from_fn(|leg| Foot {
        body: JOINTS_PER_LEG * (leg + 1),
        centre: vector(centre),
        radius: real(radius),
    })
}

fn tree<T: Real, const B: usize, const V: usize>(bodies: [Body<T>; B]) -> Tree<T, B, V> {
    // The numbering is that of this file: a test asks `Tree::new` about all three trees.
    Tree::numbered(bodies)
}

/// The n-th leg body of the robot, hips on `base`, for a tree whose first leg body has index `first`. One at a time, and not inlined: a
/// microcontroller's stack has no room for all legs beside their tree.
#[inline(never)]
fn on_leg<T: Real>(n: usize, base: Option<usize>, first: usize) -> Body<T> {
    let leg = Leg::ALL[n / JOINTS_PER_LEG];
    let mut body = leg_bodies(leg, base)[n % JOINTS_PER_LEG];
    if !n.is_multiple_of(JOINTS_PER_LEG) {
        body.parent = Some(first + n - 1);
    }
    body
}

fn leg_bodies<T: Real>(leg: Leg, base: Option<usize>) -> [Body<T>; JOINTS_PER_LEG] {
    let (f, s) = (leg.front(), leg.side());
    let body = |parent, origin, axis, inertia| Body {
        parent,
        placement: Transform::from_translation(vector(origin)),
        joint: Joint::Revolute(axis),
        inertia,
    };
    [
        body(
            base,
            [0.1934 * f, 0.0465 * s, 0.0],
            Vector3::x(),
            hip_inertia(f, s),
        ),
        body(
            Some(0),
            [0.0, 0.0955 * s, 0.0],
            Vector3::y(),
            thigh_inertia(s),
        ),
        body(Some(1), [0.0, 0.0, -0.213], Vector3::y(), calf_inertia(s)),
    ]
}

fn vector<T: Real>(v: [f64; 3]) -> Vector3<T> {
    Vector3::from(v.map(real))
}

/// φ from mass, centre of mass and the six inertias about it in URDF order ixx, ixy, ixz, iyy, iyz, izz.
fn link<T: Real>(mass: f64, com: [f64; 3], i: [f64; 6]) -> InertialParameters<T> {
    let inertia = Matrix3::new(i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5]);
    let phi = InertialParameters::from_com(mass, Vector3::from(com), inertia);
    InertialParameters(phi.0.map(real))
}

/// A rotor's housing, which the URDF fixes to the link before the one it drives; its spin axis is x (hip) or y.
fn rotor<T: Real>(at: [f64; 3], about_x: bool) -> InertialParameters<T> {
    let (axial, radial) = (ACTUATORS[0].rotor_inertia, 5.9647e-5);
    let (x, y) = if about_x {
        (axial, radial)
    } else {
        (radial, axial)
    };
    link(0.089, at, [x, 0.0, 0.0, y, 0.0, radial])
}

fn base_inertia<T: Real>() -> InertialParameters<T> {
    let trunk = link(
        6.921,
        [0.021112, 0.0, -0.005366],
        [0.02448, 1.2166e-4, 1.4849e-3, 0.098077, -3.12e-5, 0.107],
    );
    let head = |at| link(0.001, at, [9.6e-6, 0.0, 0.0, 9.6e-6, 0.0, 9.6e-6]);
    let body = trunk + head([0.285, 0.0, 0.01]) + head([0.293, 0.0, -0.06]);
    Leg::ALL.iter().fold(body, |sum, leg| {
        sum + rotor([0.11215 * leg.front(), 0.04675 * leg.side(), 0.0], true)
    })
}

fn hip_inertia<T: Real>(f: f64, s: f64) -> InertialParameters<T> {
    let hip = link(
        0.678,
        [-0.0054 * f, 0.00194 * s, -0.000105],
        [
            4.80e-4,
            -3.01e-6 * f * s,
            1.11e-6 * f,
            8.84e-4,
            -1.42e-6 * s,
            5.96e-4,
        ],
    );
    hip + rotor([0.0, -0.00015 * s, 0.0], false)
}

fn thigh_inertia<T: Real>(s: f64) -> InertialParameters<T> {
    let thigh = link(
        1.152,
        [-0.00374, -0.0223 * s, -0.0327],
        [
            5.84e-3,
            8.72e-5 * s,
            -2.89e-4,
            5.80e-3,
            8.08e-4 * s,
            1.03e-3,
        ],
    );
    thigh + rotor([0.0, -0.03235 * s, 0.0], false)
}

fn calf_inertia<T: Real>(s: f64) -> InertialParameters<T> {
    let calf = link(
        0.154,
        [0.00548, -0.000975 * s, -0.115],
        [1.08e-3, 3.4e-7 * s, 1.72e-5, 1.10e-3, 8.28e-6 * s, 3.29e-5],
    );
    let foot = link(0.04, FOOT, [9.6e-6, 0.0, 0.0, 9.6e-6, 0.0, 9.6e-6]);
    calf + foot
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_joints_round_trip_in_sdk_order() {
        for (index, joint) in JointId::all().enumerate() {
            assert_eq!(joint.index(), index);
            assert_eq!(JointId::from_name(joint.name()), Some(joint));
            assert_eq!(JointId::of(joint.leg())[joint.place()], joint);
            assert!(joint.name().starts_with(joint.leg().name()));
            assert_eq!(Leg::from_name(joint.leg().name()), Some(joint.leg()));
        }
        assert_eq!(JointId::from_name("FR_knee"), None);
    }

    #[test]
    fn the_trees_are_numbered_as_trees_must_be() {
        for which in Leg::ALL {
            let tree = leg::<f64>(which);
            assert_eq!(Tree::new(*tree.bodies()), Ok(tree));
        }
        assert_eq!(Tree::new(*pinned::<f64>().bodies()), Ok(pinned()));
        assert_eq!(Tree::new(*free::<f64>().bodies()), Ok(free()));
    }

    #[test]
    fn the_robot_weighs_what_its_urdf_says() {
        let mass = |tree: &[Body<f64>]| tree.iter().map(|b| b.inertia.mass()).sum::<f64>();
        assert!((mass(free::<f64>().bodies()) - 16.087).abs() < 1e-9);
        assert!((mass(pinned::<f64>().bodies()) - 4.0 * 2.202).abs() < 1e-9);
    }

    #[test]
    fn every_body_is_physical_and_every_leg_is_in_the_robot() {
        let robot = pinned::<f64>();
        assert!(robot.bodies().iter().all(|b| b.inertia.is_physical()));
        for (n, which) in Leg::ALL.into_iter().enumerate() {
            let tree = leg::<f64>(which);
            for b in 0..3 {
                assert_eq!(tree.bodies()[b].inertia, robot.bodies()[3 * n + b].inertia);
                assert_eq!(
                    tree.bodies()[b].placement,
                    robot.bodies()[3 * n + b].placement
                );
            }
        }
    }

    #[test]
    fn inertia_about_the_joints_matches_the_identification_study() {
        // The study's reference table counts no rotors: hip Ixx, Iyy, Izz; thigh; calf, 1e-3 kg m².
        let bodies = leg::<f64>(Leg::FL);
        let rotors = [
            rotor::<f64>([0.0, -0.00015, 0.0], false),
            rotor([0.0, -0.03235, 0.0], false),
        ];
        let table = [
            [0.483, 0.904, 0.618],
            [7.645, 7.048, 1.619],
            [4.941, 4.966, 0.047],
        ];
        for b in 0..3 {
            let mut phi = bodies.bodies()[b].inertia;
            if b < 2 {
                phi.0 -= rotors[b].0;
            }
            for n in 0..3 {
                let value = phi.rotational_inertia()[(n, n)] * 1e3;
                assert!(
                    (value - table[b][n]).abs() < 6e-4,
                    "body {b}, axis {n}: {value}"
                );
            }
        }
    }
}
