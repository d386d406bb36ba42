//! The signals of a joint, and what their columns are called.

use std::fmt;

/// A signal that each joint has of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// Position, rad (of a prismatic joint m; and so below).
    Q,
    /// Velocity, rad/s.
    Dq,
    /// Torque, N m.
    Tau,
    /// Motor temperature, degrees Celsius.
    Temp,
    /// Commanded position, rad.
    QDes,
    /// Position of a second encoder, at the link instead of the motor, rad.
    QLink,
}

impl Channel {
    /// The channels every recorded joint must have.
    pub const MOTION: [Self; 3] = [Self::Q, Self::Dq, Self::Tau];
    /// All of them, in the order of a row in memory.
    pub const ALL: [Self; 6] = [
        Self::Q,
        Self::Dq,
        Self::Tau,
        Self::Temp,
        Self::QDes,
        Self::QLink,
    ];

    /// The part of the column's name before the slash.
    pub const fn prefix(self) -> &'static str {
        match self {
            Self::Q => "q",
            Self::Dq => "dq",
            Self::Tau => "tau",
            Self::Temp => "temp",
            Self::QDes => "q_des",
            Self::QLink => "q_link",
        }
    }

    /// The column's name in a header, such as `dq/FR_hip`.
    pub fn column(self, joint: impl fmt::Display) -> String {
        format!("{}/{joint}", self.prefix())
    }

    /// The column's name where the signal is the motor's, before its gear: `q_motor/A1`.
    pub fn motor_column(self, joint: impl fmt::Display) -> String {
        format!("{}_motor/{joint}", self.prefix())
    }
}
