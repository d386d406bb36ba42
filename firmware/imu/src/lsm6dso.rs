//! The chip: how it is begun and read.

use crate::registers::*;
use embedded_hal::spi::{Operation, SpiDevice};
use embedded_hal_async::delay::DelayNs;

/// A reset takes 50 µs (AN5192, 3.9); asked so often whether it is over, and so far apart.
const RESET_LOOKS: usize = 20;
const RESET_LOOK_US: u32 = 50;
/// Looks at a measurement that is half there: the accelerometer's and the gyroscope's come together, to some microseconds.
const LOOKS: usize = 4;

/// Why there is no reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault<E> {
    /// The SPI says so.
    Bus(E),
    /// What WHO_AM_I read: no LSM6DSO. 0x00 or 0xFF is a line that nobody drives.
    NotThere(u8),
    /// A register that does not keep what is written.
    Refused(u8),
    /// Nothing that has not been read before.
    NotReady,
    /// Status bits that are always zero are not: a line that nobody drives.
    Garbled,
    /// An axis is at the end of its range: what it read was more.
    OverRange,
}

impl<E> From<E> for Fault<E> {
    fn from(error: E) -> Self {
        Self::Bus(error)
    }
}

/// A measurement, in the chip's axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Angular velocity, rad/s.
    pub gyro: [f32; 3],
    /// Specific force, m/s².
    pub acc: [f32; 3],
    /// °C.
    pub temperature: f32,
}

/// An LSM6DSO at an SPI of its own.
#[derive(Debug)]
pub struct Lsm6dso<S> {
    spi: S,
    settings: Settings,
}

impl<S: SpiDevice> Lsm6dso<S> {
    /// A chip that measures by `settings` once it is [begun](Self::begin).
    pub fn new(spi: S, settings: Settings) -> Self {
        Self { spi, settings }
    }

    /// Resets the chip, whatever it was at, and has it measure. INT1 pulses at each measurement from then on.
    ///
    /// # Errors
    /// If there is no LSM6DSO, or it does not keep what it is told.
    pub async fn begin(&mut self, delay: &mut impl DelayNs) -> Result<(), Fault<S::Error>> {
        let who = self.register(WHO_AM_I)?;
        if who != LSM6DSO {
            return Err(Fault::NotThere(who));
        }
        self.write(CTRL3_C, SW_RESET)?;
        let mut looks = 0;
        while self.register(CTRL3_C)? & SW_RESET != 0 {
            looks += 1;
            if looks > RESET_LOOKS {
                return Err(Fault::Refused(CTRL3_C));
            }
            delay.delay_us(RESET_LOOK_US).await;
        }
        self.set(CTRL9_XL, CTRL9_XL_RESET | I3C_DISABLE)?;
        self.set(CTRL4_C, DRDY_MASK | I2C_DISABLE)?;
        self.set(CTRL3_C, BDU | IF_INC)?;
        self.set(COUNTER_BDR_REG1, DATAREADY_PULSED)?;
        self.set(INT1_CTRL, INT1_DRDY_G)?;
        self.measure(self.settings)
    }

    /// The last measurement, if it has not been read before.
    ///
    /// # Errors
    /// If it has, or is none that can be used.
    pub fn read(&mut self) -> Result<Reading, Fault<S::Error>> {
        let bytes = self.raw()?;
        let [gyro, acc] = numbers(&bytes);
        if [gyro, acc]
            .as_flattened()
            .iter()
            .any(|n| matches!(*n, i16::MAX | i16::MIN))
        {
            return Err(Fault::OverRange);
        }
        let (rate, force) = (self.settings.gyro.count(), self.settings.acc.count());
        Ok(Reading {
            gyro: gyro.map(|n| f32::from(n) * rate),
            acc: acc.map(|n| f32::from(n) * force),
            temperature: 25.0 + f32::from(number(&bytes, 2)) / 256.0,
        })
    }

    /// The registers of a new measurement.
    pub(crate) fn raw(&mut self) -> Result<[u8; MEASUREMENT], Fault<S::Error>> {
        let mut new = 0;
        for _ in 0..LOOKS {
            let bytes = self.registers::<MEASUREMENT>(STATUS_REG)?;
            let [status, ..] = bytes;
            if status & STATUS_ZEROS != 0 {
                return Err(Fault::Garbled);
            }
            // What is read is no longer new, and stays in its registers until the next.
            new |= status & (XLDA | GDA);
            match new {
                0 => return Err(Fault::NotReady),
                both if both == XLDA | GDA => return Ok(bytes),
                _ => {}
            }
        }
        Err(Fault::NotReady)
    }

    /// Has both sensors measure.
    pub(crate) fn measure(&mut self, settings: Settings) -> Result<(), Fault<S::Error>> {
        self.set(CTRL1_XL, settings.ctrl1_xl())?;
        self.set(CTRL2_G, settings.ctrl2_g())
    }

    /// How it measures.
    pub(crate) fn settings(&self) -> Settings {
        self.settings
    }

    /// Writes a register and looks whether it is so.
    pub(crate) fn set(&mut self, register: u8, value: u8) -> Result<(), Fault<S::Error>> {
        self.write(register, value)?;
        match self.register(register)? == value {
            true => Ok(()),
            false => Err(Fault::Refused(register)),
        }
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), Fault<S::Error>> {
        Ok(self.spi.write(&[register, value])?)
    }

    fn register(&mut self, register: u8) -> Result<u8, Fault<S::Error>> {
        let [value] = self.registers(register)?;
        Ok(value)
    }

    fn registers<const N: usize>(&mut self, first: u8) -> Result<[u8; N], Fault<S::Error>> {
        let mut bytes = [0; N];
        let address = [READ | first];
        let mut operations = [Operation::Write(&address), Operation::Read(&mut bytes)];
        self.spi.transaction(&mut operations)?;
        Ok(bytes)
    }
}

/// A measurement's number, low byte first, behind so many registers.
fn number(bytes: &[u8; MEASUREMENT], place: usize) -> i16 {
    match bytes.get(place..) {
        Some([low, high, ..]) => i16::from_le_bytes([*low, *high]),
        _ => 0,
    }
}

/// The counts of gyroscope and accelerometer.
pub(crate) fn numbers(bytes: &[u8; MEASUREMENT]) -> [[i16; 3]; 2] {
    [4, 10].map(|first| [0, 2, 4].map(|axis| number(bytes, first + axis)))
}
