//! Messages of a topic of a DDS domain, over one network interface.
//!
//! Nothing here can write: `domain`, beside, has the participant, and gives nothing but readers; `peers` announces it where multicast does
//! not reach. The reader is best effort unless asked otherwise, so that no writer waits for it. Payloads are kept as they came; [`crate::log`] reads them as it reads those of a bag.

mod domain;
mod peers;

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use domain::{Domain, Reader};
use rustdds::GUID;

use super::Counts;
use super::address::Topic;
use super::error::LiveError;
use super::follow::{Arrival, Follower};
use super::gather::{GATHER, gathered};
use super::network::Network;
use super::until::{LOOK, Until};
use crate::clock::now_ns;
use crate::log::{LiveMessage, LiveMessages, MESSAGE_KINDS, can_be};

/// How long a writer is waited for, s: participants announce themselves every few seconds.
const PATIENCE_S: u64 = 10;
/// How long more, once there is one, so that all are known among which to choose.
const MORE: Duration = Duration::from_millis(500);
/// Time between two looks at who else writes the topic.
const CENSUS: Duration = Duration::from_millis(500);
/// Writers of another type that are remembered, for the count of them.
const OTHERS: usize = 64;
/// How long the receiving thread has at the end, to pass on what came before it.
const LAST: Duration = Duration::from_millis(200);
/// Messages that may wait for who takes them: 16 s of a robot's.
const WAITING: usize = 8192;

/// A topic that is received.
pub struct Subscription {
    /// Its name in the domain.
    pub topic: String,
    /// Its type, as ROS 2 calls it.
    pub kind: &'static str,
    /// Its messages.
    pub messages: Queue,
}

/// Finds a topic of joint states, and receives it until `until` says so.
///
/// # Errors
/// [`LiveError`]: of the interface, the domain, or of a topic that nobody writes.
pub fn subscribe(
    topic: &Topic,
    network: Network,
    until: &Until,
    counts: &Counts,
) -> Result<Subscription, LiveError> {
    let interface = interface(topic.interface.as_deref())?;
    let failed = |problem: String| LiveError::Dds {
        interface: interface.name.clone(),
        problem,
    };
    let joined = Domain::join(&network, interface.address);
    let joined = joined.map_err(|error| failed(error.to_string()))?;
    let found = find(&joined, topic, until).ok_or_else(|| LiveError::NoWriter {
        domain: network.domain,
        interface: interface.name.clone(),
        asked: topic.name.clone(),
        seconds: PATIENCE_S,
        seen: written(&joined),
    })?;
    let reader = joined.read(found.name.clone(), found.type_name.clone());
    let reader = reader.map_err(|error| failed(error.to_string()))?;
    let (send, messages) = sync_channel(WAITING);
    let receiving = Receiving {
        topic: found.name.clone(),
        others: Vec::new(),
        type_name: found.type_name,
        kind: found.kind,
        types: HashMap::new(),
        domain: joined,
        follower: Follower::default(),
        send,
        until: until.clone(),
        counts: counts.clone(),
    };
    let named = thread::Builder::new().name("dds".to_owned());
    named
        .spawn(move || receiving.run(&reader))
        .map_err(LiveError::Thread)?;
    Ok(Subscription {
        topic: found.name,
        kind: found.kind,
        messages: Queue {
            messages,
            first: None,
            until: until.clone(),
            end: None,
        },
    })
}

/// Messages as they were received.
pub struct Queue {
    messages: Receiver<LiveMessage>,
    first: Option<Instant>,
    until: Until,
    /// When it was over, ns since 1970.
    end: Option<i64>,
}

