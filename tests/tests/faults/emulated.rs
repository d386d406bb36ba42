//! The same faults heard by the firmware's image on the emulated board: it says what the desktop says. The buses' bytes come as by DMA; `qemu`
//! plays them through UARTs.

use proprio_core::wire::{Counters, DeviceMessage};
use proprio_host::device::{BusStep, Device, Qemu, image};
use proprio_tests::emulator::unless_missing;

use super::cases::{BAD, Case, Fault, GOOD, Outcome, cases, good, host_cases};
use super::{SILENT, adds_up, finite, friction_off, others, play};

/// Faults of the bus and the clock, after which image and desktop are the same to the bit.
const ALIKE: [&str; 5] = [
    "the calf's motor vanishes and returns",
    "the bus carries random bytes, 150 a step",
    "replies with random numbers in every field",
    "the clock jumps an hour ahead and back",
    "the clock jumps 1 s back",
];

/// Faults of the host: each message costs the emulated board a step, so that the steps are others.
const OF_HOST: [&str; 2] = [
    "the host floods with requests, 20 a step, numbers at their greatest",
    "the host sends random bytes, 400 a step",
];

/// Plays on the emulated board what `play` plays on the desktop; `None` if there is no emulator and need be none.
fn emulated(fault: &mut Fault) -> Option<Outcome> {
    let image = image::build(image::Scalar::F64).unwrap();
    let mut qemu = unless_missing(Qemu::boot_fast(&image))?;
    let (mut estimate, mut answers, mut bytes) = (None, 0, 0);
    let mut counters = Counters::default();
    let mut hear = |message| match message {
        DeviceMessage::Estimate(told) => {
            finite(&told);
            if told.leg == 0 {
                estimate = Some(told);
            }
        }
        DeviceMessage::Answer(_) => answers += 1,
        DeviceMessage::Counters(latest) => counters = latest,
        _ => {}
    };
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
        if !step.requests.is_empty() {
            // What the board answers is read before more is asked: else both would wait for the other to read.
            qemu.settle(&mut hear).unwrap();
        }
        qemu.send_bytes(&step.garbage).unwrap();
        for message in &step.requests {
            qemu.command(message).unwrap();
        }
        let time_us = step.time_us;
        qemu.play(&BusStep { time_us, buses }, &mut hear).unwrap();
    }
    qemu.settle(&mut hear).unwrap();
    assert_eq!(qemu.losses(), (0, 0));
    assert_eq!(counters.load.over_budget, 0, "{:?}", counters.load);
    Some(Outcome {
        legs: counters.legs,
        losses: proprio_core::wire::Losses {
            host_frames_bad: counters.host_frames_bad,
            ..proprio_core::wire::Losses::ZERO
        },
        bytes,
        answers,
        estimate,
    })
}

/// The cases of these names.
fn chosen(all: fn() -> Vec<Case>, names: &[&str]) -> Vec<Case> {
    let chosen: Vec<Case> = all()
        .into_iter()
        .filter(|case| names.contains(&case.0))
        .collect();
    assert_eq!(chosen.len(), names.len());
    chosen
}

/// Checks what holds on any device.
fn holds(what: &str, outcome: &Outcome) {
    let [fr, others @ ..] = &outcome.legs;
    adds_up(what, fr, outcome.bytes);
    let cycles = (2 * GOOD + BAD) as u32;
    for leg in others {
        assert_eq!((leg.replies, leg.samples), (3 * cycles, cycles), "{what}");
        adds_up(what, leg, u64::from(cycles) * 99);
    }
    let off = friction_off(outcome);
    assert!(off < 0.05, "{what}: friction off by {off}");
}

#[test]
fn the_image_bears_a_bus_and_a_clock_that_go_wrong_as_the_desktop_does() {
    let here = chosen(cases, &ALIKE);
    for (Case(what, mut fault, check), mut here) in chosen(cases, &ALIKE).into_iter().zip(here) {
        let Some(outcome) = emulated(&mut fault) else {
            return;
        };
        check(&outcome);
        holds(what, &outcome);
        let desktop = play(&mut here.1);
        assert_eq!(outcome.legs, desktop.legs, "{what}");
        let [mut there, here] = [outcome, desktop].map(|outcome| outcome.estimate.unwrap());
        // The board has made a step before the first that it is sent: a solution comes out a step sooner or later, whose clock jumps.
        there.time_us = here.time_us;
        assert_eq!(there, here, "{what}");
    }
}

#[test]
fn the_image_bears_a_host_that_goes_wrong() {
    for Case(what, mut fault, check) in chosen(host_cases, &OF_HOST) {
        let Some(outcome) = emulated(&mut fault) else {
            return;
        };
        check(&outcome);
        holds(what, &outcome);
    }
}
