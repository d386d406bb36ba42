//! The link between a device and its host: which messages there are, and how they travel.
//!
//! A [`DeviceMessage`] or [`HostMessage`] is postcard; with a sequence number before it and a CRC-32 behind it, it is one
//! COBS frame between zero bytes (`frame`). So the reader finds the next frame after any damage, knows a damaged frame
//! from a good one, and knows from the numbers how many never came.
//!
//! What a host wants done is a [`Request`]: it has a number of its own, is answered, and is done once however often it comes. What a board is set up
//! for is a [`Setup`].
//!
//! Both ends are built from these types. [`SCHEMA`] is a hash of their layout, taken when compiled, and each kind of message has one of its own
//! (`layout`). A device says them in its [`Hello`], before anything whose layout may differ. A host that was built later reads the
//! kinds that are the same; of others it gets [`WireError::OtherLayout`] instead of numbers in the wrong places, and
//! [`WireError::Incompatible`] where it cannot read the hello.

mod frame;
mod layout;
mod request;
pub mod rings;
mod setup;
#[cfg(test)]
mod tests;
mod walk;
mod wiring;

pub use frame::{MAX_FRAME, Message, Receiver, Sender, WireError};
pub use layout::{HEARD, HEARS, Layout, Peer, SAID, SAYS};
pub use request::{
    Action, Answer, Belief, BodyPrior, EffectAt, FactorPart, MAX_PART, Outcome, Positions,
    ReadFactor, Request, SetZero, Zero,
};

pub use setup::Setup;
pub use walk::{Imu, Walk, WalkCounts};
pub use wiring::{Fault, Wiring};

use heapless::{String, Vec};
use postcard_schema::{Schema, key::hash::fnv1a64::hash_ty_path};
use serde::{Deserialize, Serialize};

/// Version of the rules that the hash does not see: framing, units, when which message is sent.
pub const PROTOCOL: u8 = 5;

/// Identifies the layout of all messages and [`PROTOCOL`].
pub const SCHEMA: [u8; 8] = {
    let mut hash = hash_ty_path::<(DeviceMessage, HostMessage)>("proprio");
    hash[0] ^= PROTOCOL;
    hash
};

/// Bits per second of a board's host link, 8N1: a rate that serial ports of all systems name. The NUCLEO's clock makes it 0.5 % slow.
pub const HOST_BAUD: u32 = 921_600;

/// Legs that counters and byte counts speak of, in SDK order.
pub const LEGS: usize = 4;

/// Most parameters that an [`Estimate`] can carry.
pub const MAX_PARAMETERS: usize = 64;

/// Most effects that a device can have columns for.
pub const MAX_EFFECTS: usize = 16;

/// Joints of a leg.
pub const JOINTS_PER_LEG: usize = 3;

/// One number per parameter, in the order of the core's θ; SI.
pub type Parameters = Vec<f32, MAX_PARAMETERS>;

/// What a device says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
#[allow(clippy::large_enum_variant)] // no allocator to box with
pub enum DeviceMessage {
    /// Who it is. Must stay the first variant: the host reads its schema before it trusts the rest.
    Hello(Hello),
    /// One leg's parameters.
    Estimate(Estimate),
    /// What was lost, and what it cost.
    Counters(Counters),
    /// What an effect brings, or would bring, to one joint.
    Diagnosis(Diagnosis),
    /// What became of a [`Request`].
    Answer(Answer),
    /// A part of what [`HostMessage::ReadFactor`] asks for.
    FactorPart(FactorPart),
    /// A leg is no longer what it was.
    Change(Change),
    /// The step that the host asked for is done.
    Advanced(Advanced),
    /// A walking robot's parameters.
    Walk(Walk),
}

/// What a host says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub enum HostMessage {
    /// Say [`Hello`] at once.
    RequestHello,
    /// Do this, once; answered by [`DeviceMessage::Answer`].
    Request(Request),
    /// Say a part of a factor.
    ReadFactor(ReadFactor),
    /// Do one step at a time that the host decides; only emulated boards, whose clock means nothing, obey.
    Advance(Advance),
    /// What the IMU of a robot that walks says now; no answer.
    Imu(Imu),
}

