//! What the board is set up for ([`Setup`]), kept in the last two sectors of its flash, by the rule of snapshots: the older of two records is erased
//! and written, and its last word says that it is whole. So whenever the power fails, the newest whole record is the one before or this one.
//!
//! It is a record of its own because it outlives what a snapshot does not: another version of the messages, of the model, and the other of a
//! board's two images.

use embedded_storage::nor_flash::NorFlash;

use super::snapshot::slots::{CRC, WORD, Word, join, last_word, read_at, split};
use crate::slot::Slot;
use crate::wire::{Outcome, Setup};

/// Sectors of the flash, its last, that are not snapshots'.
pub const SETUP_SECTORS: usize = 2;

/// What the first word begins with; the digit is the layout's version.
const FIRST: [u8; 8] = *b"set up 1";
/// First, numbers, last.
const WORDS: usize = 3;
/// Times that the flash may refuse the same thing, a step each, before a record is given up: an erasure takes up to 4 s.
pub(super) const TRIES: u32 = 5_000;

/// What is kept, and the record under way.
pub(super) struct SetupRecord {
    kept: Setup,
    /// Where the newest record is, and its number.
    newest: Slot<(u32, u32)>,
    is_open: bool,
    wanted: Slot<Setup>,
    /// Words of the wanted record that are written, after its sector was erased; one more than are.
    begun: usize,
    tries: u32,
}

/// What became of a step of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Progress {
    /// It goes on.
    Busy,
    /// Nothing is under way any more.
    Done,
    /// The flash refused it too often.
    GivenUp,
}

/// What a board is set up for by its flash; `otherwise` where that has no whole record.
pub fn setup_in(flash: &mut impl NorFlash, otherwise: Setup) -> Setup {
    let mut record = SetupRecord::new();
    record.open(flash, otherwise);
    record.kept
}

impl SetupRecord {
    /// Nowhere to keep anything: all zeros.
    pub(super) const fn new() -> Self {
        Self {
            kept: Setup {
                imu_at: [0; 3],
                imu_turned: [0; 3],
                bus_baud: 0,
            },
            newest: Slot::Empty,
            is_open: false,
            wanted: Slot::Empty,
            begun: 0,
            tries: 0,
        }
    }

    /// Looks for the newest whole record.
    pub(super) fn open<F: NorFlash>(&mut self, flash: &mut F, otherwise: Setup) {
        self.kept = otherwise;
        self.is_open = flash.capacity() >= SETUP_SECTORS * F::ERASE_SIZE
            && WORD.is_multiple_of(F::WRITE_SIZE.max(1));
        if !self.is_open {
            return;
        }
        for slot in 0..SETUP_SECTORS as u32 {
            let newest = self.newest.get().copied();
            if let Some((setup, number)) = whole(flash, slot)
                && newest.is_none_or(|(_, newest)| number.wrapping_sub(newest) as i32 > 0)
            {
                (self.kept, self.newest) = (setup, Slot::Full((slot, number)));
            }
        }
    }

    /// What the next start will be with; `otherwise` where there is no flash.
    pub(super) fn kept(&self, otherwise: Setup) -> Setup {
        if self.is_open { self.kept } else { otherwise }
    }

    /// Has a record begin with the next step, unless it is what is kept: flash wears.
    pub(super) fn want(&mut self, setup: Setup) -> Outcome {
        if !setup.is_possible() {
            return Outcome::OutOfRange;
        }
        if !self.is_open {
            return Outcome::NoStorage;
        }
        (self.begun, self.tries) = (0, 0);
        self.wanted = match setup == self.kept {
            true => Slot::Empty,
            false => Slot::Full(setup),
        };
        Outcome::Accepted
    }

    /// Whether a record is under way.
    #[inline]
    pub(super) fn is_wanted(&self) -> bool {
        self.wanted.get().is_some()
    }

    /// Does a step of the record that is under way: an erasure, or a word.
    pub(super) fn advance<F: NorFlash>(&mut self, flash: &mut F) -> Progress {
        let Slot::Full(setup) = self.wanted else {
            return Progress::Done;
        };
        let (slot, number) = match self.newest {
            Slot::Full((slot, number)) => (1 - slot.min(1), number.wrapping_add(1)),
            Slot::Empty => (0, 1),
        };
        let from = begin_of(flash, slot);
        let words = words_of(&setup, number);
        let done = match self
            .begun
            .checked_sub(1)
            .and_then(|n| Some((n, words.get(n)?)))
        {
            None => flash.erase(from, from.saturating_add(F::ERASE_SIZE as u32)),
            Some((n, word)) => flash.write(from.saturating_add((n * WORD) as u32), word),
        };
        self.tries = if done.is_ok() { 0 } else { self.tries + 1 };
        if self.tries >= TRIES {
            self.wanted = Slot::Empty;
            return Progress::GivenUp;
        }
        self.begun += usize::from(done.is_ok());
        if self.begun <= WORDS {
            return Progress::Busy;
        }
        (self.kept, self.newest, self.wanted) = (setup, Slot::Full((slot, number)), Slot::Empty);
        Progress::Done
    }
}

/// Where a record begins.
fn begin_of<F: NorFlash>(flash: &F, slot: u32) -> u32 {
    let sectors = SETUP_SECTORS - (slot as usize).min(SETUP_SECTORS);
    flash.capacity().saturating_sub(sectors * F::ERASE_SIZE) as u32
}

/// A record's words.
fn words_of(setup: &Setup, number: u32) -> [Word; WORDS] {
    let first = join([FIRST, u64::from(number).to_le_bytes(), [0; 8], [0; 8]]);
    let [x, y, z] = setup.imu_at.map(i16::cast_unsigned).map(u32::from);
    let [roll, pitch, yaw] = setup.imu_turned.map(i16::cast_unsigned).map(u32::from);
    let pair = |low: u32, high: u32| (u64::from(high) << 32 | u64::from(low)).to_le_bytes();
    let numbers = join([
        pair(x, y),
        pair(z, roll),
        pair(pitch, yaw),
        pair(setup.bus_baud, 0),
    ]);
    let mut digest = CRC.digest();
    digest.update(&first);
    digest.update(&numbers);
    [first, numbers, last_word(number, digest.finalize())]
}

/// The record in a slot and its number, if all of it is there and a board can be set up so.
fn whole<F: NorFlash>(flash: &mut F, slot: u32) -> Option<(Setup, u32)> {
    let from = begin_of(flash, slot);
    let mut words = [[0; WORD]; WORDS];
    for (n, word) in words.iter_mut().enumerate() {
        *word = read_at(flash, from.saturating_add((n * WORD) as u32));
    }
    let [first, numbers, _] = &words;
    let [_, number, ..] = split(first);
    let number = u64::from_le_bytes(number) as u32;
    let [a, b, c, d] = split(numbers).map(u64::from_le_bytes);
    let halves = |pair: u64| [pair as u32, (pair >> 32) as u32];
    let ([x, y], [z, roll], [pitch, yaw], [bus_baud, _]) =
        (halves(a), halves(b), halves(c), halves(d));
    let setup = Setup {
        imu_at: [x, y, z].map(|x| x as i16),
        imu_turned: [roll, pitch, yaw].map(|x| x as i16),
        bus_baud,
    };
    (words == words_of(&setup, number) && setup.is_possible()).then_some((setup, number))
}
