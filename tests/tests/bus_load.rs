//! The work of a step is bounded whatever the buses bring: the real image on the emulated board, all four buses full.
//!
//! Without the emulator these tests fail, unless `PROPRIO_SKIP_QEMU` is set; then they say that they were skipped. The bytes come as by
//! DMA: what a step costs is counted from when they are there.

use proprio_core::go2::Leg;
use proprio_core::wire::{Counters, DeviceMessage};
use proprio_host::device::replay::cycle;
use proprio_host::device::{BusStep, Device, Qemu, image};
use proprio_tests::emulator::unless_missing;
use proprio_tests::motion;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What a step may cost, instructions (`docs/code.md`, "Budgets").
const MOST: u32 = 120_000;
/// What 4 Mbit/s bring in a step of 2 ms, bytes.
const FULL: usize = 800;

fn boot() -> Option<Qemu> {
    let image = image::build(image::Scalar::F64).unwrap();
    unless_missing(Qemu::boot_fast(&image))
}

/// Good steps before the disturbance, and after it.
const GOOD: u64 = 300;
/// Good steps that may be lost to what the disturbance left waiting.
const LOST: u32 = 120;

/// Plays `steps` of 2 ms on all legs after good ones, and good ones after them; the last counters.
fn play(qemu: &mut Qemu, steps: u64, mut bytes: impl FnMut(Leg, u64) -> Vec<u8>) -> Counters {
    let mut counters = Counters::default();
    let mut hear = |message| {
        if let DeviceMessage::Counters(latest) = message {
            counters = latest;
        }
    };
    for n in 1..=2 * GOOD + steps {
        let disturbed = (GOOD..GOOD + steps).contains(&n);
        let buses = Leg::ALL.map(|leg| match disturbed {
            true => bytes(leg, n),
            false => cycle(leg, &motion::sample(leg, n)).unwrap(),
        });
        let time_us = n * motion::SAMPLE_US;
        qemu.play(&BusStep { time_us, buses }, &mut hear).unwrap();
    }
    qemu.settle(&mut hear).unwrap();
    counters
}

/// Checks that no step cost more than it may, and that the end of the disturbance is the end of its effects.
fn check(what: &str, counters: &Counters, disturbed: u64) {
    let load = counters.load;
    println!(
        "{what}: {} mean, {} worst",
        load.total / u64::from(load.ticks),
        load.worst
    );
    assert_eq!(load.over_budget, 0, "{what}: {}", load.worst);
    assert!(load.worst <= MOST, "{what}: {}", load.worst);
    for leg in counters.legs {
        assert!(leg.used >= 2 * GOOD as u32 - LOST, "{what}: {leg:?}");
        assert!(leg.unfolded + leg.unsolved == 0, "{what}: {leg:?}");
        let most = 2 * GOOD + 2 * disturbed;
        assert!(u64::from(leg.samples) <= most, "{what}: {leg:?}");
    }
}

#[test]
fn no_step_costs_more_than_it_may_whatever_the_buses_bring() {
    let mut random = ChaCha8Rng::seed_from_u64(15);
    let noise = |random: &mut ChaCha8Rng| -> Vec<u8> {
        let mut bytes = vec![0; FULL];
        random.fill_bytes(&mut bytes);
        bytes
    };
    let headers = |pair: [u8; 2]| pair.into_iter().cycle().take(FULL).collect::<Vec<u8>>();
    let good = |leg: Leg, n: u64| cycle(leg, &motion::sample(leg, n)).unwrap();
    let steps = 400;
    type Case<'a> = (&'a str, Box<dyn FnMut(Leg, u64) -> Vec<u8> + 'a>);
    let mut spoilt = ChaCha8Rng::seed_from_u64(16);
    let cases: [Case; 5] = [
        ("random bytes", Box::new(|_, _| noise(&mut random))),
        (
            "headers of replies alone",
            Box::new(|_, _| headers([0xFD, 0xEE])),
        ),
        (
            "headers of commands alone",
            Box::new(|_, _| headers([0xFE, 0xEE])),
        ),
        // Cycles as fast as the bus carries them, all in one step.
        (
            "as many cycles as there is room for",
            Box::new(|leg, n| good(leg, n).repeat(8)),
        ),
        (
            "cycles with a fifth of the bytes spoilt, and false headers between them",
            Box::new(|leg, n| {
                let mut bytes = [good(leg, n), headers([0xFD, 0xEE])[..300].to_vec()]
                    .concat()
                    .repeat(2);
                for byte in &mut bytes {
                    if spoilt.random_bool(0.2) {
                        *byte = spoilt.random();
                    }
                }
                bytes
            }),
        ),
    ];
    for (what, bytes) in cases {
        let Some(mut qemu) = boot() else { return };
        let counters = play(&mut qemu, steps, bytes);
        check(what, &counters, steps);
    }
}
