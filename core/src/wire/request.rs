//! What a host can ask of a device, and what it is answered.

use super::Setup;
use heapless::Vec;
use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

/// Most numbers of a factor that one [`FactorPart`] carries.
pub const MAX_PART: usize = 64;

/// Something to be done once, however often it is heard: a host that got no answer asks again with the same `id`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Request {
    /// The host's choice, another one for each request. A host begins at a random number, so that a device does not take its
    /// requests for those of the host before.
    pub id: u32,
    /// What is to be done.
    pub action: Action,
}

/// What can be done. [`Reset`](Action::Reset) takes back what all others have set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum Action {
    /// Forget all data and counts.
    Reset,
    /// Estimate this effect from now on.
    AddEffect(EffectAt),
    /// Estimate it no more.
    DropEffect(EffectAt),
    /// Have data of so many seconds ago weigh 1/e from now on, block by block of 2 s; 0, as after a reset: as much as new ones.
    SetMemory(u32),
    /// Take this to be what is known of an effect's parameter before any data, in place of the catalogue's prior; whether the model has
    /// the effect or not.
    SetEffectPrior(EffectAt, Belief),
    /// Take the CAD's inertial parameters of a body to be known so well.
    SetBodyPrior(BodyPrior),
    /// Listen to these legs alone, bit n for the n-th in SDK order, and solve them alone. What is known of the others is kept as it is.
    SetLegs(u8),
    /// Write what is known and what was set to the board's flash now, so that the next start goes on from there. Done when
    /// [`Counters::snapshots`](super::Counters::snapshots) has grown, some seconds later.
    Keep,
    /// Take what positions on the bus are to be this.
    SetPositions(Positions),
    /// Take a joint's angle to be this now: its zero follows from what its motor says. A zero other than the one before has the leg forget what
    /// it has learnt.
    SetZero(SetZero),
    /// Take the zeros that were kept before the board restarted: the motors were not switched off meanwhile.
    TrustZeros,
    /// Take the wiring of all legs on trial to be right, except where a fault was found ([`Wiring`](super::Wiring)): somebody has looked.
    TrustWiring,
    /// Be set up so from the next start on: written to the board's flash, and done when [`Hello::setup`](super::Hello::setup) says so.
    SetUp(Setup),
}

/// What positions on the motor bus are. [`Action::Reset`] leaves it as it is, and the zeros with it: they are not the host's choice but how
/// the robot is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Positions {
    /// Counts of the rotor from where the motor began to count, another place after each power-up: a real robot's motors.
    FromPowerUp,
    /// Angles of the joints: a simulator's, or a log's that is played.
    Absolute,
}

/// A joint's angle now.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct SetZero {
    /// The leg's index in SDK order.
    pub leg: u8,
    /// The joint's place in the leg.
    pub joint: u8,
    /// Its angle, rad, within the joint's limits.
    pub angle: f32,
    /// The motor turns against the joint.
    pub reversed: bool,
}

/// Whether a joint's zero is known, and why it is not. A leg is identified while those of its joints are; else it is listened to and counted
/// ([`LegCounters::unplaced`](super::LegCounters::unplaced)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Zero {
    /// Nobody has said where it is.
    // First, so that what knows nothing is all zeros.
    #[default]
    Unknown,
    /// Positions on the bus are the joint's angles: [`Positions::Absolute`].
    Absolute,
    /// The host has said so, and the motor has counted on since.
    Set,
    /// The board has restarted: the motors may have, too.
    Restarted,
    /// The motor was silent so long that it may have been switched off.
    Silent,
    /// The motor's position has jumped: it has lost turns, or begun anew.
    Jumped,
    /// The motor's position has jumped to where another's was: ids were exchanged.
    Exchanged,
}

impl Zero {
    /// Whether it is known.
    pub const fn is_known(self) -> bool {
        matches!(self, Self::Absolute | Self::Set)
    }
}

/// What is known of a parameter before any data: a normal distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Belief {
    /// Expected value, within the effect's bounds; SI.
    pub mean: f32,
    /// Its standard deviation, positive and finite; SI.
    pub std: f32,
}

/// How well a body is known before any data.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct BodyPrior {
    /// The leg's index in SDK order.
    pub leg: u8,
    /// The body's place in the leg, its joint's.
    pub body: u8,
    /// Relative standard deviation of the CAD's mass, and with it of all inertial parameters:
    /// [`InertialParameters::prior`](crate::inertia::InertialParameters::prior). 0.001 to 100; 0.1 after a reset.
    pub uncertainty: f32,
}

/// What became of a [`Request`]; the same each time that it is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Answer {
    /// [`Request::id`].
    pub id: u32,
    /// What became of it.
    pub outcome: Outcome,
}

/// What became of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Outcome {
    /// Done: the next estimate of the leg is of the new model.
    Accepted,
    /// The robot has no such leg.
    NoSuchLeg,
    /// The robot has no such joint or body.
    NoSuchJoint,
    /// The firmware keeps no columns for such an effect.
    NoSuchEffect,
    /// The model has it already.
    AlreadyActive,
    /// The model does not have it.
    NotActive,
    /// A number is not finite, or beyond what its field may be; nothing was changed.
    OutOfRange,
    /// The board has nowhere to keep it.
    NoStorage,
    /// The motor has not been heard for a moment.
    NotHeard,
    /// The joint moves.
    Moves,
    /// No zero was kept, or it has not held since.
    NoZero,
    /// No leg is on trial, or only such as have a fault.
    NoTrial,
}

/// An effect at a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct EffectAt {
    /// The leg's index in SDK order.
    pub leg: u8,
    /// The joint's place in the leg.
    pub joint: u8,
    /// The effect's place in [`Hello::effects`](super::Hello::effects).
    pub effect: u8,
}

/// Asks for a part of the triangle of one joint in one fold, answered by [`FactorPart`].
///
/// The parts of a triangle must be of one time, so they are read from a copy. The device makes one when it hears of a `copy`
/// that it does not hold and `first` is 0, and keeps it until it makes the next. Asking for the same part again gives the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct ReadFactor {
    /// The host's name of the copy, chosen as [`Request::id`] is.
    pub copy: u32,
    /// The leg's index in SDK order.
    pub leg: u8,
    /// Which fold.
    pub fold: u8,
    /// The joint's place in the leg.
    pub joint: u8,
    /// Place of the part's first number in the triangle, packed by rows.
    pub first: u16,
}

/// A part of a triangle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct FactorPart {
    /// What was asked.
    pub read: ReadFactor,
    /// Windows in the triangle; forgotten ones count less.
    pub windows: f64,
    /// Numbers of the whole triangle; 0 where there is none, or where its copy is no longer held.
    pub length: u16,
    /// The part's numbers.
    pub numbers: Vec<f64, MAX_PART>,
}
