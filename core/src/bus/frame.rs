//! The two frames and their units.
//!
//! The wire speaks of the rotor: angles in turns/32768, speeds in turns/256 per second, torques in 1/256 N m. With gear
//! ratio N (rotor turns per joint turn) q_joint = q_rotor/N, q̇ likewise, τ_joint = N τ_rotor.

use core::f64::consts::TAU;

use nalgebra::ComplexField;

use super::crc::checksum;

/// rad per count of position, rotor side.
const POSITION: f64 = TAU / 32768.0;
/// rad/s per count of speed, rotor side.
const SPEED: f64 = TAU / 256.0;
/// N m per count of torque, rotor side.
const TORQUE: f64 = 1.0 / 256.0;

/// Joint position (rad), velocity (rad/s) and torque (N m) of one count each, behind a transmission of ratio `gear`.
#[cfg(feature = "app")]
pub(crate) const fn joint_side(gear: f64) -> [f64; 3] {
    [POSITION / gear, SPEED / gear, TORQUE * gear]
}

/// Counts of position, rotor side, that a joint's `angle` (rad) is behind a transmission of ratio `gear`.
///
/// # Errors
/// [`EncodeError`] where the angle is not finite or does not fit the wire.
pub fn position_counts(gear: f64, angle: f64) -> Result<i32, EncodeError> {
    counts(angle * gear / POSITION)
}

/// Why a joint-side quantity has no frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// The quantity is NaN or infinite.
    NotFinite,
    /// The quantity does not fit the integer of the wire.
    OutOfRange,
}

impl core::fmt::Display for EncodeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "not a finite number",
            Self::OutOfRange => "larger than the motor bus can carry",
        })
    }
}

impl core::error::Error for EncodeError {}

/// What a motor is told to do, or says it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Status {
    /// Windings idle.
    Lock,
    /// Field-oriented control.
    Foc,
    /// Encoder calibration.
    Calibrate,
    /// A code without a published meaning.
    Other(u8),
}

/// The mode byte: who, and in which state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Mode(
    /// Bits 0–3 motor id, 4–6 status, 7 unused.
    pub u8,
);

impl Mode {
    /// Id that addresses every motor of the bus.
    pub const BROADCAST: u8 = 15;

    /// Motor `id` (its low four bits) under field-oriented control.
    pub const fn foc(id: u8) -> Self {
        Self(0x10 | (id & 0x0F))
    }

    /// Motor id, 0–14, or [`Self::BROADCAST`].
    pub const fn id(self) -> u8 {
        self.0 & 0x0F
    }

    /// State of the motor.
    pub const fn status(self) -> Status {
        match (self.0 >> 4) & 7 {
            0 => Status::Lock,
            1 => Status::Foc,
            2 => Status::Calibrate,
            other => Status::Other(other),
        }
    }
}

/// Master to motor: τ = torque + k_pos (position − q) + k_spd (speed − q̇), all on the rotor side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Command {
    /// Addressee and state.
    pub mode: Mode,
    /// Feed-forward torque, 1/256 N m.
    pub torque: i16,
    /// Desired speed, 2π/256 rad/s.
    pub speed: i16,
    /// Desired position, 2π/32768 rad.
    pub position: i32,
    /// Position gain, 1/1280 N m/rad.
    pub k_pos: u16,
    /// Speed gain, 1/1280 N m s/rad.
    pub k_spd: u16,
}

impl Command {
    /// Bytes of a command.
    pub const LEN: usize = 17;
    /// First two bytes.
    pub const HEADER: [u8; 2] = [0xFE, 0xEE];

    /// The command's bytes, with a CRC started from `seed`.
    pub fn encode(&self, seed: u16) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..2].copy_from_slice(&Self::HEADER);
        bytes[2] = self.mode.0;
        bytes[3..5].copy_from_slice(&self.torque.to_le_bytes());
        bytes[5..7].copy_from_slice(&self.speed.to_le_bytes());
        bytes[7..11].copy_from_slice(&self.position.to_le_bytes());
        bytes[11..13].copy_from_slice(&self.k_pos.to_le_bytes());
        bytes[13..15].copy_from_slice(&self.k_spd.to_le_bytes());
        let crc = checksum(seed, &bytes[..15]);
        bytes[15..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// The fields of a command whose header and CRC have been checked.
    pub(super) const fn parse(b: &[u8; Self::LEN]) -> Self {
        Self {
            mode: Mode(b[2]),
            torque: i16::from_le_bytes([b[3], b[4]]),
            speed: i16::from_le_bytes([b[5], b[6]]),
            position: i32::from_le_bytes([b[7], b[8], b[9], b[10]]),
            k_pos: u16::from_le_bytes([b[11], b[12]]),
            k_spd: u16::from_le_bytes([b[13], b[14]]),
        }
    }
}

