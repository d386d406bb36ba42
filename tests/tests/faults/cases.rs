//! What goes wrong: on a bus, with the clock, at the host.

use proprio_core::bus::crc::{SEED_GO2, SEED_STANDALONE};
use proprio_core::bus::{Command, Mode, Reply};
use proprio_core::go2::{ACTUATORS, Leg};
use proprio_core::wire::{Action, EffectAt, Estimate, HostMessage, LegCounters, Losses, Request};
use proprio_host::device::replay::cycle;
use proprio_tests::motion::{self, SAMPLE_US};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Steps before the fault, in it, and after it.
pub(super) const GOOD: u64 = 5_000;
pub(super) const BAD: u64 = 1_000;

/// A reply's bits of overvoltage.
const OVERVOLTAGE: u16 = 3;

/// One step as a fault leaves it.
pub(super) struct Step {
    /// Time of the step, µs.
    pub(super) time_us: u64,
    /// Bytes of FR's bus; the other buses are good.
    pub(super) bytes: Vec<u8>,
    /// What the host asks, what it sends that is no message, and whether it takes what the device says.
    pub(super) requests: Vec<HostMessage>,
    pub(super) garbage: Vec<u8>,
    pub(super) heard: bool,
}

/// Changes a step: n is the step's number since the beginning, the other whether the fault is over.
pub(super) type Fault = Box<dyn FnMut(u64, bool, &mut Step)>;

/// What a fault's line of the table checks beside what holds for all.
pub(super) type Check = fn(&Outcome);

