//! Where snapshots lie in the flash, and how a whole one is told from what a power failure has left.
//!
//! A slot is as many whole sectors as a snapshot takes. Its words of 32 bytes, the largest that a microcontroller writes at once
//! (STM32H7), each written once:
//!
//! | word | |
//! |---|---|
//! | first | magic, schema, hash of robot and model, the snapshot's number |
//! | between | `f64`, little-endian, whatever the device computes with |
//! | last | magic, the number again, CRC-32 of all words before |

use crc::{CRC_32_ISCSI, Crc};
use embedded_storage::nor_flash::NorFlash;

use super::super::leg::{LegData, SETTINGS};
use super::super::setup::SETUP_SECTORS;
use super::{SNAPSHOT_LEN, WORDS};
use crate::Real;
use crate::estimator::COLUMNS;
use crate::go2::{LEGS, Leg, leg};
use crate::wire::SCHEMA;

/// Bytes that are written at once.
pub(in crate::app) const WORD: usize = 32;
pub(in crate::app) type Word = [u8; WORD];

/// Numbers in a word.
pub(super) const NUMBERS_PER_WORD: usize = WORD / size_of::<f64>();

/// Checksum of a snapshot.
pub(in crate::app) static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// What the first and the last word begin with; the digit is the layout's version.
const FIRST: [u8; 8] = *b"proprio1";
const LAST: [u8; 8] = *b"whole\0\0\0";

/// The first word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Head {
    schema: [u8; 8],
    model: u64,
    pub(super) generation: u32,
}

impl Head {
    pub(super) fn new(model: u64, generation: u32) -> Self {
        Self {
            schema: SCHEMA,
            model,
            generation,
        }
    }

    pub(super) fn encode(&self) -> Word {
        let words = WORDS as u32;
        join([
            FIRST,
            self.schema,
            self.model.to_le_bytes(),
            (u64::from(words) << 32 | u64::from(self.generation)).to_le_bytes(),
        ])
    }

    fn decode(word: &Word) -> Option<Self> {
        let [first, schema, model, sizes] = split(word);
        let sizes = u64::from_le_bytes(sizes);
        (first == FIRST && sizes >> 32 == WORDS as u64).then_some(Self {
            schema,
            model: u64::from_le_bytes(model),
            generation: sizes as u32,
        })
    }

    /// Whether the numbers mean what they mean here.
    pub(super) fn is_of(&self, model: u64) -> bool {
        self.schema == SCHEMA && self.model == model
    }
}

/// The last word.
pub(in crate::app) fn last_word(generation: u32, checksum: u32) -> Word {
    let numbers = u64::from(checksum) << 32 | u64::from(generation);
    join([LAST, numbers.to_le_bytes(), (!numbers).to_le_bytes(), LAST])
}

/// A word of four parts.
pub(in crate::app) fn join(parts: [[u8; 8]; 4]) -> Word {
    let mut word = [0; WORD];
    let (places, _) = word.as_chunks_mut();
    places
        .iter_mut()
        .zip(parts)
        .for_each(|(to, from)| *to = from);
    word
}

/// A word's four parts.
pub(in crate::app) fn split(word: &Word) -> [[u8; 8]; 4] {
    let mut parts = [[0; 8]; 4];
    let (places, _) = word.as_chunks();
    parts
        .iter_mut()
        .zip(places)
        .for_each(|(to, from)| *to = *from);
    parts
}

/// How many slots the flash has; none, where it does not write words of 32 bytes.
pub(super) fn count<F: NorFlash>(flash: &F) -> u32 {
    let length = slot_len::<F>();
    if !WORD.is_multiple_of(F::WRITE_SIZE.max(1)) {
        return 0;
    }
    let setup = SETUP_SECTORS * F::ERASE_SIZE;
    (flash.capacity().saturating_sub(setup) / length.max(1)) as u32
}

const fn slot_len<F: NorFlash>() -> usize {
    SNAPSHOT_LEN.next_multiple_of(F::ERASE_SIZE)
}

/// The bytes of a slot, from and to.
pub(super) fn span<F: NorFlash>(slot: u32) -> (u32, u32) {
    let length = slot_len::<F>() as u32;
    let from = slot.saturating_mul(length);
    (from, from.saturating_add(length))
}

/// A word of a slot.
pub(super) fn read<F: NorFlash>(flash: &mut F, slot: u32, word: usize) -> Word {
    let from = span::<F>(slot).0;
    read_at(flash, from.saturating_add((word * WORD) as u32))
}

/// A word; zeros, which are none that is written, where it cannot be read.
pub(in crate::app) fn read_at<F: NorFlash>(flash: &mut F, offset: u32) -> Word {
    let mut bytes = [0; WORD];
    match flash.read(offset, &mut bytes) {
        Ok(()) => bytes,
        Err(_) => [0; WORD],
    }
}

/// The first word of the snapshot in a slot, if all of it is there.
pub(super) fn whole<F: NorFlash>(flash: &mut F, slot: u32) -> Option<Head> {
    let head = Head::decode(&read(flash, slot, 0))?;
    let mut digest = CRC.digest();
    for word in 0..=WORDS {
        digest.update(&read(flash, slot, word));
    }
    let last = last_word(head.generation, digest.finalize());
    (read(flash, slot, WORDS + 1) == last).then_some(head)
}

/// What the numbers mean: a hash (FNV-1a) of the robot's bodies, the columns that are kept, the effects, the window's length.
pub(super) fn model<T: Real>(data: &[LegData<T>; LEGS]) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut take = |byte: u8| hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
    for which in Leg::ALL {
        for body in leg::<f64>(which).bodies() {
            let numbers = body.inertia.0.iter();
            numbers.for_each(|x| x.to_le_bytes().into_iter().for_each(&mut take));
        }
    }
    for data in data {
        data.independent().for_each(&mut take);
    }
    for effect in COLUMNS {
        effect.name().bytes().chain([0]).for_each(&mut take);
    }
    let window = SETTINGS.window_us.to_le_bytes();
    window.into_iter().for_each(&mut take);
    hash
}
