//! Participants that multicast does not reach are found by their addresses.
//!
//! rustdds announces its participant by multicast alone. What it sends there this machine receives too; it is sent on, unchanged, to the ports at
//! which participants of these computers listen (RTPS 2.5, §9.6.2.3). A participant that hears of another one answers to the address in the
//! announcement.

use std::io::{self, ErrorKind};
use std::iter;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use rustdds::GUID;
use socket2::{Domain, Protocol, Socket, Type};

/// Where participants announce themselves, and its port in domain 0; ports of a domain follow those of the one before (RTPS 2.5, §9.6.2).
const GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
const PORT: u16 = 7400;
const PORTS_OF_A_DOMAIN: u16 = 250;
/// A computer's first participant listens at this port beyond the group's, the next ones two further each. CycloneDDS by itself (`ParticipantIndex` none)
/// has a port of its own choice; what is sent to the group's port of its computer reaches it all the same, as `tests/live` shows.
const FIRST_PARTICIPANT: u16 = 10;
const APART: u16 = 2;
/// Participants that a computer may have: ROS 2 Jazzy configures CycloneDDS for indices to 32 (`MaxAutoParticipantIndex`).
const PARTICIPANTS: u16 = 33;
/// Of an announcement: the protocol's name, and where it says whose it is.
const PROTOCOL: &[u8] = b"RTPS";
const SENDER: std::ops::Range<usize> = 8..20;
/// No datagram is longer.
const LONGEST: usize = 1 << 16;
/// After such a silence the last announcement is sent again: rustdds has one in ten seconds, and a robot may start meanwhile.
const AGAIN: Duration = Duration::from_secs(1);

/// Receives announcements before they are begun to be sent on: a participant makes its first one as it begins.
pub(super) struct Announcements {
    heard: UdpSocket,
    sender: UdpSocket,
    /// The group's port.
    port: u16,
}

/// Sends a participant's announcements on until it is dropped.
pub(super) struct Peers(Arc<AtomicBool>);

impl Announcements {
    /// Those of a domain over this interface.
    ///
    /// # Errors
    /// Those of sockets.
    pub(super) fn of(domain: u16, interface: IpAddr) -> io::Result<Self> {
        let port = PORT + PORTS_OF_A_DOMAIN * domain;
        let heard = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
        // Each participant of this machine is bound to this port.
        heard.set_reuse_address(true)?;
        heard.bind(&SocketAddr::from((Ipv4Addr::UNSPECIFIED, port)).into())?;
        if let IpAddr::V4(interface) = interface {
            heard.join_multicast_v4(&GROUP, &interface)?;
        }
        heard.set_read_timeout(Some(AGAIN))?;
        Ok(Self {
            heard: heard.into(),
            sender: UdpSocket::bind((interface, 0))?,
            port,
        })
    }

    /// Sends what the participant `own` announces on to these computers.
    ///
    /// # Errors
    /// That no thread can be started.
    pub(super) fn send_on(self, own: GUID, peers: Vec<Ipv4Addr>) -> io::Result<Peers> {
        let over = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&over);
        let to_peers = move || {
            let (mut room, mut last) = (vec![0; LONGEST], Vec::new());
            while !ended.load(Relaxed) {
                match self.heard.recv(&mut room) {
                    Ok(length) if !is_of(&room[..length], own.prefix.as_ref()) => continue,
                    Ok(length) => last = room[..length].to_vec(),
                    Err(error) if is_silence(&error) => {}
                    Err(_) => thread::sleep(AGAIN),
                }
                self.send(&last, &peers);
            }
        };
        let named = thread::Builder::new().name("dds peers".to_owned());
        named.spawn(to_peers)?;
        Ok(Peers(over))
    }

    fn send(&self, announcement: &[u8], peers: &[Ipv4Addr]) {
        if announcement.is_empty() {
            return;
        }
        let own = (0..PARTICIPANTS).map(|n| self.port + FIRST_PARTICIPANT + APART * n);
        for port in iter::once(self.port).chain(own) {
            for &peer in peers {
                // Where nobody listens, or no way leads now, a later one may come through.
                let _ = self.sender.send_to(announcement, (peer, port));
            }
        }
    }
}

impl Drop for Peers {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

/// Whether a datagram is what this participant announces.
fn is_of(datagram: &[u8], own: &[u8]) -> bool {
    datagram.starts_with(PROTOCOL) && datagram.get(SENDER) == Some(own)
}

/// Whether nothing came.
fn is_silence(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What others announce is theirs to send, and what is no announcement is nobody's.
    #[test]
    fn a_participant_sends_on_what_is_its_own() {
        let own = [7; 12];
        let of = |name: &[u8], sender: [u8; 12]| [name, &[2, 4, 1, 18], &sender, &[0; 40]].concat();
        assert!(is_of(&of(b"RTPS", own), &own));
        assert!(!is_of(&of(b"RTPS", [8; 12]), &own));
        assert!(!is_of(&of(b"RTPX", own), &own));
        assert!(!is_of(b"RTPS", &own));
        assert!(!is_of(b"", &own));
    }
}
