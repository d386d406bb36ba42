//! Recordings of messages: which topic holds the joints' states, what its messages say, and when; and what drives were asked to do meanwhile.
//!
//! Files beside:
//!
//! - `commands`: the command in force at each state
//! - `joint_state`: `sensor_msgs/msg/JointState`: names, and beside them positions, velocities and efforts, each of any length
//! - `low_state`: Unitree's `LowState` and `LowCmd`: arrays of fixed length only, so that every number has its place
//! - `mcap`: messages of an MCAP file, read from front to back in constant memory; a file that was cut short gives all its whole messages
//! - `sqlite`: messages of a rosbag2's SQLite database, in the order in which they were written

mod commands;
mod joint_state;
mod low_state;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "db3")]
mod sqlite;

use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

use super::input::Input;
use super::{Fault, Source, Wanted};
use crate::log::error::{LogError, Problem, Unit};
use crate::log::warning::Warning;
#[cfg(feature = "mcap")]
use crate::log::{LiveMessage, LiveMessages};
use commands::WithCommands;
use joint_state::JointStates;
use low_state::LowLevel;

/// So many messages are looked at before the first is given: their joints, and whether their clock can be trusted.
const LOOK_AHEAD: usize = 100;

/// Where these do not say, so much time is looked at, ns: a sender or a receiver that was busy has caught up within it.
const LOOK_AHEAD_NS: i64 = 2_000_000_000;

/// More messages than are looked at, where time stands still.
const MOST_AHEAD: usize = 1 << 13;

/// Rates of two clocks that count the same unit differ by less: crystals by far less, counters of other units by far more.
const RATE: f64 = 0.2;

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
    /// The recording's number for its topic.
    topic: u64,
    /// Encapsulation header and CDR.
    data: Vec<u8>,
    /// Of a state, what the drives were asked to do then: a message too.
    command: Option<Arc<Vec<u8>>>,
}

/// Topics that are read together.
struct Chosen {
    states: Topic,
    commands: Option<Topic>,
    /// Names of the other topics of states, which are not read.
    others: Vec<String>,
}

impl Chosen {
    /// Their numbers; twice the same where there are no commands.
    fn ids(&self) -> [u64; 2] {
        let commands = self.commands.as_ref().unwrap_or(&self.states);
        [self.states.id, commands.id]
    }
}

/// Messages of a recording's topics.
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
    let chosen = choose(&topics).map_err(|p| LogError::new(path, p))?;
    let messages = recording.messages(chosen.ids());
    open(path, chosen, Box::new(messages))
}

/// Opens the database of a rosbag2.
#[cfg(feature = "db3")]
pub(super) fn sqlite(path: &Path, input: Input) -> Result<Box<dyn Source>, LogError> {
    let failed = |p| LogError::new(path, p);
    let recording = sqlite::Recording::open(path, input).map_err(failed)?;
    let topics = recording.topics().map_err(failed)?;
    let chosen = choose(&topics).map_err(failed)?;
    let messages = recording.messages(chosen.ids());
    open(path, chosen, Box::new(messages))
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
            ..Message::default()
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
    let chosen = Chosen {
        states: Topic {
            id: 0,
            name,
            kind: kind.to_owned(),
            count: None,
        },
        commands: None,
        others: Vec::new(),
    };
    let messages = Live { messages, read: 0 };
    open(path, chosen, Box::new(messages))
}

/// Whether bytes can be a message of this type: those of fixed length have it.
#[cfg(feature = "mcap")]
pub(in crate::log) fn can_be(kind: &str, data: &[u8]) -> bool {
    if check_encapsulation(data).is_err() {
        return false;
    }
    match LowLevel::length(kind) {
        Some(length) => data.len() == length,
        None => JointStates::is_whole(data),
    }
}

/// Types that are read.
pub(in crate::log) const KINDS: [&str; 3] = [
    "unitree_go/msg/LowState",
    "unitree_hg/msg/LowState",
    "sensor_msgs/msg/JointState",
];

