//! What a device that listens to a walking robot hears and says.

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

/// What became of a walking robot's samples and windows since the start; counts wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct WalkCounts {
    /// Samples of the whole robot.
    pub samples: u32,
    /// Samples that repeat the one before: skipped.
    pub repeated: u32,
    /// Late ones: skipped.
    pub late: u32,
    /// Ones that cannot be true: skipped.
    pub rejected: u32,
    /// Gaps, each of which costs 32 ms and the open window.
    pub gaps: u32,
    /// Windows folded in.
    pub windows: u32,
    /// Equations of them.
    pub equations: u32,
    /// Windows lost: a foot touched down or lifted off too soon after they began.
    pub cut: u32,
    /// Windows lost to an impact.
    pub impact: u32,
    /// Windows lost because a loaded leg was too straight or too folded.
    pub singular: u32,
    /// Windows lost because the one before was not yet folded in, or their numbers were not finite.
    pub unfolded: u32,
    /// Samples whose feet were judged.
    pub judged: u32,
    /// … of them those with a foot surely in the air, leg by leg.
    pub air: [u32; super::LEGS],
    /// Times that all legs had a sample, but the IMU had none of the last few milliseconds.
    pub without_imu: u32,
}

impl WalkCounts {
    /// Nothing counted.
    pub const ZERO: Self = Self {
        samples: 0,
        repeated: 0,
        late: 0,
        rejected: 0,
        gaps: 0,
        windows: 0,
        equations: 0,
        cut: 0,
        impact: 0,
        singular: 0,
        unfolded: 0,
        judged: 0,
        air: [0; super::LEGS],
        without_imu: 0,
    };
}
