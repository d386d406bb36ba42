//! What a robot is to the rest of the crate: legs, motors, gears, a bus.
//!
//! Nothing below this knows a robot by name. What identifies a leg asks [`Robot`] for its tree, its actuators and its limits; what listens
//! asks for the motors' ids, the gears and the baud. [`crate::go2`] is one such robot; `core/tests/second_robot.rs` has another, of two legs of
//! two joints, from the bytes of its bus to its parameters.

use crate::Real;
use crate::tree::Tree;

/// A robot, as the type whose values are its legs; each has `J` joints in a chain, on a bus of its own.
pub trait Robot<const J: usize>: Copy + 'static {
    /// All legs, in the order of their buses.
    const LEGS: &'static [Self];
    /// The motors' ids on a leg's bus, in the order of its joints.
    const MOTOR_IDS: [u8; J];
    /// What drives a leg's joints.
    const ACTUATORS: [Actuator; J];
    /// Base parameters of each joint's torque while the base stands still: as many combinations of its bodies' parameters can be told
    /// ([`crate::base_parameters`]).
    const BASE_COLUMNS: [usize; J];
    /// Bits per second of the motor bus; a byte takes ten.
    const BAUD: u32;

    /// Time between two bytes that follow each other on a motor bus, ns.
    const BYTE_NS: u32 = byte_ns(Self::BAUD);

    /// The leg on a fixed base: joints in a chain, bodies as the CAD has them.
    fn tree<T: Real>(self) -> Tree<T, J, J>;

    /// Lower and upper position limits of the leg's joints, rad.
    fn position_limits(self) -> [[f64; 2]; J];
}

/// Time of a byte at so many bits per second, ns: eight data bits between start and stop bit.
pub const fn byte_ns(baud: u32) -> u32 {
    match baud {
        0 => 0,
        _ => (10_000_000_000 / baud as u64) as u32,
    }
}

/// The place of each joint's motor in a polling cycle, which is by ascending id.
pub const fn places<const J: usize>(ids: [u8; J]) -> [usize; J] {
    let mut places = [0; J];
    let mut joint = 0;
    while joint < J {
        let mut other = 0;
        while other < J {
            if ids[other] < ids[joint] {
                places[joint] += 1;
            }
            other += 1;
        }
        joint += 1;
    }
    places
}

/// What a joint's motor and transmission are, on paper.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Actuator {
    /// Motor turns per joint turn.
    pub gear: f64,
    /// Inertia of the rotor about its own axis, kg m².
    pub rotor_inertia: f64,
    /// Largest torque, N m.
    pub effort: f64,
    /// Largest speed, rad/s.
    pub velocity: f64,
}

impl Actuator {
    /// Rotor inertia as the joint feels it: times the gear ratio squared, kg m².
    pub fn armature(&self) -> f64 {
        self.rotor_inertia * self.gear * self.gear
    }
}
