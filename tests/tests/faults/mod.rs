//! What goes wrong around a board, and what becomes of it: listening goes on, counters add up exactly, estimates stay finite and
//! are right again afterwards. The table of `docs/faults.md` is made here; `PROPRIO_ACCEPT=1` writes it.

mod cases;
mod emulated;

use cases::{BAD, Case, Fault, GOOD, Outcome, cases, good, host_cases};
use proprio_core::app::{App, Identity, Memory, Start};
use proprio_core::estimator::LEG_INERTIAL;
use proprio_core::go2::Leg;
use proprio_core::wire::{
    DeviceMessage, Estimate, HostMessage, LegCounters, Losses, MAX_FRAME, Receiver, Sender,
};
use proprio_host::device::replay::cycle;
use proprio_tests::motion::{self, FRICTION};
use proprio_tests::walks;

/// Silent steps at the end, in which all is solved and told.
const SILENT: u64 = 600;

const IDENTITY: Identity = Identity {
    firmware: "test",
    board: "desktop",
    start: Start::UNKNOWN,
    load_unit: "nothing",
    budget: u32::MAX,
    byte_ns: 0,
    positions: proprio_core::wire::Positions::Absolute,
};

/// Bytes of the other legs' buses.
fn others(n: u64) -> [Vec<u8>; 4] {
    Leg::ALL.map(|leg| match leg {
        Leg::FR => Vec::new(),
        _ => cycle(leg, &motion::sample(leg, n)).expect("it fits a frame"),
    })
}

/// Checks that all numbers are finite.
fn finite(told: &Estimate) {
    let mut numbers = told.values.iter().chain(&told.std).chain(&told.noise);
    assert!(numbers.all(|x| x.is_finite()), "{told:?}");
}

/// Plays good steps, BAD ones as `fault` changes them, and good ones again.
fn play(fault: &mut Fault) -> Outcome {
    let (mut app, mut memory) = (
        Box::new(App::<f64>::new(IDENTITY)),
        Box::new(Memory::<f64>::new()),
    );
    let (mut sender, mut receiver) = (Sender::default(), Receiver::<HostMessage>::default());
    let (mut estimate, mut answers, mut bytes) = (None, 0, 0);
    let mut losses = Losses::ZERO;
    for n in 1..=2 * GOOD + BAD + SILENT {
        let mut step = good(n);
        if n > GOOD {
            fault(n, n > GOOD + BAD, &mut step);
        }
        let mut buses = others(n);
        buses[0] = step.bytes;
        if n > 2 * GOOD + BAD {
            buses = Default::default();
        }
        bytes += buses[0].len() as u64;
        for (leg, bus) in buses.iter().enumerate() {
            app.hear(&mut memory, leg, bus, step.time_us);
        }
        let mut line = step.garbage;
        for message in &step.requests {
            line.extend(sender.encode(message, &mut [0; MAX_FRAME]));
        }
        for byte in line {
            if let Some(Ok(message)) = receiver.push(byte) {
                app.handle(&mut memory, &message);
            }
        }
        losses.host_frames_bad = receiver.bad();
        app.record_losses(losses);
        app.step(&mut memory, step.time_us, &mut |message| {
            losses.frames_dropped += u32::from(!step.heard);
            match message {
                _ if !step.heard => {}
                DeviceMessage::Estimate(told) => {
                    finite(told);
                    if told.leg == 0 {
                        estimate = Some(told.clone());
                    }
                }
                DeviceMessage::Answer(_) => answers += 1,
                _ => {}
            }
        });
    }
    Outcome {
        legs: app.counters(&memory, 0).legs,
        losses,
        bytes,
        answers,
        estimate,
    }
}

/// Checks that everything that a bus of so many bytes brought was counted once.
fn adds_up(what: &str, leg: &LegCounters, bytes: u64) {
    assert_eq!(leg.replies, 3 * leg.samples + leg.unused_replies, "{what}");
    assert_eq!(leg.samples, leg.used + leg.late + leg.rejected, "{what}");
    assert_eq!(leg.unfolded + leg.unsolved, 0, "{what}");
    let framed = 17 * u64::from(leg.commands) + 16 * u64::from(leg.replies);
    let loose = u64::from(leg.skipped_bytes) + u64::from(leg.lost_bytes);
    assert_eq!(framed + loose, bytes, "{what}: {leg:?}");
}

