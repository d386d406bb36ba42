//! Bytes to frames, through noise.

use super::crc::SeedTracker;
use super::frame::{Command, Reply};

/// A frame with a good CRC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Frame {
    /// The master asked.
    Command(Command),
    /// A motor answered.
    Reply(Reply),
}

/// What went through a [`Decoder`]. Every byte that it took is in a good frame or in `skipped_bytes`:
/// taken = 17 × `commands` + 16 × `replies` + `skipped_bytes`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DecoderCounters {
    /// Good commands.
    pub commands: u32,
    /// Good replies.
    pub replies: u32,
    /// Headers whose frame had a bad CRC and ran its whole length.
    pub bad_crc: u32,
    /// Headers whose frame had a bad CRC and was cut short by the header of another.
    pub short: u32,
    /// Bytes that are in no good frame.
    pub skipped_bytes: u32,
}

/// Finds the good frames in a stream of bytes.
///
/// After a bad CRC the search goes on at the byte after the false header, so a header that noise made, or a truncated
/// frame, hides no good frame behind it. Commands share one seed, since they have one sender; each motor has its own.
#[derive(Clone, Debug)]
pub struct Decoder {
    command_seed: SeedTracker<{ Command::LEN - 2 }>,
    reply_seeds: [SeedTracker<{ Reply::LEN - 2 }>; IDS],
    counters: DecoderCounters,
}

/// Ids that the mode byte can carry.
const IDS: usize = 16;