/// Motor to master: the state of the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reply {
    /// Sender and state.
    pub mode: Mode,
    /// Torque, 1/256 N m, rotor side.
    pub torque: i16,
    /// Speed, 2π/256 rad/s, rotor side.
    pub speed: i16,
    /// Position, 2π/32768 rad, rotor side, multi-turn.
    pub position: i32,
    /// Motor temperature, °C.
    pub temperature: i8,
    /// Bits 0–2 error, 3–14 foot pressure, 15 unused.
    pub flags: u16,
}

impl Reply {
    /// Bytes of a reply.
    pub const LEN: usize = 16;
    /// First two bytes.
    pub const HEADER: [u8; 2] = [0xFD, 0xEE];
    /// The end of the temperature's scale, °C, which no motor survives: it is hotter than it can say, or has no sensor.
    pub const TOP_TEMPERATURE: i8 = i8::MAX;

    /// All zeros, a constant.
    pub(super) const ZERO: Self = Self {
        mode: Mode(0),
        torque: 0,
        speed: 0,
        position: 0,
        temperature: 0,
        flags: 0,
    };

    /// The reply nearest to a joint's position `q` (rad), velocity `dq` (rad/s) and torque `tau` (N m) behind a
    /// transmission of ratio `gear`.
    ///
    /// # Errors
    /// [`EncodeError`] where a quantity is not finite or does not fit the wire.
    pub fn from_joint(
        mode: Mode,
        gear: f64,
        q: f64,
        dq: f64,
        tau: f64,
        temperature: i8,
    ) -> Result<Self, EncodeError> {
        Ok(Self {
            mode,
            torque: narrow(counts(tau / gear / TORQUE)?)?,
            speed: narrow(counts(dq * gear / SPEED)?)?,
            position: position_counts(gear, q)?,
            temperature,
            flags: 0,
        })
    }

    /// Joint position in rad behind a transmission of ratio `gear`.
    pub fn joint_position(&self, gear: f64) -> f64 {
        f64::from(self.position) * POSITION / gear
    }

    /// Joint velocity in rad/s.
    pub fn joint_velocity(&self, gear: f64) -> f64 {
        f64::from(self.speed) * SPEED / gear
    }

    /// Motor torque in N m on the joint side: electromagnetic torque × gear, no gear friction in it.
    pub fn joint_torque(&self, gear: f64) -> f64 {
        f64::from(self.torque) * TORQUE * gear
    }

    /// Error code: 0 none, 1 overheat, 2 overcurrent, 3 overvoltage, 4 encoder.
    pub const fn error(&self) -> u8 {
        (self.flags & 7) as u8
    }

    /// Foot pressure, an uncalibrated count in 0–4095.
    pub const fn foot_pressure(&self) -> u16 {
        (self.flags >> 3) & 0x0FFF
    }

    /// The reply's bytes, with a CRC started from `seed`.
    pub fn encode(&self, seed: u16) -> [u8; Self::LEN] {
        let mut bytes = [0; Self::LEN];
        bytes[..2].copy_from_slice(&Self::HEADER);
        bytes[2] = self.mode.0;
        bytes[3..5].copy_from_slice(&self.torque.to_le_bytes());
        bytes[5..7].copy_from_slice(&self.speed.to_le_bytes());
        bytes[7..11].copy_from_slice(&self.position.to_le_bytes());
        bytes[11] = self.temperature.to_le_bytes()[0];
        bytes[12..14].copy_from_slice(&self.flags.to_le_bytes());
        let crc = checksum(seed, &bytes[..14]);
        bytes[14..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    /// The fields of a reply whose header and CRC have been checked.
    pub(super) const fn parse(b: &[u8; Self::LEN]) -> Self {
        Self {
            mode: Mode(b[2]),
            torque: i16::from_le_bytes([b[3], b[4]]),
            speed: i16::from_le_bytes([b[5], b[6]]),
            position: i32::from_le_bytes([b[7], b[8], b[9], b[10]]),
            temperature: i8::from_le_bytes([b[11]]),
            flags: u16::from_le_bytes([b[12], b[13]]),
        }
    }
}

/// The nearest integer.
fn counts(value: f64) -> Result<i32, EncodeError> {
    if !value.is_finite() {
        return Err(EncodeError::NotFinite);
    }
    let rounded = ComplexField::round(value);
    if rounded < f64::from(i32::MIN) || rounded > f64::from(i32::MAX) {
        return Err(EncodeError::OutOfRange);
    }
    Ok(rounded as i32)
}

fn narrow(counts: i32) -> Result<i16, EncodeError> {
    i16::try_from(counts).map_err(|_| EncodeError::OutOfRange)
}
