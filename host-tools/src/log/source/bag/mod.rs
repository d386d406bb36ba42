//! Recordings of messages: which topic holds the joints' states, what its messages say, and when.
//!
//! Files beside:
//!
//! - `joint_state`: `sensor_msgs/msg/JointState`: names, and beside them positions, velocities and efforts, each of any length
//! - `low_state`: Unitree's `LowState`: arrays of fixed length only, so that every number has its place
//! - `mcap`: messages of an MCAP file, read from front to back in constant memory; a file that was cut short gives all its whole messages
//! - `sqlite`: messages of a rosbag2's SQLite database, in the order in which they were written

mod joint_state;
mod low_state;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "db3")]
mod sqlite;

use std::collections::VecDeque;
use std::path::Path;

use super::input::Input;
use super::{Fault, Source, Wanted};
use crate::log::error::{LogError, Problem, Unit};
use crate::log::warning::Warning;
#[cfg(feature = "mcap")]
use crate::log::{LiveMessage, LiveMessages};
use joint_state::JointStates;
use low_state::LowState;

/// So many messages are looked at before the first is given: their joints, and whether their clock can be trusted.
const LOOK_AHEAD: usize = 100;

/// A sender's clock that goes back by more, ns, has begun anew: messages overtake each other by milliseconds.
const RESTART_NS: i64 = 1_000_000_000;

/// A topic of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Topic {
    /// The recording's number for it.
    id: u64,
    name: String,
    /// The type of its messages, `package/msg/Type`.
    kind: String,
    /// Number of messages, if known.
    count: Option<u64>,
}

/// A message as recorded.
#[derive(Debug, Clone, Default)]
struct Message {
    /// When it was received, ns.
    time: i64,
    /// When it was sent, ns of the sender's clock, where that is known apart from what the message says.
    sent: Option<i64>,
    /// Encapsulation header and CDR.
    data: Vec<u8>,
}

/// Messages of one topic of a recording.
trait Messages {
    /// The next one, into `message`; false at the end.
    fn next(&mut self, message: &mut Message) -> Result<bool, Problem>;

    /// Bytes (or messages) read so far, and in all.
    fn progress(&self) -> (u64, u64);

    /// Whether the recording ends before its end.
    fn is_cut(&self) -> bool;
}

/// What a message says: cells of numbers.
trait Decoder {
    /// Names of the cells, without the time's.
    fn names(&self) -> Vec<String>;

    /// Takes a message up; false if it is not one of those that are read.
    fn take(&mut self, data: &[u8]) -> Result<bool, Problem>;

    /// When the message taken up was made, ns of the sender's clock; zero if it does not say.
    fn stamp(&self, data: &[u8]) -> i64;

    /// A cell of the message taken up.
    fn cell(&self, data: &[u8], cell: usize) -> f64;
}

/// Opens an MCAP file.
#[cfg(feature = "mcap")]
pub(super) fn mcap(path: &Path, input: Input) -> Result<Box<dyn Source>, LogError> {
    let mut recording = mcap::Recording::new(input);
    let topics = recording.topics().map_err(|p| LogError::new(path, p))?;
    let topic = choose(&topics).map_err(|p| LogError::new(path, p))?;
    let others = others(&topics, &topic);
    open(path, &topic, Box::new(recording.messages(topic.id)), others)
}

/// Opens the database of a rosbag2.
#[cfg(feature = "db3")]
pub(super) fn sqlite(path: &Path, input: Input) -> Result<Box<dyn Source>, LogError> {
    let failed = |p| LogError::new(path, p);
    let recording = sqlite::Recording::open(path, input).map_err(failed)?;
    let topics = recording.topics().map_err(failed)?;
    let topic = choose(&topics).map_err(failed)?;
    let others = others(&topics, &topic);
    open(path, &topic, Box::new(recording.messages(&topic)), others)
}

/// Messages that come while they are read.
#[cfg(feature = "mcap")]
struct Live {
    messages: Box<dyn LiveMessages>,
    read: u64,
}

#[cfg(feature = "mcap")]
impl Messages for Live {
    fn next(&mut self, message: &mut Message) -> Result<bool, Problem> {
        let Some(LiveMessage {
            received_ns,
            sent_ns,
            data,
        }) = self.messages.next()
        else {
            return Ok(false);
        };
        *message = Message {
            time: received_ns,
            sent: sent_ns,
            data,
        };
        self.read += 1;
        Ok(true)
    }

    fn progress(&self) -> (u64, u64) {
        (self.read, 0)
    }

    fn is_cut(&self) -> bool {
        false
    }
}

