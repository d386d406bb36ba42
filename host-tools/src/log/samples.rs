//! What became of a log's samples.

use serde::Serialize;

/// What became of the samples.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Samples {
    /// All.
    pub total: u64,
    /// Equal to the one before: skipped.
    pub repeated: u64,
    /// Not after the one before: skipped.
    pub late: u64,
    /// Beyond what the robot can do: skipped.
    pub rejected: u64,
    /// Silences that no window bridges.
    pub gaps: u64,
}

impl Samples {
    /// Of two logs together.
    pub(crate) fn plus(self, other: &Self) -> Self {
        Self {
            total: self.total + other.total,
            repeated: self.repeated + other.repeated,
            late: self.late + other.late,
            rejected: self.rejected + other.rejected,
            gaps: self.gaps + other.gaps,
        }
    }
}
