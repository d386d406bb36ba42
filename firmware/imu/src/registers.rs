//! The chip's registers, and the ranges and rates that can be set (DS12140, section 9).

pub(crate) const COUNTER_BDR_REG1: u8 = 0x0B;
pub(crate) const INT1_CTRL: u8 = 0x0D;
pub(crate) const WHO_AM_I: u8 = 0x0F;
pub(crate) const CTRL1_XL: u8 = 0x10;
pub(crate) const CTRL2_G: u8 = 0x11;
pub(crate) const CTRL3_C: u8 = 0x12;
pub(crate) const CTRL4_C: u8 = 0x13;
pub(crate) const CTRL5_C: u8 = 0x14;
pub(crate) const CTRL9_XL: u8 = 0x18;
/// The first of a measurement's registers: status, one that is reserved, temperature, angular rate, acceleration.
pub(crate) const STATUS_REG: u8 = 0x1E;
/// Registers of a measurement.
pub(crate) const MEASUREMENT: usize = 16;

/// What WHO_AM_I reads.
pub(crate) const LSM6DSO: u8 = 0x6C;
/// The first bit of a transfer that reads.
pub(crate) const READ: u8 = 0x80;

/// STATUS_REG: there is a new acceleration, angular rate; the temperature's is bit 2, the others are zero.
pub(crate) const XLDA: u8 = 1 << 0;
pub(crate) const GDA: u8 = 1 << 1;
pub(crate) const STATUS_ZEROS: u8 = 0xF8;

/// CTRL3_C: a measurement stays whole while it is read; the address goes on by itself; resets all registers.
pub(crate) const BDU: u8 = 1 << 6;
pub(crate) const IF_INC: u8 = 1 << 2;
pub(crate) const SW_RESET: u8 = 1 << 0;
/// CTRL4_C: no data-ready signal before the filters have settled; no I²C.
pub(crate) const DRDY_MASK: u8 = 1 << 3;
pub(crate) const I2C_DISABLE: u8 = 1 << 2;
/// CTRL9_XL: its state after a reset, and no I3C.
pub(crate) const CTRL9_XL_RESET: u8 = 0xE0;
pub(crate) const I3C_DISABLE: u8 = 1 << 1;
/// COUNTER_BDR_REG1: each measurement is a pulse on INT1, also if the one before has not been read.
pub(crate) const DATAREADY_PULSED: u8 = 1 << 7;
/// INT1_CTRL: INT1 tells of a new angular rate.
pub(crate) const INT1_DRDY_G: u8 = 1 << 1;
/// CTRL5_C: the masses are pushed to their positive side.
pub(crate) const ST_XL_POSITIVE: u8 = 0b01;
pub(crate) const ST_G_POSITIVE: u8 = 0b01 << 2;

/// Measurements a second, of accelerometer and gyroscope alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum Rate {
    Hz52 = 0b0011,
    Hz104 = 0b0100,
    Hz208 = 0b0101,
    Hz416 = 0b0110,
    Hz833 = 0b0111,
    Hz1666 = 0b1000,
    Hz3332 = 0b1001,
}

/// The most that the accelerometer reads, g.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum AccRange {
    G2 = 0b00,
    G4 = 0b10,
    G8 = 0b11,
    G16 = 0b01,
}

/// The most that the gyroscope reads, degrees a second.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
#[allow(missing_docs)]
pub enum GyroRange {
    Dps250 = 0b00,
    Dps500 = 0b01,
    Dps1000 = 0b10,
    Dps2000 = 0b11,
}

/// Standard gravity, m/s².
const G: f32 = 9.806_65;

impl AccRange {
    /// What a count is, m/s² (DS12140, table 2: LA_So).
    pub const fn count(self) -> f32 {
        G * 1e-3
            * match self {
                Self::G2 => 0.061,
                Self::G4 => 0.122,
                Self::G8 => 0.244,
                Self::G16 => 0.488,
            }
    }
}

impl GyroRange {
    /// What a count is, rad/s (DS12140, table 2: G_So).
    pub const fn count(self) -> f32 {
        (1e-3
            * match self {
                Self::Dps250 => 8.75_f32,
                Self::Dps500 => 17.5,
                Self::Dps1000 => 35.0,
                Self::Dps2000 => 70.0,
            })
        .to_radians()
    }
}

/// How the chip is to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Measurements a second.
    pub rate: Rate,
    /// Of the accelerometer.
    pub acc: AccRange,
    /// Of the gyroscope.
    pub gyro: GyroRange,
}

impl Settings {
    pub(crate) fn ctrl1_xl(self) -> u8 {
        (self.rate as u8) << 4 | (self.acc as u8) << 2
    }

    pub(crate) fn ctrl2_g(self) -> u8 {
        (self.rate as u8) << 4 | (self.gyro as u8) << 2
    }
}
