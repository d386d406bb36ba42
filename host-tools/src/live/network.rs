//! How a DDS domain is listened to.

use std::net::Ipv4Addr;

/// Which domain is listened to, and what is asked of a topic's writers.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Network {
    /// The domain's number.
    pub domain: u16,
    /// Whether lost messages are to be sent again; a writer that does not offer it is not received. Else nothing is asked, and no writer waits.
    pub is_reliable: bool,
    /// Computers that multicast does not reach: announcements are sent to each of them too.
    pub peers: Vec<Ipv4Addr>,
}
