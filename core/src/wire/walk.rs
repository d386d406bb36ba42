//! What a device that listens to a walking robot hears and says.

pub use crate::walk::WalkCounts;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Joints of the robot, and effects of each.
const JOINTS: usize = 12;
const EFFECTS: usize = 4;

/// One reading of the IMU, in its own axes; of the time at which it comes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Imu {
    /// Angular velocity, rad/s.
    pub gyro: [f32; 3],
    /// Specific force, m/s²: what an accelerometer reads.
    pub acc: [f32; 3],
}

/// A walking robot's parameters, each time they have been solved for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Walk {
    /// Device time at which the solution was begun, µs.
    pub time_us: u64,
    /// Equations of data in it.
    pub equations: u32,
    /// Root mean square of what is left of one, N m.
    pub noise: f32,
    /// The whole robot's mass, kg, and its standard deviation if what is left is independent.
    pub mass: [f32; 2],
    /// The trunk's ten inertial parameters about the base's origin, in the order of θ.
    pub trunk: [f32; 10],
    /// The accelerometer's bias, m/s².
    pub acc_bias: [f32; 3],
    /// Viscous and Coulomb friction, rotor inertia and bias of each joint, in SDK order; SI.
    pub effects: [[f32; EFFECTS]; JOINTS],
    /// What became of samples and windows.
    pub counts: WalkCounts,
}