/// Checks what holds whatever happened, and says the fault's line of the table.
fn line(Case(what, mut fault, check): Case) -> String {
    let outcome = play(&mut fault);
    check(&outcome);
    let [fr, others @ ..] = &outcome.legs;
    adds_up(what, fr, outcome.bytes);
    // The other buses never notice.
    let cycles = (2 * GOOD + BAD) as u32;
    for leg in others {
        assert_eq!((leg.replies, leg.samples), (3 * cycles, cycles), "{what}");
        adds_up(what, leg, u64::from(cycles) * 99);
    }
    assert!(fr.used >= (2 * GOOD) as u32 - 60, "{what}: {fr:?}");
    let off = friction_off(&outcome);
    assert!(off < 0.05, "{what}: friction off by {off}");
    let (samples, used, counted) = (fr.samples, fr.used, counted(fr, &outcome.losses));
    format!("| {what} | {samples} | {used} | {counted} | {off:.3} |\n")
}

/// How far FR's friction is off at the end, N m and N m s/rad, at most.
fn friction_off(outcome: &Outcome) -> f64 {
    let estimate = outcome.estimate.as_ref().expect("an estimate");
    let off = (0..3).flat_map(|joint| {
        let truth = [FRICTION[joint][0], FRICTION[joint][1], FRICTION[joint][2]];
        let place = LEG_INERTIAL + 4 * joint;
        let told = [0, 1, 3].map(|n| f64::from(estimate.values[place + n]));
        (0..3).map(move |n| (told[n] - truth[n]).abs())
    });
    off.fold(0.0, f64::max)
}

/// What is not zero.
fn counted(fr: &LegCounters, losses: &Losses) -> String {
    let counts = [
        ("bad CRC", fr.bad_crc),
        ("short", fr.short),
        ("bytes skipped", fr.skipped_bytes),
        ("bytes lost", fr.lost_bytes),
        ("replies unused", fr.unused_replies),
        ("incomplete", fr.incomplete),
        ("motor faults", fr.motor_faults),
        ("overheated", fr.overheated),
        ("stuck", fr.stuck),
        ("surplus", fr.surplus),
        ("late", fr.late),
        ("rejected", fr.rejected),
        ("gaps", fr.gaps),
        ("changes", fr.changes),
        ("windows left out", fr.forgotten),
        ("windows on its feet", fr.carried),
        ("host frames bad", losses.host_frames_bad),
        ("frames dropped", losses.frames_dropped),
    ];
    let counts = counts.iter().filter(|(_, count)| *count > 0);
    let counts: Vec<_> = counts.map(|(name, n)| format!("{n} {name}")).collect();
    counts.join(", ")
}

