//! Where a row in memory keeps what.

use std::ops::Range;

use super::channel::Channel;

/// Where a row of a robot's log keeps what: one flat array, so that parsing it is one loop over (cell, slot) pairs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Slots {
    joints: usize,
    limbs: usize,
}

pub(super) const TIME: usize = 0;

impl Slots {
    pub(super) const fn new(joints: usize, limbs: usize) -> Self {
        Self { joints, limbs }
    }

    pub(super) const fn joints(self) -> usize {
        self.joints
    }

    /// A channel of one joint.
    pub(super) const fn of(self, channel: Channel, joint: usize) -> usize {
        1 + channel as usize * self.joints + joint
    }

    /// A channel of all joints.
    pub(super) const fn all(self, channel: Channel) -> Range<usize> {
        let first = self.of(channel, 0);
        first..first + self.joints
    }

    pub(super) const fn quat(self) -> usize {
        self.all(Channel::Kd).end
    }

    pub(super) const fn gyro(self) -> usize {
        self.quat() + 4
    }

    pub(super) const fn acc(self) -> usize {
        self.gyro() + 3
    }

    /// The feet of all limbs.
    pub(super) const fn feet(self) -> Range<usize> {
        let first = self.acc() + 3;
        first..first + self.limbs
    }

    /// Slots in all.
    pub(super) const fn count(self) -> usize {
        self.feet().end
    }

    /// What is read whole or not at all: all of an IMU's axes.
    pub(super) const fn groups(self) -> [(&'static str, usize, &'static [&'static str]); 3] {
        [
            ("quat", self.quat(), &["w", "x", "y", "z"]),
            ("gyro", self.gyro(), &["x", "y", "z"]),
            ("acc", self.acc(), &["x", "y", "z"]),
        ]
    }
}
