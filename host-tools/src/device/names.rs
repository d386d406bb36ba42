//! What a device's numbers mean: which joint, which effect, which parameter.

use proprio_core::bus::Reply;
use proprio_core::effect::EffectKind;
use proprio_core::factor::FactorError;
use proprio_core::go2::{JointId, Leg};
use proprio_core::wire::{
    Change, ChangeKind, EffectAt, Estimate, Fault, HEARD, Hello, SAID, Setup, Solution, Walk,
    Wiring, Zero,
};

use crate::estimate::{self, Constraint, ParameterEstimate};

/// Where the device's numbers point; none beyond what the robot and the device have.
pub fn place(at: &EffectAt, hello: &Hello) -> Option<(JointId, EffectKind)> {
    let leg = Leg::ALL.get(usize::from(at.leg))?;
    let joint = JointId::of(*leg).into_iter().nth(at.joint.into())?;
    let name = hello.effects.get(usize::from(at.effect))?;
    Some((joint, EffectKind::from_name(name)?))
}

/// The kinds of a device's messages, in the order of [`SAYS`](proprio_core::wire::SAYS).
const SAID_WORDS: [&str; SAID] = [
    "hello",
    "estimates",
    "counters",
    "diagnoses",
    "answers",
    "factors",
    "changes",
    "steps",
    "estimates of a walking robot",
];

/// The kinds of a host's messages, in the order of [`HEARS`](proprio_core::wire::HEARS).
const HEARD_WORDS: [&str; HEARD] = [
    "hello",
    "requests",
    "requests for factors",
    "steps",
    "IMU readings",
];

/// A kind of a host's messages, in words.
pub(super) fn words_of_heard(kind: usize) -> &'static str {
    HEARD_WORDS.get(kind).copied().unwrap_or("messages")
}

/// What this program cannot read of a device's messages, and what the device would not read of this program's, in words; nothing of a device
/// whose messages are all the same.
pub fn words_of_lacking(hello: &Hello) -> Option<String> {
    let peer = hello.peer();
    let unread = SAID_WORDS.iter().enumerate();
    let unread: Vec<&str> = unread
        .filter(|(n, _)| !peer.says(*n))
        .map(|(_, words)| *words)
        .collect();
    let unheard = HEARD_WORDS.iter().enumerate();
    let unheard: Vec<&str> = unheard
        .filter(|(n, _)| !peer.hears(*n))
        .map(|(_, words)| *words)
        .collect();
    let [unread, unheard] =
        [unread, unheard].map(|kinds| (!kinds.is_empty()).then(|| kinds.join(", ")));
    let lacks = match (unread, unheard) {
        (None, None) => return None,
        (Some(unread), None) => format!("not shown: {unread}"),
        (None, Some(unheard)) => format!("not taken: {unheard}"),
        (Some(unread), Some(unheard)) => format!("not shown: {unread}; not taken: {unheard}"),
    };
    Some(format!(
        "firmware {} has other messages than this program; {lacks}",
        hello.firmware
    ))
}

/// What a device says has changed, in words; nothing of a joint that the robot does not have.
pub fn words_of(change: &Change) -> Option<String> {
    let leg = Leg::ALL.get(usize::from(change.leg))?;
    let joint = JointId::of(*leg).into_iter().nth(change.joint.into())?;
    let (name, size) = (joint.name(), change.size);
    let [since, until] = [change.since_us, change.time_us].map(|us| us / 1_000_000);
    let what = match change.kind {
        ChangeKind::Bias => format!("bias {size:+.2} N m"),
        ChangeKind::Friction if size < 0.0 => format!("runs freely, {size:+.2} N m"),
        ChangeKind::Friction => format!("binds, {size:+.2} N m"),
        // Of a hip the size is a moment, whose meaning hangs on where the load is.
        ChangeKind::Load if joint.place() == 0 => "its load has changed".to_owned(),
        ChangeKind::Load => format!("load {size:+.2} kg"),
    };
    Some(format!("{name}: {what} ({since}–{until} s)"))
}

/// What a device knows of a joint's zero, in words.
pub fn words_of_zero(zero: Zero) -> &'static str {
    match zero {
        Zero::Absolute => "positions are angles",
        Zero::Set => "known",
        Zero::Unknown => "unknown: not set",
        Zero::Restarted => "unknown: the board has restarted",
        Zero::Silent => "unknown: the motor was silent",
        Zero::Jumped => "unknown: the position jumped",
        Zero::Exchanged => "unknown: the position is another motor's",
    }
}

/// What a board is set up for, in words.
pub fn words_of_setup(setup: &Setup) -> String {
    let numbers = |of: [i16; 3]| of.map(|x| (f64::from(x) / 1e4).to_string()).join(", ");
    format!(
        "IMU at {} m, turned by {} rad; buses at {} Mbit/s",
        numbers(setup.imu_at),
        numbers(setup.imu_turned),
        f64::from(setup.bus_baud) / 1e6
    )
}

/// What a temperature at the top of a motor's scale ([`Reply::TOP_TEMPERATURE`]) means, in words that go on from the motor's name.
pub fn words_of_top_temperature() -> String {
    let top = Reply::TOP_TEMPERATURE;
    format!(
        "reports {top} °C, the top of its scale: it is too hot, or has no sensor; let it cool, or check the motor"
    )
}

