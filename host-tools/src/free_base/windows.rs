//! The windows of a log: what became of its time, and which samples each of them has.

use serde::Serialize;

/// What became of the time of a log.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Windows {
    /// Windows with rows.
    pub used: u64,
    /// … of them with so many feet that may carry a force, from none to all.
    pub by_feet: Vec<u64>,
    /// Equations in them that contact forces and friction at rest leave.
    pub equations: u64,
    /// Equations of joints in them that are left out because friction may hold the joint.
    pub resting: u64,
    /// Windows lost because a foot touched down or lifted off too soon after they began.
    pub cut: u64,
    /// Windows lost to an impact.
    pub impact: u64,
    /// Windows lost to a gap.
    pub gap: u64,
    /// Windows left out because contact forces and the friction of joints that rest leave no equation.
    pub still: u64,
    /// Windows left out because what is left of them is far beyond what is left of the others.
    pub outside: u64,
    /// Windows with rows, but without the base's: something beyond the feet carries the robot.
    pub held: u64,
    /// Samples that cannot be true.
    pub rejected: u64,
}

impl Windows {
    pub(super) fn plus(self, other: &Self) -> Self {
        Self {
            used: self.used + other.used,
            by_feet: (0..self.by_feet.len().max(other.by_feet.len()))
                .map(|f| [&self.by_feet, &other.by_feet].map(|own| own.get(f).unwrap_or(&0)))
                .map(|[own, other]| own + other)
                .collect(),
            equations: self.equations + other.equations,
            resting: self.resting + other.resting,
            cut: self.cut + other.cut,
            impact: self.impact + other.impact,
            gap: self.gap + other.gap,
            still: self.still + other.still,
            outside: self.outside + other.outside,
            held: self.held + other.held,
            rejected: self.rejected + other.rejected,
        }
    }
}

/// The samples of a window that was closed, and the joints that may rest in it.
pub(crate) struct WindowSamples {
    /// When it began, µs.
    pub(crate) start_us: u64,
    pub(crate) samples: Vec<usize>,
    pub(crate) resting: Vec<bool>,
}