/// Follows messages of a type of [`KINDS`] as they come on a topic.
#[cfg(feature = "mcap")]
pub(super) fn live(
    path: &Path,
    name: String,
    kind: &str,
    messages: Box<dyn LiveMessages>,
) -> Result<Box<dyn Source>, LogError> {
    let topic = Topic {
        id: 0,
        name,
        kind: kind.to_owned(),
        count: None,
    };
    let messages = Live { messages, read: 0 };
    open(path, &topic, Box::new(messages), Vec::new())
}

/// Whether bytes can be a message of this type: those of fixed length have it.
#[cfg(feature = "mcap")]
pub(in crate::log) fn can_be(kind: &str, data: &[u8]) -> bool {
    if check_encapsulation(data).is_err() {
        return false;
    }
    match kind {
        "unitree_go/msg/LowState" => LowState::go().take(data).unwrap_or(false),
        "unitree_hg/msg/LowState" => LowState::hg().take(data).unwrap_or(false),
        _ => JointStates::is_whole(data),
    }
}

/// Types that are read.
pub(in crate::log) const KINDS: [&str; 3] = [
    "unitree_go/msg/LowState",
    "unitree_hg/msg/LowState",
    "sensor_msgs/msg/JointState",
];

/// The topic of joint states that has the most messages: a robot's own rate, not a thinned copy of it.
fn choose(topics: &[Topic]) -> Result<Topic, Problem> {
    let known = topics.iter().filter(|topic| KINDS.contains(&&*topic.kind));
    // Of several as long the first, in the order of the recording.
    let best = known.rev().max_by_key(|topic| topic.count);
    best.cloned().ok_or_else(|| Problem::NoTopic {
        topics: topics
            .iter()
            .map(|t| format!("{} ({})", t.name, t.kind))
            .collect(),
    })
}

/// The other topics of joint states, which are not read.
fn others(topics: &[Topic], chosen: &Topic) -> Vec<String> {
    let known = topics.iter().filter(|topic| KINDS.contains(&&*topic.kind));
    known
        .filter(|topic| *topic != chosen)
        .map(|topic| topic.name.clone())
        .collect()
}

/// Looks at the first messages of a topic.
fn open(
    path: &Path,
    topic: &Topic,
    mut messages: Box<dyn Messages>,
    others: Vec<String>,
) -> Result<Box<dyn Source>, LogError> {
    let mut first = VecDeque::new();
    while first.len() < LOOK_AHEAD {
        let mut message = Message::default();
        let number = first.len() as u64 + 1;
        let fault = |p| Fault::new(number, p).error(path, Unit::Message, &[]);
        if !messages.next(&mut message).map_err(fault)? {
            break;
        }
        check_encapsulation(&message.data).map_err(fault)?;
        first.push_back(message);
    }
    if first.is_empty() {
        let topic = topic.name.clone();
        return Err(LogError::new(path, Problem::NoMessages { topic }));
    }
    let decoder: Box<dyn Decoder> = match &*topic.kind {
        "unitree_go/msg/LowState" => Box::new(LowState::go()),
        "unitree_hg/msg/LowState" => Box::new(LowState::hg()),
        _ => Box::new(JointStates::of(&first).map_err(|p| LogError::new(path, p))?),
    };
    let mut bag = Bag {
        names: [vec!["t".to_owned()], decoder.names()].concat(),
        topic: topic.name.clone(),
        others,
        messages,
        decoder,
        ahead: first,
        message: Message::default(),
        number: 0,
        taken: 0,
        clock: Clock::Receiver,
        origin: 0,
        before: None,
    };
    bag.set_clock()
        .map_err(|fault| fault.error(path, Unit::Message, &[]))?;
    Ok(Box::new(bag))
}

/// Whose clock says when a sample was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Clock {
    /// That which the message carries: no transport's jitter is in it.
    Sender,
    /// That of the recorder.
    Receiver,
}

/// Messages of a topic as rows.
struct Bag {
    topic: String,
    /// Topics that could have been read too.
    others: Vec<String>,
    names: Vec<String>,
    messages: Box<dyn Messages>,
    decoder: Box<dyn Decoder>,
    /// Messages read but not given.
    ahead: VecDeque<Message>,
    message: Message,
    /// Messages read of the topic.
    number: u64,
    /// Those that were given.
    taken: u64,
    clock: Clock,
    /// When the first message was made, ns.
    origin: i64,
    /// When the message before was made and received, ns.
    before: Option<(i64, i64)>,
}

