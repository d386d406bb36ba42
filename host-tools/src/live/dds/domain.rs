//! A DDS domain that is only listened to: of the participant nothing is given but who writes what, and readers.

use std::convert::Infallible;
use std::error::Error;
use std::net::IpAddr;

use rustdds::dds::CreateError;
use rustdds::no_key::{Decode, DefaultDecoder, DeserializerAdapter, SimpleDataReader};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity,
    RepresentationIdentifier, TopicKind,
};

use super::peers::{Announcements, Peers};
use crate::live::Network;

/// Messages that the middleware keeps for us: two seconds of a robot's.
const HISTORY: i32 = 1024;

/// A participant in a domain. Whoever has it can listen, and cannot make a writer.
pub(super) struct Domain {
    participant: DomainParticipant,
    quality: QosPolicies,
    /// What announces it to computers that multicast does not reach.
    _peers: Option<Peers>,
}

/// A writer as it announces itself.
pub(super) struct Announced {
    /// Who it is.
    pub(super) writer: GUID,
    /// The topic, as the domain calls it.
    pub(super) topic: String,
    /// The type that it gives the topic: `unitree_go::msg::dds_::LowState_`.
    pub(super) type_name: String,
}

/// What receives a topic.
pub(super) type Reader = SimpleDataReader<Payload, Bytes>;

impl Domain {
    /// Joins a domain over the interface of this address alone.
    ///
    /// # Errors
    /// Those of the middleware, and of sockets.
    pub(super) fn join(network: &Network, interface: IpAddr) -> Result<Self, Box<dyn Error>> {
        let is_asked = !network.peers.is_empty();
        let announced = is_asked.then(|| Announcements::of(network.domain, interface));
        let announced = announced.transpose()?;
        let participant = DomainParticipantBuilder::new(network.domain)
            .with_only_networks([interface])
            // Announcements to this machine's own loopback would go beyond the interface that was chosen.
            .same_host_loopback(false)
            .build()?;
        let own = participant.guid();
        let peers = announced.map(|all| all.send_on(own, network.peers.clone()));
        Ok(Self {
            participant,
            quality: policies(network.is_reliable),
            _peers: peers.transpose()?,
        })
    }

    /// All writers known by now.
    pub(super) fn writers(&self) -> impl Iterator<Item = Announced> {
        let writers = self.participant.discovered_writers().into_iter();
        writers
            .map(|writer| writer.publication_topic_data)
            .map(|data| Announced {
                writer: data.key,
                topic: data.topic_name,
                type_name: data.type_name,
            })
    }

    /// Receives a topic of this name and type.
    ///
    /// # Errors
    /// Those of the middleware.
    pub(super) fn read(&self, topic: String, type_name: String) -> Result<Reader, CreateError> {
        let (quality, participant) = (&self.quality, &self.participant);
        let topic = participant.create_topic(topic, type_name, quality, TopicKind::NoKey)?;
        let subscriber = participant.create_subscriber(quality)?;
        subscriber.create_simple_datareader_no_key::<Payload, Bytes>(&topic, Some(quality.clone()))
    }
}

/// What is asked of writers; nothing of the past.
fn policies(is_reliable: bool) -> QosPolicies {
    let reliability = match is_reliable {
        false => Reliability::BestEffort,
        // Of a reader, the time is of no effect: it is how long a writer waits.
        true => Reliability::Reliable {
            max_blocking_time: rustdds::Duration::from_millis(100),
        },
    };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: HISTORY })
        .build()
}

/// A message's bytes with the header that says how they are encoded.
pub(super) struct Payload(pub(super) Vec<u8>);

/// Keeps payloads as they came.
pub(super) struct Bytes;

/// Copies bytes.
#[derive(Clone)]
pub(super) struct Copy;

impl DeserializerAdapter<Payload> for Bytes {
    type Error = Infallible;
    type Decoded = Payload;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        // Others are kept too, and counted as unreadable by who looks at their header.
        &[
            RepresentationIdentifier::CDR_LE,
            RepresentationIdentifier::XCDR2_LE,
            RepresentationIdentifier::CDR_BE,
            RepresentationIdentifier::XCDR2_BE,
        ]
    }

    fn transform_decoded(decoded: Payload) -> Payload {
        decoded
    }
}

impl DefaultDecoder<Payload> for Bytes {
    type Decoder = Copy;
    const DECODER: Copy = Copy;
}

impl Decode<'_, Payload> for Copy {
    type Error = Infallible;

    fn decode_bytes(
        self,
        bytes: &[u8],
        encoding: RepresentationIdentifier,
    ) -> Result<Payload, Infallible> {
        let [high, low] = encoding.to_bytes();
        Ok(Payload([&[high, low, 0, 0], bytes].concat()))
    }
}
