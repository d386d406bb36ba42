//! What a walk counts: a value that the wire carries as it is.

use crate::go2::LEGS;

/// What became of a walking robot's samples and windows since the start; counts wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "wire",
    derive(serde::Serialize, serde::Deserialize, postcard_schema::Schema)
)]
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
    pub air: [u32; LEGS],
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
        air: [0; LEGS],
        without_imu: 0,
    };
}
