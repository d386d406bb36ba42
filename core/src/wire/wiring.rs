//! Which leg is heard, and whether its motors are wired and set as was said.

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// What is known of a leg's wiring. A leg is identified where it is [`Untested`](Self::Untested) or [`Right`](Self::Right); else its windows
/// are counted ([`LegCounters::tried`](super::LegCounters::tried)) and nothing is told of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Wiring {
    /// It is not asked: zeros are unknown, or positions are angles by the host's word ([`Positions::Absolute`](super::Positions::Absolute)).
    // First, so that what knows nothing is all zeros.
    #[default]
    Untested,
    /// The leg has not moved enough yet.
    OnTrial,
    /// It is the leg of this side, and nothing is wrong; or the host has said so ([`Action::TrustWiring`](super::Action::TrustWiring)).
    Right,
    /// The motion so far cannot exclude this fault: it takes a larger one, of the joints concerned from stop to stop.
    Unclear(Fault),
    /// Neither a leg as it should be nor one fault explains the torques: two faults, feet on the ground, a load that the CAD does not have.
    Unexplained,
    /// One fault explains the torques as well as those of a leg that is right.
    Fault(Fault),
}

/// What is wrong with a leg's wiring or zeros. Joints by their places in the leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Fault {
    /// A joint's torque has the wrong sign; position and velocity do not.
    TorqueSign {
        /// Which.
        joint: u8,
    },
    /// A joint counts the other way than was said: position, velocity and torque.
    Reversed {
        /// Which.
        joint: u8,
    },
    /// Each of two motors is heard in the other's place.
    Exchanged {
        /// Which.
        joints: [u8; 2],
    },
    /// It is the leg of the other side.
    OtherSide,
    /// It is the leg of the other side, or its hip counts the other way: where the hip's zero was set near 0 rad both are the same.
    OtherSideOrReversed,
    /// A joint's angle reads so many turns of its rotor too high.
    Turns {
        /// Which.
        joint: u8,
        /// Turns: 1 or −1.
        turns: i8,
    },
    /// A joint's velocity is not that of its position.
    Velocity {
        /// Which.
        joint: u8,
        /// By how much it is too high, thousandths.
        per_mille: i16,
    },
}
