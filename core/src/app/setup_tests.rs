//! What the board is set up for comes back, wherever the power fails, and wears no flash.

use std::vec;
use std::vec::Vec;

use super::setup::{Progress, SETUP_SECTORS, SetupRecord, setup_in};
use super::tests::{DESKTOP, Whole};
use super::{Identity, Start, WalkingApp, WalkingMemory};
use crate::spatial::Transform;
use crate::storage::{RamFlash, SECTOR};
use crate::wire::{
    Action, Answer, DeviceMessage, Hello, HostMessage, Kept, Outcome, Request, Setup,
};
use std::boxed::Box;

const OTHER: Setup = Setup {
    imu_at: [-250, 10, 700],
    imu_turned: [31_416, 0, -15_708],
    bus_baud: 2_000_000,
};
const THIRD: Setup = Setup {
    bus_baud: 1_000_000,
    ..OTHER
};

type Flash = RamFlash<Vec<u8>>;

/// Flash with room for two snapshots.
fn erased() -> Flash {
    RamFlash::new(vec![0xFF; (2 + SETUP_SECTORS) * SECTOR])
}

/// Has a flash keep a setup; false where it does not come to its end.
fn keep(flash: &mut Flash, setup: Setup) -> bool {
    let mut record = SetupRecord::new();
    record.open(flash, Setup::GO2);
    assert_eq!(record.want(setup), Outcome::Accepted);
    let steps = (0..10).map(|_| record.advance(flash));
    steps.into_iter().any(|progress| progress == Progress::Done)
}

/// Wherever the power fails while a record is written, what comes back is the one before or this one; and the next is kept whatever it left.
#[test]
fn a_power_cut_at_any_byte_leaves_the_old_or_the_new() {
    let mut first = erased();
    assert_eq!(setup_in(&mut first, Setup::GO2), Setup::GO2);
    assert!(keep(&mut first, OTHER));
    assert_eq!(setup_in(&mut first, Setup::GO2), OTHER);
    // An erasure, and three words.
    let all = (SECTOR + 3 * 32) as u64;
    let cuts = (0..all).step_by(4_096).chain(SECTOR as u64..=all);
    for cut in cuts {
        let mut flash = first.clone();
        flash.fail_after(cut);
        assert_eq!(keep(&mut flash, THIRD), cut == all, "{cut}");
        let mut flash = RamFlash::new(flash.into_inner());
        let expected = if cut == all { THIRD } else { OTHER };
        assert_eq!(setup_in(&mut flash, Setup::GO2), expected, "{cut}");
        assert!(keep(&mut flash, Setup::GO2), "{cut}");
        assert_eq!(setup_in(&mut flash, OTHER), Setup::GO2, "{cut}");
    }
}

/// The newer of two records counts, however often it was written; one bit of it that is another makes it none.
#[test]
fn the_newest_whole_record_counts() {
    let mut flash = erased();
    for n in 0..7 {
        let setup = if n % 2 == 0 { OTHER } else { THIRD };
        assert!(keep(&mut flash, setup));
        assert_eq!(setup_in(&mut flash, Setup::GO2), setup);
    }
    // The seventh record is in the first of the two sectors.
    for bit in 0..3 * 32 * 8 {
        let mut bytes = flash.clone().into_inner();
        bytes[2 * SECTOR + bit / 8] ^= 1 << (bit % 8);
        assert_eq!(
            setup_in(&mut RamFlash::new(bytes), Setup::GO2),
            THIRD,
            "{bit}"
        );
    }
}

#[test]
fn what_is_kept_already_is_not_written_and_what_cannot_be_is_refused() {
    let mut flash = erased();
    assert!(keep(&mut flash, OTHER));
    // Nothing more can be written.
    flash.fail_after(0);
    assert!(keep(&mut flash, OTHER));
    let mut record = SetupRecord::new();
    assert_eq!(record.want(OTHER), Outcome::NoStorage);
    record.open(&mut flash, Setup::GO2);
    for setup in [
        Setup {
            imu_at: [0, 10_001, 0],
            ..OTHER
        },
        Setup {
            imu_turned: [0, 0, i16::MIN],
            ..OTHER
        },
        Setup {
            bus_baud: 0,
            ..OTHER
        },
        Setup {
            bus_baud: 12_500_000,
            ..OTHER
        },
    ] {
        assert_eq!(record.want(setup), Outcome::OutOfRange, "{setup:?}");
    }
    // A flash that refuses is not asked for ever.
    assert_eq!(record.want(THIRD), Outcome::Accepted);
    let given_up = (0..10_000).position(|_| record.advance(&mut flash) == Progress::GivenUp);
    assert!(given_up.is_some());
    assert_eq!(record.advance(&mut flash), Progress::Done);
    assert_eq!(record.kept(THIRD), OTHER);
}