/// A device's identity and capacities: at start, when asked, and once a second.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Hello {
    /// [`SCHEMA`]. Must stay the first field.
    pub schema: [u8; 8],
    /// Version of the firmware. Must stay the second.
    pub firmware: String<24>,
    /// The layouts of what the device says: [`SAYS`]. Must stay the third.
    pub says: Vec<Layout, SAID>,
    /// The layouts of what it hears: [`HEARS`]. Must stay the fourth; a new field is the last.
    pub hears: Vec<Layout, HEARD>,
    /// The commit that it was built of, with a `+` behind it if the sources were others; empty where that is not known.
    pub git: String<16>,
    /// Name of the board.
    pub board: String<24>,
    /// Why it started.
    pub reset: Reset,
    /// Below which supply the board resets itself, as the chip's manual counts levels; nothing where it has no such reset.
    pub brown_out_level: Option<u8>,
    /// What ended the run before, if that was a panic or a fault: where and what, in words; else empty.
    pub crash: String<64>,
    /// What the device can hold.
    pub capacities: Capacities,
    /// Which clock its times are of.
    pub clock: Clock,
    /// What [`Load`] counts: "instructions" in emulation, "cycles" on a board.
    pub load_unit: String<16>,
    /// What has become of what was kept before the start.
    pub kept: Kept,
    /// Legs that it listens to, bit n for the n-th in SDK order: [`Action::SetLegs`].
    pub listens_to: u8,
    /// The robot's feet carry it, so that a device for a robot that hangs leaves its windows out ([`LegCounters::carried`]).
    pub carried: bool,
    /// Whether each joint's zero is known, by leg and joint.
    pub zeros: [[Zero; JOINTS_PER_LEG]; LEGS],
    /// What is known of each leg's wiring.
    pub wiring: [Wiring; LEGS],
    /// Names of the effects that the device keeps columns for, the longest of 18 letters; other messages speak of them by their place in this list.
    pub effects: Vec<String<20>, MAX_EFFECTS>,
    /// What the board is set up for from its next start on.
    pub setup: Setup,
    /// It was so at this start as well: nothing waits for the next.
    pub setup_in_use: bool,
}

/// Why a board started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Reset {
    /// It cannot tell, or none of the following.
    Unknown,
    /// The power came.
    Power,
    /// The reset button, or a programmer.
    Pin,
    /// The firmware itself, after a panic or a fault.
    Software,
    /// The watchdog: the firmware had stopped.
    Watchdog,
    /// The supply fell below the brown-out level, [`Hello::brown_out_level`], and came back.
    BrownOut,
}

/// Which clock a board's times are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Clock {
    /// It cannot tell, or has none of its own.
    Unknown,
    /// A crystal's.
    Crystal,
    /// The chip's own oscillator, some per cent fast or slow: a board without its crystal's clock. Velocities and positions then disagree by
    /// as much.
    Internal,
}

/// What a device has found in its flash when it started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Kept {
    /// It has none.
    NoStorage,
    /// No whole snapshot.
    Nothing,
    /// A snapshot, and it goes on from there.
    Restored,
    /// A snapshot of another firmware's messages, another robot or another model: it began anew.
    OfAnother,
}

/// Sizes fixed when the firmware was compiled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Capacities {
    /// Legs identified.
    pub legs: u8,
    /// Joints of a leg.
    pub joints_per_leg: u8,
    /// Inertial parameters of a leg; they come first in θ.
    pub inertial_parameters: u8,
    /// Effect parameters of a leg at first.
    pub effect_parameters: u8,
    /// Length of a window, µs.
    pub window_us: u32,
    /// Bits of the scalar that the device computes with, 32 or 64.
    pub scalar_bits: u8,
}

/// One leg's parameters, four times a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Estimate {
    /// The leg's index in SDK order.
    pub leg: u8,
    /// Device time of the last sample in it, µs.
    pub time_us: u64,
    /// Windows of data in it.
    pub windows: u32,
    /// Which effects each joint's model has: bit n for the n-th of [`Hello::effects`].
    pub effects: [u32; JOINTS_PER_LEG],
    /// Which solution it is.
    pub solution: Solution,
    /// θ: the inertial parameters, then each joint's effects in the order of [`Hello::effects`].
    pub values: Parameters,
    /// Standard deviations of θ.
    pub std: Parameters,
    /// Each joint's noise: standard deviation of a window's mean torque, N m.
    pub noise: [f32; JOINTS_PER_LEG],
}