impl Bag {
    /// The sender's clock where it runs, and as fast as the recorder's; else the recorder's.
    fn set_clock(&mut self) -> Result<(), Fault> {
        let mut times = Vec::new();
        for (n, message) in self.ahead.iter().enumerate() {
            let fault = |p| Fault::new(n as u64 + 1, p);
            if self.decoder.take(&message.data).map_err(fault)? {
                // When it was sent, if that is known: a receiver that was busy takes many messages at once.
                let passed_on = message.sent.unwrap_or(message.time);
                times.push((self.decoder.stamp(&message.data), passed_on));
            }
        }
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Ok(());
        };
        let sent = last.0.saturating_sub(first.0) as f64;
        let received = last.1.saturating_sub(first.1) as f64;
        let runs = times.windows(2).all(|pair| pair[0].0 <= pair[1].0) && sent > 0.0;
        // Crystals differ by far less; a counter of other units, by far more.
        let agrees = received == 0.0 || (0.8..1.25).contains(&(sent / received));
        self.clock = if runs && agrees {
            Clock::Sender
        } else {
            Clock::Receiver
        };
        let received = self.ahead.front().map_or(0, |message| message.time);
        self.origin = match self.clock {
            Clock::Sender => first.0,
            Clock::Receiver => received,
        };
        Ok(())
    }

    /// Where the sender's clock begins anew, as that of a robot that is switched on again does, time goes on by the recorder's.
    fn follow_restart(&mut self) {
        if self.clock == Clock::Receiver {
            return;
        }
        let now = (self.decoder.stamp(&self.message.data), self.message.time);
        if let Some(before) = self.before.replace(now) {
            let sent = now.0.saturating_sub(before.0);
            let received = now.1.saturating_sub(before.1);
            if sent < -RESTART_NS && received > 0 {
                self.origin = self.origin.saturating_add(sent.saturating_sub(received));
            }
        }
    }

    fn time(&self) -> f64 {
        let now = match self.clock {
            Clock::Sender => self.decoder.stamp(&self.message.data),
            Clock::Receiver => self.message.time,
        };
        now.saturating_sub(self.origin) as f64 / 1e9
    }
}

impl Source for Bag {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn unit(&self) -> Unit {
        Unit::Message
    }

    fn next(&mut self, wanted: &[Wanted], values: &mut [f64]) -> Result<Option<u64>, Fault> {
        loop {
            let number = self.number + 1;
            let fault = |p| Fault::new(number, p);
            match self.ahead.pop_front() {
                Some(message) => self.message = message,
                None => {
                    if !self.messages.next(&mut self.message).map_err(fault)? {
                        return Ok(None);
                    }
                    check_encapsulation(&self.message.data).map_err(fault)?;
                }
            }
            self.number = number;
            if !self.decoder.take(&self.message.data).map_err(fault)? {
                continue;
            }
            self.follow_restart();
            let mut whole = true;
            for w in wanted {
                let value = match w.cell {
                    0 => self.time(),
                    cell => self.decoder.cell(&self.message.data, cell - 1),
                };
                // A cell that this message does not have: it is another node's.
                whole &= !value.is_nan() || w.empty == super::Empty::Nan;
                values[w.slot] = value * w.scale;
            }
            if !whole {
                continue;
            }
            let infinite = wanted.iter().find(|w| values[w.slot].is_infinite());
            if let Some(w) = infinite {
                let problem = Problem::NotFinite(values[w.slot]);
                return Err(Fault::at(number, w.cell, problem));
            }
            self.taken += 1;
            return Ok(Some(number));
        }
    }

    fn progress(&self) -> (u64, u64) {
        self.messages.progress()
    }

    fn origin(&self) -> Option<i64> {
        Some(self.origin)
    }

    fn count_from(&mut self, origin: i64) {
        self.origin = origin;
    }

    fn warnings(&self) -> Vec<Warning> {
        let mut warnings = Vec::new();
        if !self.others.is_empty() {
            warnings.push(Warning::OtherTopics {
                read: self.topic.clone(),
                left: self.others.clone(),
            });
        }
        if self.messages.is_cut() {
            warnings.push(Warning::Cut { last: self.number });
        }
        if self.taken < self.number {
            warnings.push(Warning::Skipped {
                count: self.number - self.taken,
                of: self.number,
            });
        }
        warnings
    }
}

/// Messages are CDR, little-endian, as every ROS 2 on a PC or a robot writes it.
fn check_encapsulation(data: &[u8]) -> Result<(), Problem> {
    match data {
        // Plain CDR of XTypes 1 and 2.
        [0, 1 | 7, _, _, ..] => Ok(()),
        [0, 0 | 6, _, _, ..] => Err(Problem::Encoding("big-endian")),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => Err(Problem::Encoding("compressed one by one")),
        _ => Err(Problem::Encoding("not in plain CDR")),
    }
}
