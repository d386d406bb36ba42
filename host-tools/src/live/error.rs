//! Why nothing can be received.

use proprio_core::go2::Leg;

use crate::device::DeviceError;

/// Why nothing can be received.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// This build has no DDS.
    #[error("this build of proprio receives nothing over DDS")]
    NotBuilt,
    /// Standard input is the terminal.
    #[error("-: nothing is piped into the command")]
    Terminal,
    /// An adapter's port cannot be opened.
    #[error(transparent)]
    Port(#[from] DeviceError),
    /// A motor counts from its power-up on, and where its joint was nobody said.
    #[error("the bus of {} gives how far its motors turn, but not from which angle", .leg.name())]
    NoZeros {
        /// The leg.
        leg: Leg,
    },
    /// No thread can be started.
    #[error("cannot start to receive: {0}")]
    Thread(#[source] std::io::Error),
    /// No interface is called so.
    #[error("no network interface is called {asked}; there are {}", list(.known))]
    NoInterface {
        /// What was asked for.
        asked: String,
        /// Those that have an IPv4 address, with it.
        known: Vec<String>,
    },
    /// Which interface is meant is open.
    #[error("which network interface leads to the robot? there are {}", list(.known))]
    WhichInterface {
        /// Those that have an IPv4 address, with it.
        known: Vec<String>,
    },
    /// Nobody writes such a topic.
    #[error("domain {domain} on {interface}: nobody sends joint states{} within {seconds} s; there are {}", topic(.asked), list(.seen))]
    NoWriter {
        /// The domain.
        domain: u16,
        /// The interface.
        interface: String,
        /// The topic that was asked for.
        asked: Option<String>,
        /// How long was waited, s.
        seconds: u64,
        /// Topics that are written there, with their types.
        seen: Vec<String>,
    },
    /// What DDS says.
    #[error("DDS on {interface}: {problem}")]
    Dds {
        /// The interface.
        interface: String,
        /// What is wrong.
        problem: String,
    },
}

fn list(names: &[String]) -> String {
    match names {
        [] => "none".to_owned(),
        names => names.join(", "),
    }
}

fn topic(asked: &Option<String>) -> String {
    let named = asked.as_ref().map(|name| format!(" on topic {name}"));
    named.unwrap_or_default()
}
