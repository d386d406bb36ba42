//! The application of a robot that walks, by what it is given.

use super::{Identity, Start, WalkingApp, WalkingMemory};
use crate::go2::{self, LEGS};
use crate::spatial::Transform;
use crate::wire::{DeviceMessage, HostMessage, Imu};
use proptest::prelude::*;
use std::prelude::rust_2024::*;

const IDENTITY: Identity = Identity {
    firmware: "1",
    board: "test",
    start: Start::UNKNOWN,
    load_unit: "nothing",
    budget: 10,
    byte_ns: 2500,
    positions: crate::wire::Positions::Absolute,
};

fn app() -> (Box<WalkingApp<f64>>, Box<WalkingMemory<f64>>) {
    let mut app = Box::new(WalkingApp::unset());
    let mut memory = Box::new(WalkingMemory::new());
    let mounting = Transform::from_translation(go2::IMU.into());
    app.begin(&mut memory, IDENTITY, &mounting).unwrap();
    (app, memory)
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn it_says_hello_when_it_begins_and_when_asked_and_counts_costs() {
    let (mut app, mut memory) = app();
    let mut hellos = 0;
    for now in [0, 2_000, 4_000] {
        if now == 4_000 {
            app.handle(&HostMessage::RequestHello);
        }
        app.step(&mut memory, now, &mut |message| {
            hellos += usize::from(matches!(message, DeviceMessage::Hello(_)));
        });
        app.record_cost(now as u32 / 500, 7);
    }
    assert_eq!((hellos, app.load.ticks, app.load.over_budget), (2, 3, 0));
    assert_eq!(app.load.worst, 8);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Any bytes at any times with any readings.
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn nothing_that_comes_panics(
        steps in prop::collection::vec(
            (
                0..30_000u64,
                0..LEGS,
                prop::collection::vec(any::<u8>(), 0..300),
                prop::array::uniform6(any::<f32>()),
            ),
            1..60,
        )
    ) {
        let (mut app, mut memory) = app();
        let mut now = 0u64;
        for (step, leg, bytes, [a, b, c, d, e, f]) in steps {
            // Now and then the clock is set back.
            now = if step % 17 == 0 { now / 2 } else { now + step };
            app.handle(&HostMessage::Imu(Imu { gyro: [a, b, c], acc: [d, e, f] }));
            app.hear(&mut memory, leg, &bytes, now);
            app.step(&mut memory, now, &mut |_| ());
        }
    }
}