impl LiveMessages for Queue {
    fn next(&mut self) -> Option<LiveMessage> {
        while !self.until.is_over(self.first) {
            match gathered(&self.messages, LOOK) {
                Ok(message) => {
                    self.first.get_or_insert_with(Instant::now);
                    return Some(message);
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return None,
            }
        }
        // What came before the end is counted: a machine that was busy keeps it.
        let end = *self
            .end
            .get_or_insert_with(|| i64::try_from(now_ns()).unwrap_or(i64::MAX));
        let last = self.messages.recv_timeout(LAST).ok();
        last.filter(|message| message.received_ns <= end)
    }
}

/// A network interface that can be received on.
struct Interface {
    name: String,
    address: IpAddr,
}

fn interface(asked: Option<&str>) -> Result<Interface, LiveError> {
    let mut known: Vec<(Interface, bool)> = Vec::new();
    for interface in netdev::get_interfaces() {
        if let Some(address) = interface.ipv4.first().map(|net| net.addr())
            && interface.is_up()
        {
            let loops = interface.is_loopback();
            let name = interface.name.clone();
            let address = IpAddr::V4(address);
            known.push((Interface { name, address }, loops));
        }
    }
    let list = |known: &[(Interface, bool)]| {
        let named = known.iter();
        named
            .map(|(interface, _)| format!("{} ({})", interface.name, interface.address))
            .collect()
    };
    if let Some(asked) = asked {
        let is = |(known, _): &(Interface, bool)| {
            known.name == asked || known.address.to_string() == asked
        };
        return match known.iter().position(is) {
            Some(n) => Ok(known.swap_remove(n).0),
            None => Err(LiveError::NoInterface {
                asked: asked.to_owned(),
                known: list(&known),
            }),
        };
    }
    known.retain(|(_, loops)| !loops);
    match known.len() {
        1 => Ok(known.swap_remove(0).0),
        _ => Err(LiveError::WhichInterface {
            known: list(&known),
        }),
    }
}

/// A topic that somebody writes.
#[derive(Debug, Clone)]
struct Found {
    name: String,
    /// What the domain calls its type: `unitree_go::msg::dds_::LowState_`.
    type_name: String,
    kind: &'static str,
}

/// The type that is read, of the name that ROS 2 gives it in a domain.
fn kind_of(type_name: &str) -> Option<&'static str> {
    let name = type_name.replace("::dds_::", "::").replace("::", "/");
    let name = name.strip_suffix('_').unwrap_or(&name);
    MESSAGE_KINDS.into_iter().find(|kind| *kind == name)
}

/// Waits for a writer of the topic; of several topics the first of [`MESSAGE_KINDS`], and of one type that of the shortest name: a robot's own
/// rate is on `lowstate`, a thinned copy on `lf/lowstate`.
fn find(domain: &Domain, topic: &Topic, until: &Until) -> Option<Found> {
    let begin = Instant::now();
    let mut since: Option<Instant> = None;
    while begin.elapsed() < Duration::from_secs(PATIENCE_S) && !until.is_over(None) {
        let found = domain.writers().filter_map(|announced| {
            let kind = kind_of(&announced.type_name)?;
            topic.is(&announced.topic).then_some(Found {
                name: announced.topic,
                type_name: announced.type_name,
                kind,
            })
        });
        let rank = |found: &Found| {
            let kind = MESSAGE_KINDS.iter().position(|kind| *kind == found.kind);
            (kind, found.name.len(), found.name.clone())
        };
        let best = found.min_by_key(rank);
        if best.is_some() && since.get_or_insert_with(Instant::now).elapsed() >= MORE {
            return best;
        }
        thread::sleep(LOOK);
    }
    None
}

/// Topics that are written in the domain, with their types.
fn written(domain: &Domain) -> Vec<String> {
    let mut seen: Vec<String> = domain
        .writers()
        .map(|announced| format!("{} ({})", announced.topic, announced.type_name))
        .collect();
    seen.sort();
    seen.dedup();
    seen.truncate(20);
    seen
}

