//! An LSM6DSO as its data sheet has it (DS12140): registers and what they are after a reset, an SPI whose address goes on by itself,
//! measurements at their rate, flags that reading takes back, ranges, the self-test. Its time is the delay's.

use crate::registers::*;
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use embedded_hal_async::delay::DelayNs;
use std::cell::RefCell;
use std::rc::Rc;
use std::vec::Vec;

/// What is wrong with the chip or its wires.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Wrong {
    Nothing,
    /// Nobody drives the chip's output: it reads this.
    Silent(u8),
    /// Nothing that is written arrives.
    Deaf,
    /// An axis whose mass is stuck: it reads zero.
    Stuck(usize),
    /// The SPI of the microcontroller reports an overrun.
    Bus,
    /// The accelerometer's measurement comes some transfers after the gyroscope's.
    Apart(u32),
}

pub(crate) struct Registers {
    bytes: [u8; 128],
    now_ns: u64,
    measured_at: u64,
    reset_until: u64,
    apart: u32,
    /// What it feels: degrees a second and g, and how it shakes.
    pub(crate) rate: [f64; 3],
    pub(crate) force: [f64; 3],
    pub(crate) shaking: [f64; 2],
    pub(crate) celsius: f64,
    pub(crate) wrong: Wrong,
    /// Measurements so far.
    pub(crate) measurements: u64,
}

/// A handle of the chip: its SPI and its clock are two of them.
#[derive(Clone)]
pub(crate) struct Chip(pub(crate) Rc<RefCell<Registers>>);

impl Chip {
    /// A chip that the power has just come to, at rest on a table.
    pub(crate) fn new() -> Self {
        let mut chip = Registers {
            bytes: [0; 128],
            now_ns: 0,
            measured_at: 0,
            reset_until: 0,
            apart: 0,
            rate: [0.0; 3],
            force: [0.0, 0.0, 1.0],
            shaking: [0.0; 2],
            celsius: 25.0,
            wrong: Wrong::Nothing,
            measurements: 0,
        };
        chip.defaults();
        Self(Rc::new(RefCell::new(chip)))
    }

    pub(crate) fn register(&self, register: u8) -> u8 {
        self.0.borrow().bytes[usize::from(register)]
    }

    /// Puts bytes where a measurement's are, as new ones.
    pub(crate) fn put(&self, register: u8, bytes: &[u8]) {
        let mut chip = self.0.borrow_mut();
        chip.bytes[usize::from(register)..][..bytes.len()].copy_from_slice(bytes);
        chip.bytes[usize::from(STATUS_REG)] |= XLDA | GDA;
    }

    pub(crate) fn wait_us(&self, us: u64) {
        self.0.borrow_mut().advance(us * 1000);
    }

    pub(crate) fn feel(&self, rate: [f64; 3], force: [f64; 3]) {
        let mut chip = self.0.borrow_mut();
        (chip.rate, chip.force) = (rate, force);
    }

    pub(crate) fn set_wrong(&self, wrong: Wrong) {
        self.0.borrow_mut().wrong = wrong;
    }

    /// The power fails for a moment.
    pub(crate) fn power_cycle(&self) {
        self.0.borrow_mut().defaults();
    }
}

impl Registers {
    fn defaults(&mut self) {
        self.bytes = [0; 128];
        self.bytes[usize::from(WHO_AM_I)] = LSM6DSO;
        self.bytes[usize::from(CTRL3_C)] = IF_INC;
        self.bytes[usize::from(CTRL9_XL)] = CTRL9_XL_RESET;
    }

    fn at(&self, register: u8) -> u8 {
        self.bytes[usize::from(register)]
    }

    /// A period of the output data rate, if both sensors have the same (table 44 of the data sheet: twice as fast with each number).
    fn period_ns(&self) -> Option<u64> {
        let rate = self.at(CTRL1_XL) >> 4;
        (rate > 0 && rate == self.at(CTRL2_G) >> 4)
            .then(|| (1e9 / (12.5 * f64::from(1u32 << (rate - 1)) * 833.0 / 800.0)) as u64)
    }

    fn advance(&mut self, ns: u64) {
        let end = self.now_ns + ns;
        while let Some(period) = self.period_ns() {
            let next = (self.measured_at + period).max(self.now_ns);
            if next > end {
                break;
            }
            self.now_ns = next;
            self.measured_at = next;
            self.measure();
        }
        self.now_ns = end;
        if self.at(CTRL3_C) & SW_RESET != 0 && self.now_ns >= self.reset_until {
            self.defaults();
        }
    }

