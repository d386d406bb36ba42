//! Bytes to frames, through noise.

use super::crc::SeedTracker;
use super::frame::{Command, Reply};

/// A frame with a good CRC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// The master asked.
    Command(Command),
    /// A motor answered.
    Reply(Reply),
}

/// What went through a [`Decoder`]. Every byte that it took is in a good frame or in `skipped_bytes`:
/// taken = 17 × `commands` + 16 × `replies` + `skipped_bytes`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
const BAD_FRAME: usize = 24;

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
    pub fn next(&mut self, bytes: &mut &[u8], effort: &mut usize) -> Option<Frame> {
        while *effort > 0 {
            let seen = *bytes;
            let (verdict, taken) = match seen {
                [] | [0xFE | 0xFD] => return None,
                [0xFE, 0xEE, ..] => (self.command(seen), Command::LEN),
                [0xFD, 0xEE, ..] => (self.reply(seen), Reply::LEN),
                _ => (Verdict::Noise, noise(seen, *effort)),
            };
            let (taken, cost) = match verdict {
                Verdict::Wait => return None,
                Verdict::Good(_) | Verdict::Noise => (taken, taken),
                Verdict::Bad => (1, BAD_FRAME),
            };
            *bytes = seen.get(taken..).unwrap_or_default();
            *effort = effort.saturating_sub(cost);
            if let Verdict::Good(frame) = verdict {
                return Some(frame);
            }
            self.counters.skipped_bytes = self.counters.skipped_bytes.wrapping_add(taken as u32);
        }
        None
    }

    /// Judges bytes that begin with a command's header.
    fn command(&mut self, seen: &[u8]) -> Verdict {
        let Some(frame) = seen.first_chunk::<{ Command::LEN }>() else {
            return Verdict::Wait;
        };
        let [body @ .., low, high] = frame;
        let received = u16::from_le_bytes([*low, *high]);
        if self.command_seed.accept(body, received) {
            self.counters.commands = self.counters.commands.wrapping_add(1);
            return Verdict::Good(Frame::Command(Command::parse(frame)));
        }
        self.refuse(seen, frame.len())
    }

    /// Judges bytes that begin with a reply's header.
    fn reply(&mut self, seen: &[u8]) -> Verdict {
        let Some(frame) = seen.first_chunk::<{ Reply::LEN }>() else {
            return Verdict::Wait;
        };
        let [body @ .., low, high] = frame;
        let received = u16::from_le_bytes([*low, *high]);
        let reply = Reply::parse(frame);
        let seed = self.reply_seeds.get_mut(usize::from(reply.mode.id()));
        if seed.is_some_and(|seed| seed.accept(body, received)) {
            self.counters.replies = self.counters.replies.wrapping_add(1);
            return Verdict::Good(Frame::Reply(reply));
        }
        self.refuse(seen, frame.len())
    }

    /// Counts a frame of `length` bytes with a bad CRC. Its last byte may open the header that cut it short, which only the
    /// next byte tells.
    fn refuse(&mut self, seen: &[u8], length: usize) -> Verdict {
        let examined = seen.get(..=length).unwrap_or(seen);
        if examined.len() == length && matches!(seen.last(), Some(0xFE | 0xFD)) {
            return Verdict::Wait;
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
        Verdict::Bad
    }
}

/// Bytes before the next that may open a header, `most` at most; the first opens none.
fn noise(seen: &[u8], most: usize) -> usize {
    let seen = seen.get(..most).unwrap_or(seen);
    let opens = seen.iter().skip(1).position(|b| matches!(b, 0xFE | 0xFD));
    opens.map_or(seen.len(), |n| n + 1)
}

enum Verdict {
    /// More bytes are needed.
    Wait,
    /// A good frame begins here.
    Good(Frame),
    /// A header of no good frame.
    Bad,
    /// No header.
    Noise,
}