/// A fault in words, what it does, and what must have come of it.
pub(super) struct Case(pub(super) &'static str, pub(super) Fault, pub(super) Check);

/// What became of a fault.
pub(super) struct Outcome {
    pub(super) legs: [LegCounters; 4],
    pub(super) losses: Losses,
    pub(super) bytes: u64,
    pub(super) answers: u64,
    pub(super) estimate: Option<Estimate>,
}

/// The step n of a good robot.
pub(super) fn good(n: u64) -> Step {
    Step {
        time_us: n * SAMPLE_US,
        bytes: cycle(Leg::FR, &motion::sample(Leg::FR, n)).expect("it fits a frame"),
        requests: Vec::new(),
        garbage: Vec::new(),
        heard: true,
    }
}

/// A fault of FR's bus that lasts.
fn on_bus(mut change: impl FnMut(u64, &mut Vec<u8>) + 'static) -> Fault {
    Box::new(move |n, over, step| {
        if !over {
            change(n, &mut step.bytes);
        }
    })
}

/// FR's cycle of step n, each reply changed and with a good checksum.
fn replies(n: u64, mut change: impl FnMut(usize, &mut Reply)) -> Vec<u8> {
    let sample = motion::sample(Leg::FR, n);
    let mut bytes = Vec::new();
    for (j, actuator) in ACTUATORS.iter().enumerate() {
        let mode = Mode::foc(j as u8);
        let (q, dq, tau) = (sample.q[j], sample.dq[j], sample.tau[j]);
        let reply = Reply::from_joint(mode, actuator.gear, q, dq, tau, 25);
        let mut reply = reply.expect("it fits a frame");
        change(j, &mut reply);
        let command = Command {
            mode,
            ..Command::default()
        };
        bytes.extend(command.encode(SEED_GO2));
        bytes.extend(reply.encode(SEED_STANDALONE));
    }
    bytes
}

/// A fault that changes every reply of FR.
fn in_replies(mut change: impl FnMut(usize, &mut Reply) + 'static) -> Fault {
    on_bus(move |n, bytes| *bytes = replies(n, &mut change))
}

fn any(_: &Outcome) {}

/// What goes wrong on a bus, and with the clock.
pub(super) fn cases() -> Vec<Case> {
    let mut random = ChaCha8Rng::seed_from_u64(15);
    let mut numbers = ChaCha8Rng::seed_from_u64(16);
    vec![
        Case("nothing", on_bus(|_, _| ()), |o| {
            assert_eq!(o.legs[0].unused_replies + o.legs[0].skipped_bytes, 0);
        }),
        Case(
            "the calf's motor vanishes and returns",
            on_bus(|_, bytes| bytes.truncate(2 * (Command::LEN + Reply::LEN))),
            |o| assert_eq!(o.legs[0].incomplete, BAD as u32),
        ),
        Case("the bus is silent", on_bus(|_, bytes| bytes.clear()), |o| {
            assert_eq!(o.legs[0].samples, 2 * GOOD as u32);
        }),
        Case(
            "the bus carries random bytes, 150 a step",
            on_bus(move |_, bytes| {
                bytes.resize(150, 0);
                random.fill_bytes(bytes);
            }),
            any,
        ),
        Case(
            "the thigh's motor reports overvoltage",
            in_replies(|motor, reply| reply.flags = if motor == 1 { OVERVOLTAGE } else { 0 }),
            |o| assert_eq!(o.legs[0].motor_faults, BAD as u32),
        ),
        Case(
            "replies with random numbers in every field",
            in_replies(move |_, reply| {
                (reply.torque, reply.speed) = (numbers.random(), numbers.random());
                (reply.position, reply.temperature) = (numbers.random(), numbers.random());
                reply.flags = numbers.random();
            }),
            any,
        ),
        extreme("torque at its least", |r| r.torque = i16::MIN),
        extreme("torque at its greatest", |r| r.torque = i16::MAX),
        extreme("speed at its least", |r| r.speed = i16::MIN),
        extreme("speed at its greatest", |r| r.speed = i16::MAX),
        extreme("position at its least", |r| r.position = i32::MIN),
        extreme("position at its greatest", |r| r.position = i32::MAX),
        extreme("temperature at its least", |r| r.temperature = i8::MIN),
        extreme("all bits of state set", |r| r.flags = u16::MAX),
        Case(
            "the clock jumps an hour ahead",
            Box::new(|_, _, step| step.time_us += 3_600_000_000),
            |o| assert_eq!(o.legs[0].gaps, 1),
        ),
        Case(
            "the clock jumps an hour ahead and back",
            Box::new(|_, over, step| step.time_us += if over { 0 } else { 3_600_000_000 }),
            |o| assert_eq!((o.legs[0].gaps, o.legs[0].late), (2, 1)),
        ),
        Case(
            "the clock jumps 1 s back",
            Box::new(|_, _, step| step.time_us -= 1_000_000),
            |o| assert_eq!((o.legs[0].gaps, o.legs[0].late), (1, 1)),
        ),
    ]
}

/// All replies of FR say so.
fn extreme(what: &'static str, spoil: fn(&mut Reply)) -> Case {
    Case(what, in_replies(move |_, reply| spoil(reply)), any)
}

/// What a host does wrong.
pub(super) fn host_cases() -> Vec<Case> {
    let mut random = ChaCha8Rng::seed_from_u64(17);
    let mut id = 0;
    let mut ask = move |action| {
        id += 1;
        HostMessage::Request(Request { id, action })
    };
    let nowhere = EffectAt {
        leg: u8::MAX,
        joint: u8::MAX,
        effect: u8::MAX,
    };
    vec![
        Case(
            "the host floods with requests, 20 a step, numbers at their greatest",
            Box::new(move |_, over, step| {
                if !over {
                    step.requests = (0..20).map(|_| ask(Action::AddEffect(nowhere))).collect();
                }
            }),
            |o| assert!(o.answers > BAD * 9 / 10, "{}", o.answers),
        ),
        Case(
            "the host sends random bytes, 400 a step",
            Box::new(move |_, over, step| {
                step.garbage.resize(if over { 0 } else { 400 }, 0);
                random.fill_bytes(&mut step.garbage);
            }),
            |o| assert!(o.losses.host_frames_bad > 0),
        ),
        Case(
            "the host leaves and comes back",
            Box::new(|_, over, step| step.heard = over),
            |o| assert!(o.losses.frames_dropped > 0),
        ),
    ]
}
