//! What a user says of a DDS domain.

use std::net::Ipv4Addr;

use clap::{Args, ValueEnum};

use crate::live::Network;

/// Of the `dds` source. Its interface and topic are in its name.
#[derive(Debug, Args)]
pub(super) struct DdsArguments {
    /// DDS domain
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: u16,
    /// What is asked of writers over DDS: that they send lost messages again (`reliable`), or nothing, so that none waits (`best-effort`). A
    /// best-effort writer sends a reliable reader nothing
    #[arg(long, value_name = "QOS", value_enum, default_value_t)]
    qos: Qos,
    /// Address of a computer that multicast does not reach, behind a router or an access point: participants there receive this one's announcement
    /// from the chosen interface. May be given several times
    #[arg(long = "peer", value_name = "IPV4")]
    peers: Vec<Ipv4Addr>,
}

/// Quality of service that a reader asks for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum Qos {
    #[default]
    BestEffort,
    Reliable,
}

impl DdsArguments {
    /// As what opens a source takes it.
    pub(super) fn network(&self) -> Network {
        Network {
            domain: self.domain,
            is_reliable: self.qos == Qos::Reliable,
            peers: self.peers.clone(),
        }
    }
}
