//! Which of the messages of several writers are one robot's, each once.

use serde::Serialize;

/// A writer that has been silent for so long, ns, is gone: another one is followed then.
const SILENT_NS: i64 = 1_000_000_000;

/// Writers whose names are remembered, for the count of them.
const WRITERS: usize = 64;

/// What became of the messages of a topic.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Messages, or rows, that were passed on.
    pub messages: u64,
    /// Messages that never came, by their numbers.
    pub lost: u64,
    /// Messages that came again, or after a later one.
    pub repeated: u64,
    /// Messages of a writer beside the one that is followed.
    pub other_writers: u64,
    /// Messages of writers that give the topic another type.
    pub wrong_type: u64,
    /// Messages that are not of their type's length, or in another encoding.
    pub unreadable: u64,
    /// Messages that came faster than they were taken.
    pub overrun: u64,
    /// Writers of the topic, of the right type.
    pub writers: u64,
    /// Writers that give the topic another type. Most of them send a reader of this type nothing.
    pub other_type_writers: u64,
    /// How often another writer was followed since the one before was silent.
    pub restarts: u64,
    /// Silences that are gaps at the messages' rate, as [`crate::log::Periods`] has it.
    pub gaps: u64,
    /// The longest silence, s.
    pub longest_silence: f64,
}

/// A message before it is looked at.
#[derive(Debug, Clone, Copy)]
pub struct Arrival<W> {
    /// Whose it is.
    pub writer: W,
    /// The writer's number of it.
    pub sequence: i64,
    /// When it came, ns.
    pub received_ns: i64,
    /// Whether its writer gives the topic the type that is read.
    pub right_type: bool,
    /// Whether its bytes can be read.
    pub readable: bool,
}

/// Follows one writer at a time.
///
/// A robot has one. A second one at the same time, as a replayed recording beside the robot, would mix two motions; a new one after a
/// silence is the first that was started again.
#[derive(Debug, Clone)]
pub struct Follower<W> {
    followed: Option<Followed<W>>,
    seen: Vec<W>,
}

#[derive(Debug, Clone, Copy)]
struct Followed<W> {
    writer: W,
    sequence: i64,
    received_ns: i64,
}

impl<W> Default for Follower<W> {
    fn default() -> Self {
        Self {
            followed: None,
            seen: Vec::new(),
        }
    }
}

impl<W: Copy + PartialEq> Follower<W> {
    /// Whether a message is to be passed on; what became of it is counted.
    pub fn take(&mut self, arrival: Arrival<W>, tally: &mut Tally) -> bool {
        let Arrival {
            writer,
            sequence,
            received_ns,
            ..
        } = arrival;
        if !arrival.right_type {
            tally.wrong_type += 1;
            return false;
        }
        if !self.seen.contains(&writer) && self.seen.len() < WRITERS {
            self.seen.push(writer);
            tally.writers += 1;
        }
        match self.followed {
            Some(followed) if followed.writer == writer => {
                if sequence <= followed.sequence {
                    tally.repeated += 1;
                    return false;
                }
                tally.lost += (sequence - followed.sequence - 1).unsigned_abs();
            }
            Some(followed) if received_ns - followed.received_ns < SILENT_NS => {
                tally.other_writers += 1;
                return false;
            }
            Some(_) => tally.restarts += 1,
            None => {}
        }
        self.followed = Some(Followed {
            writer,
            sequence,
            received_ns,
        });
        match arrival.readable {
            true => tally.messages += 1,
            false => tally.unreadable += 1,
        }
        arrival.readable
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrival(writer: u8, sequence: i64, ms: i64) -> Arrival<u8> {
        Arrival {
            writer,
            sequence,
            received_ns: ms * 1_000_000,
            right_type: true,
            readable: true,
        }
    }

    /// What each kind of message counts as, and whether it is passed on.
    #[test]
    fn each_message_of_one_writer_is_passed_on_once() {
        let mut tally = Tally::default();
        let mut follower = Follower::default();
        let mut take = |arrival| follower.take(arrival, &mut tally);
        assert!(take(arrival(1, 7, 0)));
        assert!(take(arrival(1, 8, 2)));
        assert!(!take(arrival(1, 8, 3)));
        assert!(take(arrival(1, 11, 8)));
        assert!(!take(arrival(2, 1, 9)));
        assert!(!take(Arrival {
            right_type: false,
            ..arrival(3, 1, 9)
        }));
        assert!(!take(Arrival {
            readable: false,
            ..arrival(1, 12, 10)
        }));
        // The followed one is gone: the other one's next message counts.
        assert!(!take(arrival(2, 2, 900)));
        assert!(take(arrival(2, 3, 1010)));
        assert!(!take(arrival(1, 13, 1011)));
        let expected = Tally {
            messages: 4,
            lost: 2,
            repeated: 1,
            other_writers: 3,
            wrong_type: 1,
            unreadable: 1,
            overrun: 0,
            writers: 2,
            restarts: 1,
            ..Tally::default()
        };
        assert_eq!(tally, expected);
    }
}