/// Types of what drives are asked to do, which are read beside the states of the same package.
const COMMANDS: [&str; 2] = ["unitree_go/msg/LowCmd", "unitree_hg/msg/LowCmd"];

/// The topic of joint states that has the most messages: a robot's own rate, not a thinned copy of it; and that of its commands.
fn choose(topics: &[Topic]) -> Result<Chosen, Problem> {
    // Of several as long the first, in the order of the recording.
    let longest = |is: &dyn Fn(&Topic) -> bool| {
        let some = topics.iter().filter(|topic| is(topic));
        some.rev().max_by_key(|topic| topic.count).cloned()
    };
    let is_state = |topic: &Topic| KINDS.contains(&&*topic.kind);
    let states = longest(&is_state).ok_or_else(|| Problem::NoTopic {
        topics: topics
            .iter()
            .map(|t| format!("{} ({})", t.name, t.kind))
            .collect(),
    })?;
    let package = |topic: &Topic| topic.kind.split('/').next().map(str::to_owned);
    let commands = longest(&|topic| {
        COMMANDS.contains(&&*topic.kind)
            && package(topic) == package(&states)
            && topic.count != Some(0)
    });
    let others = topics.iter().filter(|topic| is_state(topic));
    let others = others.filter(|topic| **topic != states);
    Ok(Chosen {
        others: others.map(|topic| topic.name.clone()).collect(),
        states,
        commands,
    })
}

/// Looks at the first states of a recording.
fn open(
    path: &Path,
    chosen: Chosen,
    mut messages: Box<dyn Messages>,
) -> Result<Box<dyn Source>, LogError> {
    let Chosen {
        states,
        commands,
        others,
    } = chosen;
    let commands = commands.and_then(|topic| Some((topic.id, LowLevel::new(&topic.kind)?)));
    if let Some((id, _)) = &commands {
        messages = Box::new(WithCommands::new(messages, *id));
    }
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
        let topic = states.name;
        return Err(LogError::new(path, Problem::NoMessages { topic }));
    }
    let decoder: Box<dyn Decoder> = match LowLevel::new(&states.kind) {
        Some(decoder) => Box::new(decoder),
        None => Box::new(JointStates::of(&first).map_err(|p| LogError::new(path, p))?),
    };
    let own = [vec!["t".to_owned()], decoder.names()].concat();
    let asked = commands.as_ref().map(|(_, commands)| commands.names());
    let mut bag = Bag {
        own: own.len(),
        names: [own, asked.unwrap_or_default()].concat(),
        topic: states.name,
        others,
        messages,
        decoder,
        commands: commands.map(|(_, commands)| commands),
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
    /// That of the sender's middleware, by which the message left.
    Departure,
    /// That of the recorder.
    Receiver,
}

/// Whether a clock, by its times beside those at which the same messages were passed on, ns, runs, and as fast as that one.
///
/// A message can be passed on late, not early: the least delay of each half is compared, so that a machine that was busy meanwhile does not seem to
/// have another unit (Cristian 1989, as in [`crate::log`]'s `stamps`).
fn keeps_time(times: &[(i64, i64)]) -> bool {
    let (Some(first), Some(last)) = (times.first(), times.last()) else {
        return false;
    };
    let runs = times.is_sorted_by_key(|(made, _)| *made) && first.0 < last.0;
    // A recorder without a clock contradicts none.
    if !runs || first.1 == last.1 {
        return runs;
    }
    let (early, late) = times.split_at(times.len() / 2);
    let delay = |half: &[(i64, i64)]| {
        let delays = half
            .iter()
            .map(|(made, passed)| passed.saturating_sub(*made));
        delays.min().unwrap_or(0)
    };
    let apart = |clock: fn(&(i64, i64)) -> i64| {
        let middle = |half: &[(i64, i64)]| half.get(half.len() / 2).map_or(0, clock);
        middle(late).saturating_sub(middle(early)) as f64
    };
    let drift = delay(late).saturating_sub(delay(early)) as f64;
    drift.abs() < RATE * apart(|(made, _)| *made)
}