/// Which solution of a leg's data is told. Either way each body could exist and each effect is within its bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum Solution {
    /// Least squares alone.
    Free,
    /// Least squares alone had a body that cannot exist or an effect beyond its bounds: the likeliest one that can.
    Consistent,
}

/// What one effect brings to a joint, judged on data that the models were not fitted to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Diagnosis {
    /// Which effect, where.
    pub at: EffectAt,
    /// The model has it; else it is a candidate.
    pub active: bool,
    /// Windows of data in it.
    pub windows: u32,
    /// 1 − (squared error with the effect) / (without), on held-out data.
    pub gain: f32,
    /// The gain's standard error, from its spread over the folds.
    pub gain_error: f32,
    /// The parameter's value in the model that has it; SI.
    pub value: f32,
    /// Its standard deviation under independent residuals.
    pub std: f32,
}

/// A leg is no longer what it was; the parameters that this touches are estimated anew, all others go on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, Schema)]
pub struct Change {
    /// The leg's index in SDK order.
    pub leg: u8,
    /// The joint's place in the leg; of a load, the joint of the body that carries it.
    pub joint: u8,
    /// What has changed.
    pub kind: ChangeKind,
    /// By how much, roughly: N m of bias or Coulomb friction, kg on a thigh or calf, kg m about the axis of a hip.
    pub size: f32,
    /// Begin of the block of time in which it was noticed, µs: it happened in it, or shortly before.
    pub since_us: u64,
    /// End of that block, when it was noticed, µs.
    pub time_us: u64,
}

/// What has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub enum ChangeKind {
    /// A joint's bias.
    Bias,
    /// A joint's friction: it binds, or runs freely again.
    Friction,
    /// What a body carries.
    Load,
}

/// Everything that was counted, ten times a second. Counts start at zero and wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Counters {
    /// Device time, µs.
    pub time_us: u64,
    /// Per leg, in SDK order.
    pub legs: [LegCounters; LEGS],
    /// Frames from the host that were damaged.
    pub host_frames_bad: u32,
    /// Frames from the host that never came, by their sequence numbers.
    pub host_frames_missed: u32,
    /// Frames to the host that found no room on the way: a host that is slow, or not there.
    pub frames_dropped: u32,
    /// What the board's drivers lost of each bus, in SDK order.
    pub buses: [LineLosses; LEGS],
    /// And of the host link.
    pub host_line: LineLosses,
    /// Of a board's own IMU: times that it was silent or found no room, readings that were refused.
    pub imu: LineLosses,
    /// Cost of the ticks.
    pub load: Load,
    /// Snapshots written since the start.
    pub snapshots: u32,
    /// Snapshots given up: the flash refused them, or what was to be kept never stood still.
    pub snapshots_failed: u32,
}

/// What never got from a line to the application.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LineLosses {
    /// Times that the line's buffer was full.
    pub overruns: u32,
    /// Reads that found a broken byte.
    pub errors: u32,
}

impl LineLosses {
    /// Nothing lost.
    pub const ZERO: Self = Self {
        overruns: 0,
        errors: 0,
    };
}

/// What was lost around the application, since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Losses {
    /// [`Counters::host_frames_bad`].
    pub host_frames_bad: u32,
    /// [`Counters::host_frames_missed`].
    pub host_frames_missed: u32,
    /// [`Counters::frames_dropped`].
    pub frames_dropped: u32,
    /// [`Counters::buses`].
    pub buses: [LineLosses; LEGS],
    /// [`Counters::host_line`].
    pub host_line: LineLosses,
    /// [`Counters::imu`].
    pub imu: LineLosses,
}

impl Losses {
    /// Nothing lost.
    pub const ZERO: Self = Self {
        host_frames_bad: 0,
        host_frames_missed: 0,
        frames_dropped: 0,
        buses: [LineLosses::ZERO; LEGS],
        host_line: LineLosses::ZERO,
        imu: LineLosses::ZERO,
    };
}

