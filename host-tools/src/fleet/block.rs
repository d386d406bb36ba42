//! A row of a table of blocks: one joint of one limb in one block of time.

use std::sync::Arc;

use proprio_solve::factor::HeapFactor;

use super::columns::BlockColumns;

/// CRC-32C (Castagnoli; RFC 3720, appendix B.4), sixteen bytes at a time: a fleet's factors are gigabytes.
const CRC: crc::Crc<u32, crc::Table<16>> = crc::Crc::<u32, crc::Table<16>>::new(&crc::CRC_32_ISCSI);

/// Digits of a log's SHA-256 that name it to people: 32 bits, so that of a thousand logs two share them with a chance of 10⁻⁴.
const DIGITS: usize = 8;

/// A log's name for people: the first digits of its SHA-256.
pub fn short_name(log: &str) -> String {
    log.chars().take(DIGITS).collect()
}

/// What the data of a joint say in a block of time.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The robot.
    pub robot: String,
    /// Where it stands.
    pub site: Option<String>,
    /// Its firmware.
    pub firmware: Option<String>,
    /// SHA-256 of the log, in hexadecimal.
    pub log: String,
    /// From when to when, s: Unix time where the log's clock, or `--begin`, gives it.
    pub t0: f64,
    /// See `t0`.
    pub t1: f64,
    /// When the block was made, Unix time, s.
    pub received: f64,
    /// The limb.
    pub limb: String,
    /// The joint.
    pub joint: String,
    /// Which of the parts that a block was cut into: a log's blocks have one, a device's several.
    pub fold: u32,
    /// What the numbers belong to.
    pub columns: Arc<BlockColumns>,
    /// Its hash ([`BlockColumns::hash`]).
    pub hash: Arc<str>,
    /// Windows of data: rows folded in.
    pub windows: f64,
    /// Root mean square that no value of the columns explains, N m: of window means, weighted as the fit weights them.
    pub rms: f64,
    /// Mean temperature of the motor, °C, where recorded.
    pub temperature: Option<f64>,
    /// \[R z; 0 ρ\] row by row, each from its diagonal on ([`HeapFactor::numbers`]).
    pub factor: Vec<f32>,
    /// CRC-32C of all of the above ([`Block::checksum`]).
    pub crc32c: u32,
    /// The program that made it.
    pub program: String,
}

/// What no two blocks of a table have in common.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Key {
    /// The robot.
    pub robot: String,
    /// The limb.
    pub limb: String,
    /// The joint's place in the limb.
    pub joint: usize,
    /// When the block begins, as an ordered number.
    pub t0: i64,
    /// The log.
    pub log: String,
    /// The fold.
    pub fold: u32,
}

impl Block {
    /// CRC-32C of the row: of each text its length and bytes, of each number its bytes, little-endian, in the order of the fields.
    pub fn checksum(&self) -> u32 {
        let mut digest = CRC.digest();
        let mut text = |text: &str| {
            digest.update(&(text.len() as u64).to_le_bytes());
            digest.update(text.as_bytes());
        };
        let optional = [&self.site, &self.firmware].map(|text| text.as_deref().unwrap_or(""));
        let texts = [&self.robot, optional[0], optional[1], &self.log];
        texts.into_iter().for_each(&mut text);
        [&self.limb, &self.joint, &self.program]
            .into_iter()
            .for_each(|own| text(own));
        text(&self.hash);
        let numbers = [
            self.t0,
            self.t1,
            self.received,
            f64::from(self.fold),
            self.windows,
            self.rms,
            self.temperature.unwrap_or(f64::INFINITY),
        ];
        numbers.iter().for_each(|x| digest.update(&x.to_le_bytes()));
        let bytes: Vec<u8> = self.factor.iter().flat_map(|x| x.to_le_bytes()).collect();
        digest.update(&bytes);
        digest.finalize()
    }

    /// The same with its checksum.
    pub fn sealed(mut self) -> Self {
        self.crc32c = self.checksum();
        self
    }

    /// By what it is known.
    pub fn key(&self) -> Key {
        Key {
            robot: self.robot.clone(),
            limb: self.limb.clone(),
            joint: self.columns.place(&self.joint).unwrap_or(usize::MAX),
            // Microseconds: a log's clock is no finer.
            t0: (1e6 * self.t0).round() as i64,
            log: self.log.clone(),
            fold: self.fold,
        }
    }

    /// Its factor; `None` if it does not have as many numbers as its columns ask for.
    pub fn heap_factor(&self) -> Option<HeapFactor> {
        let joint = self.columns.place(&self.joint)?;
        let columns = self.columns.of_joint(joint).len();
        let numbers = self.factor.iter().map(|x| f64::from(*x)).collect();
        HeapFactor::from_numbers(columns, self.windows as usize, numbers)
    }
}
