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

/// What went through a [`Decoder`]. Every byte pushed is in a good frame, in `skipped_bytes`, or still pending:
/// pushed = 17 × `commands` + 16 × `replies` + `skipped_bytes` + [`Decoder::pending`].
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
/// frame, hides no good frame behind it. No frame of either kind fits inside the tail of another, so a byte completes at
/// most one frame. Work per byte is bounded: at most one pass over 18 bytes.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: [u8; CAPACITY],
    len: usize,
    command_seed: SeedTracker,
    reply_seed: SeedTracker,
    counters: DecoderCounters,
}

/// The longest frame, and one byte to see whether its last byte opens another.
const CAPACITY: usize = Command::LEN + 1;

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder that has seen nothing and knows no seed.
    pub const fn new() -> Self {
        Self {
            buffer: [0; CAPACITY],
            len: 0,
            command_seed: SeedTracker::new(Command::LEN - 2),
            reply_seed: SeedTracker::new(Reply::LEN - 2),
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

    /// Bytes that may still become part of a frame.
    pub fn pending(&self) -> usize {
        self.len
    }

    /// The seed of the commands, once one was good.
    pub fn command_seed(&self) -> Option<u16> {
        self.command_seed.seed()
    }

    /// The seed of the replies, once one was good.
    pub fn reply_seed(&self) -> Option<u16> {
        self.reply_seed.seed()
    }

    /// Takes bytes off the front of `bytes` until they complete a frame, or all of them.
    ///
    /// Gives what [`Self::push`] would give byte by byte; undisturbed frames are read where they lie, at a seventh of the cost.
    pub fn next(&mut self, bytes: &mut &[u8]) -> Option<Frame> {
        loop {
            if self.len == 0
                && let Some(frame) = self.whole(bytes)
            {
                return Some(frame);
            }
            let (&byte, rest) = bytes.split_first()?;
            *bytes = rest;
            if let Some(frame) = self.push(byte) {
                return Some(frame);
            }
        }
    }

    /// A frame that lies whole at the front of `bytes` and has the seed in use.
    fn whole(&mut self, bytes: &mut &[u8]) -> Option<Frame> {
        if let Some((frame, rest)) = bytes.split_first_chunk::<{ Command::LEN }>()
            && frame.starts_with(&Command::HEADER)
        {
            let [body @ .., low, high] = frame;
            if self
                .command_seed
                .fits(body, u16::from_le_bytes([*low, *high]))
            {
                *bytes = rest;
                self.counters.commands = self.counters.commands.wrapping_add(1);
                return Some(Frame::Command(Command::parse(frame)));
            }
        } else if let Some((frame, rest)) = bytes.split_first_chunk::<{ Reply::LEN }>()
            && frame.starts_with(&Reply::HEADER)
        {
            let [body @ .., low, high] = frame;
            if self
                .reply_seed
                .fits(body, u16::from_le_bytes([*low, *high]))
            {
                *bytes = rest;
                self.counters.replies = self.counters.replies.wrapping_add(1);
                return Some(Frame::Reply(Reply::parse(frame)));
            }
        }
        None
    }

    /// Takes one byte; gives the frame that it completes.
    pub fn push(&mut self, byte: u8) -> Option<Frame> {
        if let Some(slot) = self.buffer.get_mut(self.len) {
            *slot = byte;
            self.len += 1;
        }
        while self.len > 0 {
            match self.examine() {
                Verdict::Wait => return None,
                Verdict::Good(frame) => {
                    self.len = 0;
                    return Some(frame);
                }
                Verdict::Skip => self.skip(),
            }
        }
        None
    }

    fn seen(&self) -> &[u8] {
        self.buffer.get(..self.len).unwrap_or_default()
    }

    /// Judges what the buffer begins with.
    fn examine(&mut self) -> Verdict {
        match self.seen() {
            [0xFE | 0xFD] => Verdict::Wait,
            [0xFE, 0xEE, ..] => self.examine_command(),
            [0xFD, 0xEE, ..] => self.examine_reply(),
            _ => Verdict::Skip,
        }
    }

    fn examine_command(&mut self) -> Verdict {
        let Some(bytes) = self.buffer.first_chunk::<{ Command::LEN }>() else {
            return Verdict::Skip;
        };
        if self.len < Command::LEN {
            return Verdict::Wait;
        }
        let [body @ .., low, high] = bytes;
        // A frame that waits for the byte after it has been judged before.
        if self.len == Command::LEN
            && self
                .command_seed
                .accept(body, u16::from_le_bytes([*low, *high]))
        {
            self.counters.commands = self.counters.commands.wrapping_add(1);
            return Verdict::Good(Frame::Command(Command::parse(bytes)));
        }
        self.refuse(Command::LEN)
    }

    fn examine_reply(&mut self) -> Verdict {
        let Some(bytes) = self.buffer.first_chunk::<{ Reply::LEN }>() else {
            return Verdict::Skip;
        };
        if self.len < Reply::LEN {
            return Verdict::Wait;
        }
        let [body @ .., low, high] = bytes;
        if self.len == Reply::LEN
            && self
                .reply_seed
                .accept(body, u16::from_le_bytes([*low, *high]))
        {
            self.counters.replies = self.counters.replies.wrapping_add(1);
            return Verdict::Good(Frame::Reply(Reply::parse(bytes)));
        }
        self.refuse(Reply::LEN)
    }

    /// Counts a frame of `length` bytes with a bad CRC. Its last byte may open the header that cut it short, which only
    /// the next byte tells.
    fn refuse(&mut self, length: usize) -> Verdict {
        let seen = self.seen();
        let opens_header = matches!(seen.last(), Some(0xFE | 0xFD));
        if self.len == length && opens_header {
            return Verdict::Wait;
        }
        let cut = seen
            .windows(2)
            .skip(2)
            .any(|pair| matches!(pair, [0xFE | 0xFD, 0xEE]));
        let counter = if cut {
            &mut self.counters.short
        } else {
            &mut self.counters.bad_crc
        };
        *counter = counter.wrapping_add(1);
        Verdict::Skip
    }

    /// Drops the first byte.
    fn skip(&mut self) {
        self.buffer.copy_within(1.., 0);
        self.len = self.len.saturating_sub(1);
        self.counters.skipped_bytes = self.counters.skipped_bytes.wrapping_add(1);
    }
}

enum Verdict {
    /// More bytes are needed.
    Wait,
    /// A good frame is the whole buffer.
    Good(Frame),
    /// The first byte begins no good frame.
    Skip,
}