/// What a bad CRC costs beside a byte that opens nothing, in bytes of good frames: its bytes are looked at again.
const BAD_FRAME: usize = 48;

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder that has seen nothing and knows no seed.
    pub const fn new() -> Self {
        Self {
            command_seed: SeedTracker::new(),
            reply_seeds: [SeedTracker::new(); IDS],
            counters: DecoderCounters {
                commands: 0,
                replies: 0,
                bad_crc: 0,
                short: 0,
                skipped_bytes: 0,
            },
        }
    }

    /// What went through so far; counts wrap.
    pub fn counters(&self) -> DecoderCounters {
        self.counters
    }

    /// The seed of the commands, once one was good.
    pub fn command_seed(&self) -> Option<u16> {
        self.command_seed.seed()
    }

    /// The seed of motor `id`'s replies (its low four bits), once one was good.
    pub fn reply_seed(&self, id: u8) -> Option<u16> {
        self.reply_seeds
            .get(usize::from(id & 0x0F))
            .and_then(SeedTracker::seed)
    }

    /// Takes bytes off the front of `bytes` until they complete a frame. `None` where they do not: what may still become a
    /// frame stays in `bytes`, 17 at most, and is to be given again with the bytes that follow it.
    ///
    /// `effort` bounds the work: each byte of a frame or of noise takes one off it, a false header some more, and `None`
    /// comes too where nothing is left of it.
    #[inline]
    pub fn next(&mut self, bytes: &mut &[u8], effort: &mut usize) -> Option<Frame> {
        while *effort > 0 {
            // Frames of a known seed, one after the other, are nearly all that a bus carries: a short way for them.
            let (frame, length) = match self.usual(bytes) {
                Some(Frame::Command(command)) => (Frame::Command(command), Command::LEN),
                Some(Frame::Reply(reply)) => (Frame::Reply(reply), Reply::LEN),
                None => match self.judge(bytes, effort)? {
                    Some((frame, length)) => (frame, length),
                    None => continue,
                },
            };
            *bytes = bytes.get(length..).unwrap_or_default();
            *effort = effort.saturating_sub(length);
            return Some(frame);
        }
        None
    }

    /// The frame at the front of `seen`, if its sender's seed is known and fits.
    #[inline]
    fn usual(&mut self, seen: &[u8]) -> Option<Frame> {
        if let Some(frame) = seen.first_chunk::<{ Command::LEN }>()
            && header(frame) == u16::from_le_bytes(Command::HEADER)
        {
            let [body @ .., low, high] = frame;
            if self
                .command_seed
                .fits(body, u16::from_le_bytes([*low, *high]))
            {
                self.counters.commands = self.counters.commands.wrapping_add(1);
                return Some(Frame::Command(Command::parse(frame)));
            }
        } else if let Some(frame) = seen.first_chunk::<{ Reply::LEN }>()
            && header(frame) == u16::from_le_bytes(Reply::HEADER)
        {
            let [body @ .., low, high] = frame;
            let reply = Reply::parse(frame);
            let seed = self.reply_seeds.get_mut(usize::from(reply.mode.id()))?;
            if seed.fits(body, u16::from_le_bytes([*low, *high])) {
                self.counters.replies = self.counters.replies.wrapping_add(1);
                return Some(Frame::Reply(reply));
            }
        }
        None
    }

    /// Judges bytes that begin with no frame of a known seed: a frame and its length where they begin with one after all,
    /// nothing where some were skipped, `None` where more are needed.
    #[inline(never)]
    fn judge(&mut self, bytes: &mut &[u8], effort: &mut usize) -> Option<Option<(Frame, usize)>> {
        let seen = *bytes;
        let (skipped, cost) = match seen {
            [] | [0xFE | 0xFD] => return None,
            [0xFE, 0xEE, ..] => {
                let frame = seen.first_chunk::<{ Command::LEN }>()?;
                let [body @ .., low, high] = frame;
                if self
                    .command_seed
                    .accept(body, u16::from_le_bytes([*low, *high]))
                {
                    self.counters.commands = self.counters.commands.wrapping_add(1);
                    return Some(Some((Frame::Command(Command::parse(frame)), Command::LEN)));
                }
                self.refuse(seen, Command::LEN)?;
                (1, BAD_FRAME)
            }
            [0xFD, 0xEE, ..] => {
                let frame = seen.first_chunk::<{ Reply::LEN }>()?;
                let [body @ .., low, high] = frame;
                let reply = Reply::parse(frame);
                let seed = self.reply_seeds.get_mut(usize::from(reply.mode.id()))?;
                if seed.accept(body, u16::from_le_bytes([*low, *high])) {
                    self.counters.replies = self.counters.replies.wrapping_add(1);
                    return Some(Some((Frame::Reply(reply), Reply::LEN)));
                }
                self.refuse(seen, Reply::LEN)?;
                (1, BAD_FRAME)
            }
            _ => {
                let bytes = noise(seen, *effort);
                (bytes, bytes)
            }
        };
        *bytes = seen.get(skipped..).unwrap_or_default();
        *effort = effort.saturating_sub(cost);
        self.counters.skipped_bytes = self.counters.skipped_bytes.wrapping_add(skipped as u32);
        Some(None)
    }

    /// Counts a frame of `length` bytes with a bad CRC. Its last byte may open the header that cut it short, which only the
    /// next byte tells: `None` until then.
    fn refuse(&mut self, seen: &[u8], length: usize) -> Option<()> {
        let examined = seen.get(..=length).unwrap_or(seen);
        if examined.len() == length && matches!(seen.last(), Some(0xFE | 0xFD)) {
            return None;
        }
        let cut = examined
            .windows(2)
            .skip(2)
            .any(|pair| matches!(pair, [0xFE | 0xFD, 0xEE]));
        let counter = if cut {
            &mut self.counters.short
        } else {
            &mut self.counters.bad_crc
        };
        *counter = counter.wrapping_add(1);
        Some(())
    }
}

/// The first two bytes as one number: a comparison of slices would be a library's.
#[inline(always)]
fn header<const N: usize>(frame: &[u8; N]) -> u16 {
    const { assert!(N >= 2) }
    u16::from_le_bytes([frame[0], frame[1]])
}

/// Bytes before the next that may open a header, `most` at most; the first opens none.
fn noise(seen: &[u8], most: usize) -> usize {
    let seen = seen.get(..most).unwrap_or(seen);
    let opens = seen.iter().skip(1).position(|b| matches!(b, 0xFE | 0xFD));
    opens.map_or(seen.len(), |n| n + 1)
}
