//! Buses as they are: polled freely, motor by motor, with jitter, against the tick. The joints' noise is to be that of
//! ideal timing: of motors that are polled as often and all measured when their cycle begins, at a time that is told exactly.

use std::boxed::Box;
use std::vec::Vec;

use super::*;
use crate::bus::{Command, Mode, Reply, crc::SEED_GO2};
use crate::go2::{ACTUATORS, VELOCITY_NOISE};
use crate::window::tests::exact;

const TICK_US: u64 = 2000;
const SECONDS: u64 = 20;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A normal number, nearly: the sum of twelve uniform ones.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.share()).sum::<f64>() - 6.0
    }
}

/// One way of polling.
#[derive(Clone, Copy, Debug)]
struct Timing {
    period_us: f64,
    jitter_us: f64,
    order: [usize; 3],
    /// From one motor's reply to the next one's; 0: all are measured at once, as in no bus.
    spacing_us: f64,
}

/// Motor `j`'s reply at `time_us`: the exact motion, with the robot's noise of velocity and the bus's quanta.
fn reply(j: usize, time_us: u64, random: &mut Random) -> Reply {
    let sample = exact(Leg::FR, time_us);
    let dq = sample.dq[j] + VELOCITY_NOISE[j] * random.normal();
    Reply::from_joint(
        Mode::foc(j as u8),
        ACTUATORS[j].gear,
        sample.q[j],
        dq,
        sample.tau[j],
        30,
    )
    .unwrap()
}

/// Each joint's noise by the last estimate, and the share of the cycles that became samples.
fn noise_and_share(timing: &Timing) -> ([f64; 3], f64) {
    let byte_ns = if timing.spacing_us > 0.0 { 2500 } else { 0 };
    let identity = Identity {
        firmware: "test",
        board: "desktop",
        start: Start::UNKNOWN,
        load_unit: "nothing",
        budget: u32::MAX,
        byte_ns,
        positions: crate::wire::Positions::Absolute,
    };
    let (mut app, mut memory) = (Box::new(App::<f64>::new(identity)), Box::new(Memory::new()));
    let (mut random, mut last) = (Random(5), None);
    let mut tick = TICK_US;
    let mut cycles = 0;
    let mut out = |message: &DeviceMessage| {
        if let DeviceMessage::Estimate(estimate) = message
            && estimate.leg == 0
        {
            last = Some(estimate.noise.map(f64::from));
        }
    };
    app.reset(&mut memory);
    while cycles as f64 * timing.period_us < SECONDS as f64 * 1e6 {
        let mut time =
            10_000.0 + cycles as f64 * timing.period_us + timing.jitter_us * random.share();
        for j in timing.order {
            time += timing.spacing_us;
            let came_us = time.round() as u64;
            while tick < came_us {
                app.step(&mut memory, tick, &mut out);
                tick += TICK_US;
            }
            let reply = reply(j, came_us, &mut random);
            let mut bytes: Vec<u8> = Command {
                mode: reply.mode,
                ..Command::default()
            }
            .encode(SEED_GO2)
            .to_vec();
            if timing.spacing_us > 0.0 {
                app.hear(&mut memory, 0, &bytes, came_us - 60);
                bytes.clear();
            }
            bytes.extend(reply.encode(0));
            app.hear(&mut memory, 0, &bytes, came_us);
        }
        cycles += 1;
    }
    for _ in 0..2000 {
        app.step(&mut memory, tick, &mut out);
        tick += TICK_US;
    }
    let counters = app.counters(&memory, tick).legs[0];
    let share = f64::from(counters.used) / cycles as f64;
    (last.unwrap(), share)
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_joints_noise_is_that_of_ideal_timing() {
    for period_us in [1000.0, 2000.0, 1e6 / 333.0, 5000.0] {
        for (order, spacing_us, jitter_us) in [
            ([0, 1, 2], 112.5, 0.0),
            ([2, 1, 0], 112.5, 200.0),
            ([1, 2, 0], 200.0, 50.0),
        ] {
            // No multiple of the tick: polling straddles it everywhere.
            let period_us = period_us * 1.000_37;
            let timing = Timing {
                period_us,
                jitter_us,
                order,
                spacing_us,
            };
            let (noise, share) = noise_and_share(&timing);
            let (best, _) = noise_and_share(&Timing {
                spacing_us: 0.0,
                ..timing
            });
            std::println!("{timing:?}: {noise:.5?} of {best:.5?}, {share}");
            assert!(share >= 0.999, "{timing:?}: {share}");
            for (noise, best) in noise.iter().zip(best) {
                assert!(
                    *noise <= 1.05 * best,
                    "{timing:?}: {noise} instead of {best}"
                );
            }
        }
    }
}
