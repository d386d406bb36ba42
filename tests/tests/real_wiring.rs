//! What a device says of the wiring of real legs, which no simulation has made and no CAD describes to the last gram.

use proprio_core::go2::Leg;
use proprio_core::wire::{DeviceMessage, Wiring};
use proprio_host::device::{Desktop, Device, RowSteps};
use proprio_host::log::{LogReader, Selection};
use proprio_tests::command::recorded_chirps;
use proprio_tests::zeros;

/// The wiring of all legs after a log that the robot rests before.
fn wiring_after(log: &std::path::Path) -> [Wiring; 4] {
    let mut device = Desktop::<f64>::new();
    let mut wiring = [Wiring::Untested; 4];
    let mut hear = |message| {
        if let DeviceMessage::Hello(hello) = message {
            wiring = hello.wiring;
        }
    };
    let mut reader = LogReader::open(log, Selection::Motion).unwrap();
    let mut rows = RowSteps::new(&Leg::ALL);
    let mut begins = None;
    while let Some(row) = reader.next_row().unwrap() {
        let begins = *begins.get_or_insert_with(|| {
            let angles = Leg::ALL.map(|leg| row.sample(leg).q);
            let begins = zeros::set_where_it_rests(&mut device, &angles, &mut hear).unwrap();
            begins - row.time_us.min(begins)
        });
        if let Some(mut step) = rows.step(row).unwrap() {
            step.time_us += begins;
            device.play(&step, &mut hear).unwrap();
        }
    }
    device.settle(&mut hear).unwrap();
    wiring
}

/// Nothing is wrong with their wiring, and the CAD is 0.7 N m off: no fault is named.
#[test]
fn of_legs_that_are_right_no_fault_is_named() {
    for log in recorded_chirps() {
        let wiring = wiring_after(&log);
        println!("{}: {wiring:?}", log.display());
        let is_tested = |told: &Wiring| !matches!(told, Wiring::Untested | Wiring::OnTrial);
        assert!(wiring.iter().any(is_tested), "{wiring:?}");
        let is_fault = |told: &Wiring| matches!(told, Wiring::Fault(_));
        assert!(!wiring.iter().any(is_fault), "{wiring:?}");
    }
}
