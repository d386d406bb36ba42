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
    /// Commanded velocity, rad/s.
    DqDes,
    /// Commanded torque, N m: of a drive with gains what it adds to them (feed-forward).
    TauDes,
    /// A drive's gain of position, N m/rad.
    Kp,
    /// A drive's gain of velocity, N m s/rad.
    Kd,
}

impl Channel {
    /// The channels every recorded joint must have.
    pub const MOTION: [Self; 3] = [Self::Q, Self::Dq, Self::Tau];
    /// All of them, in the order of a row in memory.
    pub const ALL: [Self; 10] = [
        Self::Q,
        Self::Dq,
        Self::Tau,
        Self::Temp,
        Self::QDes,
        Self::QLink,
        Self::DqDes,
        Self::TauDes,
        Self::Kp,
        Self::Kd,
    ];
    /// What a drive was asked to do: τ = tau_des + kp (q_des − q) + kd (dq_des − dq).
    pub const COMMAND: [Self; 5] = [Self::QDes, Self::DqDes, Self::TauDes, Self::Kp, Self::Kd];

    /// The part of the column's name before the slash.
    pub const fn prefix(self) -> &'static str {
        match self {
            Self::Q => "q",
            Self::Dq => "dq",
            Self::Tau => "tau",
            Self::Temp => "temp",
            Self::QDes => "q_des",
            Self::QLink => "q_link",
            Self::DqDes => "dq_des",
            Self::TauDes => "tau_des",
            Self::Kp => "kp",
            Self::Kd => "kd",
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