/// The mounting is that of a chip whose face is down: its x points forward, its y to the right.
#[test]
fn the_mounting_is_roll_then_pitch_then_yaw() {
    let flat: Transform<f64> = Setup {
        imu_turned: [31_416, 0, 0],
        ..OTHER
    }
    .mounting();
    let turned = flat.rotation * nalgebra::Vector3::new(1.0, 2.0, 3.0);
    assert!((turned - nalgebra::Vector3::new(1.0, -2.0, -3.0)).norm() < 1e-4);
    assert_eq!(
        flat.translation,
        nalgebra::Vector3::new(-0.025, 0.001, 0.07)
    );
    assert_eq!(Setup::GO2.byte_ns(), 2_500);
    assert!(Setup::GO2.is_possible());
}

fn request(setup: Setup) -> HostMessage {
    HostMessage::Request(Request {
        id: 9,
        action: Action::SetUp(setup),
    })
}

/// The last hello and the last answer.
fn told(messages: &[DeviceMessage]) -> (&Hello, Option<&Answer>) {
    let hellos = messages.iter().rev().find_map(|message| match message {
        DeviceMessage::Hello(hello) => Some(hello),
        _ => None,
    });
    let answers = messages.iter().rev().find_map(|message| match message {
        DeviceMessage::Answer(answer) => Some(answer),
        _ => None,
    });
    (hellos.unwrap(), answers)
}

fn identity(flash: &mut Flash) -> Identity {
    let setup = setup_in(flash, Setup::GO2);
    Identity {
        start: Start {
            setup,
            ..Start::UNKNOWN
        },
        ..DESKTOP
    }
}

/// A device of legs: it takes what it is set up for, says so, writes no snapshot for it, keeps the one it has, and is so after its next start.
#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_device_of_legs_is_set_up_from_its_next_start_on() {
    let mut flash = erased();
    for start in 0..2 {
        let mut device = Whole::<f64>::new(identity(&mut flash));
        let Whole { app, memory } = &mut *device;
        app.restore(memory, &mut flash);
        let (mut messages, mut snapshots) = (Vec::new(), 0);
        for step in 1..1_500 {
            if step == 20 {
                app.handle(memory, &request(OTHER));
            }
            if step == 600 && start == 0 {
                let (id, action) = (10, Action::Keep);
                app.handle(memory, &HostMessage::Request(Request { id, action }));
            }
            app.step(memory, step * 2_000, &mut |message| {
                messages.push(message.clone())
            });
            app.keep(memory, &mut flash, step * 2_000);
            if step == 599 {
                snapshots = app.counters(memory, 0).snapshots;
                let (hello, answer) = told(&messages);
                assert_eq!(answer.unwrap().outcome, Outcome::Accepted);
                assert_eq!((hello.setup, hello.setup_in_use), (OTHER, start == 1));
            }
        }
        assert_eq!(snapshots, 0);
        let kept = [Kept::Nothing, Kept::Restored][start];
        assert_eq!(told(&messages).0.kept, kept);
        if start == 0 {
            for step in 1_500..8_000 {
                app.step(memory, step * 2_000, &mut |_| ());
                app.keep(memory, &mut flash, step * 2_000);
            }
            assert_eq!(app.counters(memory, 0).snapshots, 1);
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_device_that_walks_is_set_up_from_its_next_start_on() {
    let mut flash = erased();
    for start in 0..2 {
        let (mut app, mut memory) = (
            Box::new(WalkingApp::<f64>::unset()),
            Box::new(WalkingMemory::new()),
        );
        let identity = identity(&mut flash);
        let mounting = identity.start.setup.mounting();
        app.begin(&mut memory, identity, &mounting).unwrap();
        app.restore(&mut flash);
        let mut messages = Vec::new();
        for step in 1..1_200 {
            if step == 20 {
                app.handle(&request(THIRD));
            }
            app.step(&mut memory, step * 2_000, &mut |message| {
                messages.push(message.clone())
            });
            app.keep(&mut flash);
        }
        let (hello, answer) = told(&messages);
        assert_eq!(answer.unwrap().outcome, Outcome::Accepted);
        assert_eq!((hello.setup, hello.setup_in_use), (THIRD, start == 1));
    }
}
