//! Live sources: what a robot sends now, for the commands that record and watch it.
//!
//! A source gives what [`crate::log`] reads: the messages of a DDS topic, lines of text, or captures of motor buses. It sends nothing itself: of a
//! DDS domain it has a subscriber alone, whose participant announces itself as discovery asks of every participant; of a serial port it only reads.
//!
//! Files beside:
//!
//! - `address`: what a user calls a source: `-`, `sim`, `dds`, `dds:eth0/lowstate`, `FR=/dev/ttyUSB0 FL=/dev/ttyUSB1`
//! - `bus`: motor buses as captures that are still being made: those that adapters listen to, and a simulated robot's
//! - `dds`: messages of a topic of a DDS domain, over one network interface
//! - `error`: why nothing can be received
//! - `follow`: which of the messages of several writers are one robot's, each once
//! - `gather`: how messages are taken from a queue
//! - `network`: which DDS domain is listened to, and what is asked of its writers
//! - `pieces`: bytes that a thread reads, piece by piece
//! - `rest`: where a robot's joints rest
//! - `text`: lines of standard input as they come
//! - `until`: when to end

mod address;
mod bus;
#[cfg(feature = "dds")]
mod dds;
mod error;
mod follow;
mod gather;
mod network;
mod pieces;
mod rest;
mod text;
mod until;

pub use address::{Adapter, Address, Topic};
pub use bus::{BusFacts, LiveCapture, bytes};
#[cfg(feature = "dds")]
pub use dds::{Subscription, subscribe};
pub use error::LiveError;
pub use follow::{Arrival, Follower, Tally};
pub(crate) use gather::gathered;
pub use network::Network;
pub use rest::{REST, RestError, resting_at};
pub use text::lines;
pub use until::Until;

use std::sync::{Arc, Mutex, PoisonError};

use proprio_core::go2::Leg;

#[cfg(feature = "mcap")]
use crate::log::LiveMessages;

/// Whether this build receives messages over DDS: the feature `dds`.
pub const HAS_DDS: bool = cfg!(feature = "dds");

/// What came of a source so far, counted while it comes.
#[derive(Debug, Clone, Default)]
pub struct Counts(Arc<Mutex<Tally>>);

impl Counts {
    /// The counts by now.
    pub fn now(&self) -> Tally {
        self.with(|tally| tally.clone())
    }

    /// Changes them, or looks at them.
    pub fn with<T>(&self, change: impl FnOnce(&mut Tally) -> T) -> T {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// A source that has been opened.
pub enum Source {
    /// Lines of text, the first of which names the columns.
    Text(Box<dyn std::io::Read + Send>),
    /// Captures of a leg's bus each, on one clock.
    Buses(Vec<LiveCapture>),
    /// Messages of a topic.
    #[cfg(feature = "mcap")]
    Messages {
        /// The topic's name.
        topic: String,
        /// Their type, as ROS 2 calls it.
        kind: &'static str,
        /// The messages.
        messages: Box<dyn LiveMessages + Send>,
    },
}

impl Source {
    /// Opens what `address` names, over this network if it is a topic, and with what is known of the buses if it is adapters; what comes is
    /// counted in `counts`, and ends as `until` says.
    ///
    /// # Errors
    /// [`LiveError`].
    pub fn open(
        address: &Address,
        network: Network,
        facts: &BusFacts,
        until: &Until,
        counts: &Counts,
    ) -> Result<Self, LiveError> {
        match address {
            Address::Text => Ok(Self::Text(Box::new(lines(until.clone())?))),
            Address::Adapters(adapters) => Ok(Self::Buses(bus::listen(adapters, facts, until)?)),
            Address::Simulated => Ok(Self::Buses(bus::simulate(Leg::ALL, until)?.into())),
            #[cfg(feature = "dds")]
            Address::Dds(topic) => {
                let subscription = subscribe(topic, network, until, counts)?;
                Ok(Self::Messages {
                    topic: subscription.topic,
                    kind: subscription.kind,
                    messages: Box::new(subscription.messages),
                })
            }
            #[cfg(not(feature = "dds"))]
            Address::Dds(_) => {
                let _ = (network, counts);
                Err(LiveError::NotBuilt)
            }
        }
    }

    /// As what the readers of logs follow.
    pub fn into_input(self) -> crate::log::LiveInput {
        match self {
            Self::Text(text) => crate::log::LiveInput::Text(text),
            Self::Buses(captures) => {
                let captures = captures.into_iter().map(|capture| capture as _);
                crate::log::LiveInput::Buses(captures.collect())
            }
            #[cfg(feature = "mcap")]
            Self::Messages {
                topic,
                kind,
                messages,
            } => crate::log::LiveInput::Messages {
                topic,
                kind,
                messages,
            },
        }
    }
}