/// 10 s of a robot that hangs, a walk of 4.5 s, and 10 s again: the walk's line of the table.
fn walk_line(what: &str, name: &str) -> String {
    let (mut app, mut memory) = (
        Box::new(App::<f64>::new(IDENTITY)),
        Box::new(Memory::<f64>::new()),
    );
    let walk = walks::samples(name);
    let hang =
        |n| Leg::ALL.map(|leg| cycle(leg, &motion::sample(leg, n)).expect("it fits a frame"));
    let before = (1..=GOOD).map(hang);
    let after = (GOOD + 1..=2 * GOOD).map(hang);
    let walked = walk.iter().map(|sample| walks::step(sample).bus.buses);
    let silent = std::iter::repeat_n(Default::default(), SILENT as usize);
    let (mut estimate, mut carried) = (None, [false; 3]);
    let steps = before.chain(walked).chain(after).chain(silent);
    for (n, buses) in (1..).zip(steps) {
        let time_us = n * motion::SAMPLE_US;
        for (leg, bus) in buses.iter().enumerate() {
            app.hear(&mut memory, leg, bus, time_us);
        }
        let part = usize::from(n > GOOD) + usize::from(n > GOOD + walk.len() as u64 + GOOD / 2);
        app.step(&mut memory, time_us, &mut |message| match message {
            DeviceMessage::Estimate(told) if told.leg == 0 => {
                finite(told);
                estimate = Some(told.clone());
            }
            DeviceMessage::Hello(hello) => carried[part] |= hello.carried,
            _ => {}
        });
    }
    // The hello says it while it lasts, and only then.
    assert_eq!(carried, [false, true, false], "{what}");
    let legs = app.counters(&memory, 0).legs;
    for leg in &legs {
        // Nothing of the walk is left: 4.5 s, the 2 s after it, the block of 2 s in which it began, and some tenths of a second until the
        // mean force has fallen.
        assert!((224..=445).contains(&leg.carried), "{what}: {leg:?}");
        assert_eq!((leg.changes, leg.unfolded + leg.unsolved), (0, 0), "{what}");
    }
    let outcome = Outcome {
        legs,
        losses: Losses::ZERO,
        bytes: 0,
        answers: 0,
        estimate,
    };
    let off = friction_off(&outcome);
    assert!(off < 0.05, "{what}: friction off by {off}");
    let [fr, ..] = &outcome.legs;
    format!(
        "| {what} | {} | {} | {} | {off:.3} |\n",
        walk.len() / 10,
        fr.windows,
        fr.carried
    )
}

#[test]
fn whatever_goes_wrong_is_counted_and_passes() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/faults.md");
    let lines: String = cases().into_iter().chain(host_cases()).map(line).collect();
    let walks: String = [
        ("stands and moves its trunk", "sway"),
        ("trots", "trot"),
        ("trots with a payload", "load"),
        ("trots with flight phases", "flying"),
    ]
    .map(|(what, name)| walk_line(what, name))
    .concat();
    let text = format!(
        "# Faults around a board\n\nWhat does a device do when a bus, a clock or a host fails? Each line is 10 s of a good robot, 2 s of the fault on FR's bus, \
         its clock or\nthe host's line, and 10 s of a good robot again. The device's own code receives them (`tests/tests/faults/mod.rs`, which makes \
         and checks these\ntables).\n\n| column | meaning |\n| --- | --- |\n| samples, used | of 11 000 polling cycles |\n| counted | \
         replies: three for each sample, and those unused; bytes: of good frames, skipped, lost; samples: used, late, rejected |\n| friction off by | \
         FR's at the end, N m and N m s/rad, at most |\n\nThe other three buses are unaffected, and all estimates are finite at all times. A number that is not finite \
         is refused wherever one could\ncome in: a prior, a sample, a window, a factor. Seven of the lines also run on the emulated board \
         (`tests/tests/faults/emulated.rs`), with no\nstep over its budget. After the five of bus and clock its counters and estimates equal the desktop's to the bit. Power failures while the\n\
         flash is written: [the board](board.md#what-outlives-the-power).\n\n| fault | samples | used | counted | friction off by |\n| --- | --- | --- | --- | --- \
         |\n{lines}\n## A robot that is put on its feet\n\n10 s of a suspended robot, a simulated walk of 4.5 s (`tests/oracle/walk`), \
         and 10 s of the suspended robot again\n([detection](board.md#a-robot-that-is-put-on-its-feet)). The walk's windows, those of the 2 s after it and those of the \
         block in which it\nbegan are excluded, in all legs. Every hello reports it while it lasts. No change is reported.\n\n\
         | the robot | windows of the walk | windows of FR folded in | left out | friction off by |\n| --- | --- | --- | --- | --- |\n{walks}"
    );
    if std::env::var_os("PROPRIO_ACCEPT").is_some() {
        std::fs::write(path, &text).unwrap();
    }
    let committed = std::fs::read_to_string(path).unwrap_or_default();
    assert_eq!(committed, text, "PROPRIO_ACCEPT=1 writes {path}");
}