/// Messages of a topic as rows.
struct Bag {
    topic: String,
    /// Topics that could have been read too.
    others: Vec<String>,
    names: Vec<String>,
    /// How many of them are the states'; the commands' follow.
    own: usize,
    messages: Box<dyn Messages>,
    decoder: Box<dyn Decoder>,
    commands: Option<LowLevel>,
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
    /// The first clock of [`Clock`] that runs, and as fast as the one after it; the recorder's if none does.
    fn set_clock(&mut self) -> Result<(), Fault> {
        let passed_on = |message: &Message| message.sent.unwrap_or(message.time);
        let mut ends = false;
        loop {
            let mut stamps = Vec::new();
            let mut departures = Vec::new();
            for (n, message) in self.ahead.iter().enumerate() {
                let fault = |p| Fault::new(n as u64 + 1, p);
                if self.decoder.take(&message.data).map_err(fault)? {
                    stamps.push((self.decoder.stamp(&message.data), passed_on(message)));
                    departures.push((passed_on(message), message.time));
                }
            }
            let departs = self.ahead.iter().all(|message| message.sent.is_some());
            let received = self.ahead.front().map_or(0, |message| message.time);
            (self.clock, self.origin) = match (stamps.first(), departures.first()) {
                (Some((made, _)), _) if keeps_time(&stamps) => (Clock::Sender, *made),
                (_, Some((sent, _))) if departs && keeps_time(&departures) => {
                    (Clock::Departure, *sent)
                }
                _ => (Clock::Receiver, received),
            };
            let [first, last] = [self.ahead.front(), self.ahead.back()];
            let seen = first.zip(last);
            let seen_ns = seen.map_or(0, |(a, b)| passed_on(b).saturating_sub(passed_on(a)));
            let is_enough = seen_ns >= LOOK_AHEAD_NS || self.ahead.len() >= MOST_AHEAD;
            if self.clock == Clock::Sender || is_enough || ends {
                return Ok(());
            }
            ends = !self.look_further()?;
        }
    }

    /// Reads as many messages again as are ahead; false where there are no more.
    fn look_further(&mut self) -> Result<bool, Fault> {
        for number in self.ahead.len()..2 * self.ahead.len() {
            let fault = |p| Fault::new(number as u64 + 1, p);
            let mut message = Message::default();
            if !self.messages.next(&mut message).map_err(fault)? {
                return Ok(false);
            }
            check_encapsulation(&message.data).map_err(fault)?;
            self.ahead.push_back(message);
        }
        Ok(true)
    }

    /// When a message was made, ns of the clock that is read.
    fn made(&self, message: &Message) -> i64 {
        match self.clock {
            Clock::Sender => self.decoder.stamp(&message.data),
            Clock::Departure => message.sent.unwrap_or(message.time),
            Clock::Receiver => message.time,
        }
    }

    /// Where the sender's clock begins anew, as that of a robot that is switched on again does, time goes on by the recorder's.
    fn follow_restart(&mut self) {
        let now = (self.made(&self.message), self.message.time);
        if let Some(before) = self.before.replace(now) {
            let sent = now.0.saturating_sub(before.0);
            let received = now.1.saturating_sub(before.1);
            if sent < -RESTART_NS && received > 0 {
                self.origin = self.origin.saturating_add(sent.saturating_sub(received));
            }
        }
    }

    /// A cell of the command in force; not a number before the first command.
    fn asked(&self, cell: usize) -> f64 {
        let command = self.commands.as_ref().zip(self.message.command.as_ref());
        command.map_or(f64::NAN, |(commands, data)| commands.cell(data, cell))
    }

    fn time(&self) -> f64 {
        let made = self.made(&self.message);
        made.saturating_sub(self.origin) as f64 / 1e9
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
            if let (Some(commands), Some(command)) = (&mut self.commands, &self.message.command) {
                commands.take(command).map_err(fault)?;
            }
            let mut whole = true;
            for w in wanted {
                let value = match w.cell {
                    0 => self.time(),
                    cell if cell < self.own => self.decoder.cell(&self.message.data, cell - 1),
                    cell => self.asked(cell - self.own),
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