/// What the receiving thread has.
struct Receiving {
    topic: String,
    /// Writers that give the topic another type.
    others: Vec<GUID>,
    type_name: String,
    kind: &'static str,
    /// Whether each writer gives the topic this type, as it announced.
    types: HashMap<GUID, bool>,
    domain: Domain,
    follower: Follower<GUID>,
    send: SyncSender<LiveMessage>,
    until: Until,
    counts: Counts,
}

impl Receiving {
    fn run(mut self, reader: &Reader) {
        let mut census: Option<Instant> = None;
        // Looked at before messages are taken: what came before the end is taken, whenever this thread has a processor.
        let mut is_over = false;
        while !is_over {
            is_over = self.until.is_over(None);
            if census.is_none_or(|last| last.elapsed() >= CENSUS) {
                census = Some(Instant::now());
                self.count_other_types();
            }
            // Without it the middleware would be told nothing new.
            reader.drain_read_notifications();
            loop {
                match reader.try_take_one() {
                    Ok(Some(change)) => {
                        let sequence = i64::from(change.sequence_number);
                        let received_ns = nanoseconds(change.receive_instant);
                        let message = LiveMessage {
                            received_ns,
                            sent_ns: change.source_timestamp().map(nanoseconds),
                            data: change.sample.0,
                        };
                        if !self.take(change.writer_guid, sequence, message) {
                            return;
                        }
                    }
                    Ok(None) => break,
                    Err(_) => self.counts.with(|tally| tally.unreadable += 1),
                }
            }
            thread::sleep(GATHER);
        }
    }

    /// Middleware that compares types lets their messages not come this far; so they are counted by their announcements.
    fn count_other_types(&mut self) {
        for announced in self.domain.writers() {
            let is_other = announced.topic == self.topic && announced.type_name != self.type_name;
            let writer = announced.writer;
            if is_other && self.others.len() < OTHERS && !self.others.contains(&writer) {
                self.others.push(writer);
                self.counts.with(|tally| tally.other_type_writers += 1);
            }
        }
    }

    /// Passes a message on; false once nobody takes them any more.
    fn take(&mut self, writer: GUID, sequence: i64, message: LiveMessage) -> bool {
        let arrival = Arrival {
            writer,
            sequence,
            received_ns: message.received_ns,
            right_type: self.has_right_type(writer),
            readable: can_be(self.kind, &message.data),
        };
        let taken = self.counts.with(|tally| self.follower.take(arrival, tally));
        if !taken {
            return true;
        }
        match self.send.try_send(message) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.counts.with(|tally| {
                    tally.messages -= 1;
                    tally.overrun += 1;
                });
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }

    /// A writer whose announcement is not known is believed: its bytes are looked at all the same.
    fn has_right_type(&mut self, writer: GUID) -> bool {
        if let Some(right) = self.types.get(&writer) {
            return *right;
        }
        let mut all = self.domain.writers();
        let Some(announced) = all.find(|announced| announced.writer == writer) else {
            return true;
        };
        let right = announced.type_name == self.type_name;
        self.types.insert(writer, right);
        right
    }
}

/// A time of RTPS, seconds and their 2³²nd parts, in ns.
fn nanoseconds(time: rustdds::Timestamp) -> i64 {
    let ticks = u128::from(time.to_ticks());
    i64::try_from((ticks * 1_000_000_000) >> 32).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_are_known_by_what_ros_calls_them_in_a_domain() {
        let table = [
            ("unitree_go::msg::dds_::LowState_", Some(MESSAGE_KINDS[0])),
            ("unitree_hg::msg::dds_::LowState_", Some(MESSAGE_KINDS[1])),
            (
                "sensor_msgs::msg::dds_::JointState_",
                Some(MESSAGE_KINDS[2]),
            ),
            ("unitree_go::msg::dds_::LowCmd_", None),
            ("LowState_", None),
            ("", None),
        ];
        for (name, kind) in table {
            assert_eq!(kind_of(name), kind, "{name}");
        }
    }
}