    /// What it feels becomes numbers: rounded, and held at the end of the range.
    fn measure(&mut self) {
        self.measurements += 1;
        let (acc, gyro) = (self.at(CTRL1_XL) >> 2 & 0b11, self.at(CTRL2_G) >> 2 & 0b111);
        let mg = [0.061, 0.488, 0.122, 0.244][usize::from(acc)];
        // Bit 1 of the register is the range of 125 degrees a second.
        let mdps = if self.at(CTRL2_G) & 0b10 != 0 {
            4.375
        } else {
            [8.75, 17.5, 35.0, 70.0][usize::from(gyro & 0b11)]
        };
        let test = self.at(CTRL5_C);
        let push = |bits: u8, by: f64| match bits & 0b11 {
            0b01 => by,
            0b10 | 0b11 => -by,
            _ => 0.0,
        };
        let side = if self.measurements.is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        let (spin, pull) = (push(test >> 2, 400.0), push(test, 0.6));
        for axis in 0..3 {
            let rate = self.rate[axis] + spin + side * self.shaking[0];
            let force = self.force[axis] + pull + side * self.shaking[1];
            let stuck = |n: usize| self.wrong == Wrong::Stuck(n);
            let rate = if stuck(axis) { 0.0 } else { rate };
            let force = if stuck(3 + axis) { 0.0 } else { force };
            self.put(0x22 + 2 * axis, rate * 1000.0 / mdps);
            self.put(0x28 + 2 * axis, force * 1000.0 / mg);
        }
        self.put(0x20, (self.celsius - 25.0) * 256.0);
        let status = &mut self.bytes[usize::from(STATUS_REG)];
        *status |= GDA | 1 << 2;
        match self.wrong {
            Wrong::Apart(transfers) => self.apart = transfers,
            _ => *status |= XLDA,
        }
    }

    fn put(&mut self, register: usize, count: f64) {
        let count = count.round().clamp(-32768.0, 32767.0) as i16;
        self.bytes[register..register + 2].copy_from_slice(&count.to_le_bytes());
    }

    /// A transfer: the first byte says where, and whether to read.
    fn transfer(&mut self, bytes: &[u8], answer: &mut [u8]) {
        // 6.25 MHz.
        self.advance(1280 * (bytes.len() + answer.len()) as u64);
        if self.apart > 0 {
            self.apart -= 1;
            if self.apart == 0 {
                self.bytes[usize::from(STATUS_REG)] |= XLDA;
            }
        }
        let Some((first, data)) = bytes.split_first() else {
            return;
        };
        let mut register = first & !READ;
        let goes_on = self.at(CTRL3_C) & IF_INC != 0;
        if first & READ == 0 {
            for byte in data {
                self.write(register, *byte);
                register += u8::from(goes_on);
            }
            return;
        }
        for place in answer {
            *place = self.at(register);
            let status = usize::from(STATUS_REG);
            match register {
                0x23 | 0x25 | 0x27 => self.bytes[status] &= !GDA,
                0x29 | 0x2B | 0x2D => self.bytes[status] &= !XLDA,
                _ => {}
            }
            register += u8::from(goes_on);
        }
    }

    fn write(&mut self, register: u8, value: u8) {
        let read_only = matches!(register, WHO_AM_I | 0x1A..=0x3F);
        if self.wrong == Wrong::Deaf || read_only {
            return;
        }
        self.bytes[usize::from(register)] = value;
        if register == CTRL3_C && value & SW_RESET != 0 {
            self.reset_until = self.now_ns + 50_000;
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Overrun;

impl embedded_hal::spi::Error for Overrun {
    fn kind(&self) -> ErrorKind {
        ErrorKind::Overrun
    }
}

impl ErrorType for Chip {
    type Error = Overrun;
}

impl SpiDevice for Chip {
    /// One transaction is one transfer, between the falling and the rising edge of chip select.
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), Overrun> {
        let mut chip = self.0.borrow_mut();
        if chip.wrong == Wrong::Bus {
            return Err(Overrun);
        }
        let mut written = Vec::new();
        for operation in operations {
            match operation {
                Operation::Write(bytes) => written.extend_from_slice(bytes),
                Operation::Read(answer) => {
                    chip.transfer(&written, answer);
                    if let Wrong::Silent(level) = chip.wrong {
                        answer.fill(level);
                    }
                    return Ok(());
                }
                _ => unimplemented!("the driver writes, or writes and reads"),
            }
        }
        chip.transfer(&written, &mut []);
        Ok(())
    }
}

impl DelayNs for Chip {
    async fn delay_ns(&mut self, ns: u32) {
        self.0.borrow_mut().advance(ns.into());
    }
}