/// What a device knows of a leg's wiring, in words that go on from its name: what is wrong, and what to do.
pub fn words_of_wiring(leg: Leg, wiring: Wiring) -> String {
    match wiring {
        Wiring::Untested => "wiring not tested".to_owned(),
        Wiring::OnTrial => "wiring on trial: move all its joints".to_owned(),
        Wiring::Right => "wiring as it should be".to_owned(),
        Wiring::Unclear(fault) => format!(
            "wiring unclear: its motion does not exclude that {}; move its joints further, from stop to stop",
            words_of_fault(leg, fault).0
        ),
        Wiring::Unexplained => "wiring unclear: neither a leg as it should be nor one fault explains its torques; hang the robot free, check \
             its cables and zeros"
            .to_owned(),
        Wiring::Fault(fault) => {
            let (wrong, fix) = words_of_fault(leg, fault);
            format!("{wrong}; {fix}")
        }
    }
}

/// What is wrong, and what to do.
fn words_of_fault(leg: Leg, fault: Fault) -> (String, &'static str) {
    let names = leg.joint_names();
    let name = |joint: u8| names.get(usize::from(joint)).copied().unwrap_or("?");
    match fault {
        Fault::TorqueSign { joint } => (
            format!("the torque of {} has the wrong sign", name(joint)),
            "check its motor's firmware and wiring",
        ),
        Fault::Reversed { joint } => (
            format!("{} counts the other way", name(joint)),
            "set its zero with or without `proprio zero --reversed`",
        ),
        Fault::Exchanged { joints: [a, b] } => (
            format!("the motors of {} and {} are exchanged", name(a), name(b)),
            "exchange their ids or cables and set their zeros",
        ),
        Fault::OtherSide => (
            "it is the leg of the other side".to_owned(),
            "plug its cable into the other socket",
        ),
        Fault::OtherSideOrReversed => (
            format!(
                "it is the leg of the other side, or {} counts the other way",
                name(0)
            ),
            "check its socket; else set the hip's zero 0.3 rad or more from 0",
        ),
        Fault::Turns { joint, turns } => (
            format!(
                "{} reads {} rotor turn too {}",
                name(joint),
                turns.unsigned_abs(),
                if turns > 0 { "high" } else { "low" }
            ),
            "set its zero",
        ),
        Fault::Velocity { joint, per_mille } => (
            format!(
                "the velocity of {} reads {:.1} % {}",
                name(joint),
                f64::from(per_mille).abs() / 10.0,
                if per_mille > 0 { "high" } else { "low" }
            ),
            "no estimate is sent; record a log and add velocity_gain",
        ),
    }
}

/// What a device says of a robot that walks, in words.
pub fn words_of_walk(walk: &Walk) -> String {
    let ([mass, std], [trunk, x, y, z, ..]) = (walk.mass, walk.trunk);
    let [x, y, z] = [x, y, z].map(|h| 1e3 * h / trunk);
    format!(
        "walks: {mass:.2} ± {std:.2} kg; trunk {trunk:.2} kg, its centre of mass at {x:.0}, {y:.0}, {z:.0} mm ({} windows)",
        walk.counts.windows
    )
}

/// The effects of a leg's estimate in the order of θ: those that its masks name.
fn of_masks(leg: Leg, masks: &[u32], hello: &Hello) -> Vec<(JointId, EffectKind)> {
    let joints = JointId::of(leg).into_iter().zip(masks);
    let effects = joints.flat_map(|(joint, mask)| {
        let named = hello.effects.iter().enumerate();
        let active = named.filter(move |(n, _)| mask >> n & 1 == 1);
        active.filter_map(move |(_, name)| Some((joint, EffectKind::from_name(name)?)))
    });
    effects.collect()
}

/// A leg's parameters by name, beside what was known of them before any data; none of a leg that the robot does not have.
///
/// # Errors
/// As [`estimate::of_device`].
pub fn parameters_of(
    told: &Estimate,
    hello: &Hello,
) -> Result<Vec<ParameterEstimate>, FactorError> {
    let Some(&leg) = Leg::ALL.get(usize::from(told.leg)) else {
        return Ok(Vec::new());
    };
    let [values, std] = [&told.values, &told.std]
        .map(|numbers| numbers.iter().map(|&x| f64::from(x)).collect::<Vec<_>>());
    let active = of_masks(leg, &told.effects, hello);
    let constraint = match told.solution {
        Solution::Free => Constraint::Free,
        Solution::Consistent => Constraint::Physical,
    };
    estimate::of_device(leg, &active, &values, &std, constraint)
}

/// The place of an effect among those that a device keeps columns for.
///
/// # Errors
/// The names of those that it keeps, where this one is none of them.
pub fn kept(effect: EffectKind, hello: &Hello) -> Result<u8, String> {
    let mut names = hello.effects.iter().map(|effect| effect.as_str());
    match names.position(|name| name == effect.name()) {
        Some(place) => Ok(place as u8),
        None => {
            let names: Vec<&str> = hello.effects.iter().map(|name| name.as_str()).collect();
            Err(names.join(", "))
        }
    }
}
