//! Senders whose frames are whole and fail only by their checksum: another firmware's. Damage on the line breaks headers, ids and lengths as well.

use proprio_core::bus::crc::checksum;
use proprio_core::bus::{Command, Reply};

/// Ids that a frame can carry.
const IDS: usize = 16;
/// Commands to a motor from which on its replies are judged: at 100 the least share of whole ones is known to ± 2 %.
const LEAST: u32 = 100;
/// Least share of whole frames where the line is good. Damage that spoils half of the replies, one bit in each, breaks the header, the id or the
/// length of 9 %.
const WHOLE: f64 = 0.95;
/// Greatest share of good checksums among whole frames of another checksum.
const GOOD: f64 = 0.5;

/// A motor's frames.
#[derive(Default)]
struct Motor {
    /// Whole commands to it, and whole replies of its id right after one.
    asked: u32,
    answered: u32,
    last: Option<[u8; Reply::LEN]>,
    /// Replies other than the one before, and those of them that end as if their end was damaged.
    changed: u32,
    repeated: u32,
}

/// Counts whole frames, whatever their checksum.
#[derive(Default)]
pub(super) struct Checksums {
    motors: [Motor; IDS],
    /// The id that the last frame asked.
    asked: Option<usize>,
    commands: u32,
    bytes: u64,
}

impl Checksums {
    /// Goes on with a whole frame.
    pub(super) fn push(&mut self, frame: &[u8]) {
        self.bytes += frame.len() as u64;
        let Some(mode) = frame.get(2) else { return };
        let id = usize::from(mode & 0x0F);
        let motor = &mut self.motors[id];
        match <&[u8; Reply::LEN]>::try_from(frame) {
            Err(_) => {
                self.commands += 1;
                motor.asked += 1;
                self.asked = Some(id);
            }
            Ok(reply) => {
                motor.answered += u32::from(self.asked.take() == Some(id));
                motor.reply(reply);
            }
        }
    }

    /// The ids of motors whose replies are whole and fail by their checksum, of which `good` says how many do not.
    pub(super) fn of_replies(&self, good: impl Fn(usize) -> u32) -> Vec<u8> {
        let others = self.motors.iter().enumerate().filter(|(id, motor)| {
            motor.asked >= LEAST
                && f64::from(motor.answered) >= WHOLE * f64::from(motor.asked)
                && f64::from(good(*id)) <= GOOD * f64::from(motor.answered)
                // A frame whose end is damaged ends alike each time, and one of another checksum does not.
                && 2 * motor.repeated <= motor.changed
        });
        others.map(|(id, _)| id as u8).collect()
    }

    /// Whole replies of a motor.
    pub(super) fn answered(&self, id: u8) -> u32 {
        self.motors
            .get(usize::from(id))
            .map_or(0, |motor| motor.answered)
    }

    /// Whole commands, if they fail by their checksum: `good` of them do not. Of all `bytes` nearly each is in a whole frame then.
    pub(super) fn of_commands(&self, good: u32, bytes: u64) -> Option<u32> {
        let is_other = self.commands >= LEAST
            && f64::from(good) <= GOOD * f64::from(self.commands)
            && self.bytes as f64 >= WHOLE * bytes as f64;
        is_other.then_some(self.commands)
    }
}

impl Motor {
    fn reply(&mut self, reply: &[u8; Reply::LEN]) {
        if let Some(last) = self.last.replace(*reply) {
            let [body @ .., _, _] = reply;
            let [before @ .., _, _] = &last;
            if body == before {
                return;
            }
            // By what a checksum differs from that of seed 0. Where the last byte is lost the low byte is a seed's and the high one is not.
            let constant = |frame: &[u8; Reply::LEN]| {
                let [body @ .., low, high] = frame;
                (checksum(0, body) ^ u16::from_le_bytes([*low, *high])).to_le_bytes()
            };
            let ([low, high], [low_before, high_before]) = (constant(reply), constant(&last));
            let is_same = reply[body.len()..] == last[before.len()..];
            let repeats = is_same || (low == low_before && high != high_before);
            self.changed += 1;
            self.repeated += u32::from(repeats);
        }
    }
}

const _: () = assert!(
    Command::LEN != Reply::LEN,
    "a frame's length says which it is"
);