/// One leg's bus, samples and windows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct LegCounters {
    /// Good commands heard.
    pub commands: u32,
    /// Good replies heard.
    pub replies: u32,
    /// Frames with a bad CRC, of full length.
    pub bad_crc: u32,
    /// Frames with a bad CRC, cut short by the next one.
    pub short: u32,
    /// Bytes in no good frame.
    pub skipped_bytes: u32,
    /// Bytes that found no room: the bus brought more than steps have time for.
    pub lost_bytes: u32,
    /// Bytes of a bus that the device was told not to listen to: [`Action::SetLegs`].
    pub unheard_bytes: u32,
    /// Good replies that are in no sample: of an id that is none of the leg's motors', with a pause among their bytes, or of a cycle that is
    /// counted in one of the next five.
    pub unused_replies: u32,
    /// Polling cycles in which a motor was not heard.
    pub incomplete: u32,
    /// Replies in which a motor reports a fault other than heat; their cycles are in no sample.
    pub motor_faults: u32,
    /// Replies in which a motor says that it is too hot; their cycles are in no sample.
    pub overheated: u32,
    /// Replies of a motor whose position stays where it is though speed or torque say otherwise; their cycles are in no sample.
    pub stuck: u32,
    /// What each joint's motor said last of its temperature, °C; zero before that. At 127, the end of its scale, it is hotter than it
    /// can say, or has no sensor. No estimate depends on it.
    pub temperatures: [i8; JOINTS_PER_LEG],
    /// Polling cycles left out because more came than steps have time for.
    pub surplus: u32,
    /// Samples assembled: three good replies of one polling cycle, brought to one time.
    pub samples: u32,
    /// Samples of a leg whose zeros are unknown: not used.
    pub unplaced: u32,
    /// Windows by which it was tested which leg it is, or that came meanwhile ([`Hello::wiring`]): in no estimate.
    pub tried: u32,
    /// Samples used.
    pub used: u32,
    /// Samples whose time was not after the one before: skipped.
    pub late: u32,
    /// Samples that cannot be true: skipped.
    pub rejected: u32,
    /// Gaps in time that were not bridged.
    pub gaps: u32,
    /// Windows folded in.
    pub windows: u32,
    /// Windows whose rows were not finite: not folded in.
    pub unfolded: u32,
    /// Times that the leg was found to have changed.
    pub changes: u32,
    /// Windows folded in and taken out again because the leg had changed in them, or not folded in while that was seen to.
    pub forgotten: u32,
    /// Windows left out because the robot's feet carried it: it stood or walked, or had done so shortly before.
    pub carried: u32,
    /// Solutions that failed: nothing determines some parameter.
    pub unsolved: u32,
}

impl LegCounters {
    /// Nothing counted.
    pub const ZERO: Self = Self {
        commands: 0,
        replies: 0,
        bad_crc: 0,
        short: 0,
        skipped_bytes: 0,
        lost_bytes: 0,
        unheard_bytes: 0,
        unused_replies: 0,
        incomplete: 0,
        motor_faults: 0,
        overheated: 0,
        stuck: 0,
        temperatures: [0; JOINTS_PER_LEG],
        surplus: 0,
        samples: 0,
        unplaced: 0,
        tried: 0,
        used: 0,
        late: 0,
        rejected: 0,
        gaps: 0,
        windows: 0,
        unfolded: 0,
        changes: 0,
        forgotten: 0,
        carried: 0,
        unsolved: 0,
    };
}

/// Cost of the application's steps, in the unit that [`Hello`] names.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Load {
    /// Steps done.
    pub ticks: u32,
    /// Steps that cost more than the board's budget.
    pub over_budget: u32,
    /// The dearest step.
    pub worst: u32,
    /// All steps together.
    pub total: u64,
    /// Deepest stack so far, bytes; 0 where the board does not measure it.
    pub stack_bytes: u32,
}

/// One step of an emulated board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Advance {
    /// Time of the step, µs.
    pub time_us: u64,
    /// Bytes of each leg's bus to take before it.
    pub bytes: [u32; LEGS],
}

impl Load {
    /// Nothing done.
    pub const ZERO: Self = Self {
        ticks: 0,
        over_budget: 0,
        worst: 0,
        total: 0,
        stack_bytes: 0,
    };

    /// Takes note of a step's cost, and of the deepest stack so far.
    pub(crate) fn record(&mut self, cost: u32, stack_bytes: u32, budget: u32) {
        self.ticks = self.ticks.wrapping_add(1);
        self.over_budget = self.over_budget.wrapping_add(u32::from(cost > budget));
        self.worst = self.worst.max(cost);
        self.total = self.total.wrapping_add(u64::from(cost));
        self.stack_bytes = stack_bytes;
    }
}

/// A step is done; what it led to was said before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, Schema)]
pub struct Advanced {
    /// [`Advance::time_us`] of the step.
    pub time_us: u64,
}
