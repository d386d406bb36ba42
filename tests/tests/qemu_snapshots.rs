//! What the firmware knows outlives the power: the image on the emulated board, whose flash is a file.

use std::path::Path;

use proprio_core::go2::Leg;
use proprio_core::wire::{
    Action, Counters, DeviceMessage, Estimate, HostMessage, Kept, Outcome, Request,
};
use proprio_host::device::replay::bus_step;
use proprio_host::device::{BusStep, Desktop, Device, Qemu, image};
use proprio_tests::emulator::unless_missing;
use proprio_tests::motion;

/// Steps of a moving robot, and of one that is silent while it is kept.
const MOVING: u64 = 4_000;
const SILENT: u64 = 8_000;

/// A board whose power was on until now, if the emulator is there.
fn boot(flash: &Path) -> Option<Qemu> {
    let image = image::build(image::Scalar::F64).unwrap();
    unless_missing(Qemu::boot_with(&image, flash))
}

/// What a device has said of all that matters here.
#[derive(Default)]
struct Heard {
    estimates: [Option<Estimate>; 4],
    counters: Counters,
    answers: Vec<Outcome>,
}

impl Heard {
    fn hear(&mut self, message: DeviceMessage) {
        match message {
            DeviceMessage::Estimate(estimate) => {
                let leg = usize::from(estimate.leg);
                self.estimates[leg] = Some(estimate);
            }
            DeviceMessage::Counters(counters) => self.counters = counters,
            DeviceMessage::Answer(answer) => self.answers.push(answer.outcome),
            _ => {}
        }
    }
}

/// Plays steps `from` to `to`, of a robot that moves or of nothing.
fn play(device: &mut dyn Device, heard: &mut Heard, from: u64, to: u64, moving: bool) {
    for n in from..to {
        let silent = BusStep {
            time_us: n * motion::SAMPLE_US,
            ..BusStep::default()
        };
        let instant = Leg::ALL.map(|leg| moving.then(|| motion::sample(leg, n)));
        let step = match moving {
            true => bus_step(n * motion::SAMPLE_US, &instant).unwrap(),
            false => silent,
        };
        device
            .play(&step, &mut |message| heard.hear(message))
            .unwrap();
    }
    device.settle(&mut |message| heard.hear(message)).unwrap();
}

fn keep(device: &mut dyn Device, id: u32) {
    let action = Action::Keep;
    let request = Request { id, action };
    device.command(&HostMessage::Request(request)).unwrap();
}

/// Has a device hear a robot and keep what it says.
fn learn(device: &mut dyn Device) -> Heard {
    let mut heard = Heard::default();
    play(device, &mut heard, 1, MOVING, true);
    keep(device, 1);
    play(device, &mut heard, MOVING, MOVING + SILENT, false);
    assert_eq!(heard.answers, [Outcome::Accepted]);
    let counters = &heard.counters;
    assert_eq!((counters.snapshots, counters.snapshots_failed), (1, 0));
    println!("{:?}", counters.load);
    assert_eq!(counters.load.over_budget, 0);
    heard
}

/// What a device that has heard nothing says after a while.
fn remembered(device: &mut dyn Device) -> Heard {
    assert_eq!(device.hello().kept, Kept::Restored);
    let mut heard = Heard::default();
    play(device, &mut heard, 1, 1_500, false);
    heard
}

#[test]
fn what_the_board_knows_outlives_the_power() {
    let folder = tempfile::tempdir().unwrap();
    let flash = folder.path().join("flash");
    let Some(mut board) = boot(&flash) else {
        return;
    };
    assert_eq!(board.hello().kept, Kept::Nothing);
    let before = learn(&mut board);
    // Ended as the power ends.
    drop(board);
    let mut board = boot(&flash).expect("it was there");
    let after = remembered(&mut board);
    let mut desktop = Desktop::<f64>::new();
    learn(&mut desktop);
    let here = remembered(&mut desktop.restarted());
    for leg in Leg::ALL {
        let [before, after, here] = [&before, &after, &here].map(|heard| {
            let told = heard.estimates[leg.index()].clone();
            told.expect("an estimate of each leg")
        });
        // Without the block that had not been judged yet, 2 s of 8 s at most.
        assert!(
            after.windows <= before.windows && after.windows >= 300,
            "{}",
            after.windows
        );
        let values = before
            .values
            .iter()
            .zip(after.values.iter().zip(&after.std));
        for (before, (after, std)) in values {
            assert!(
                (before - after).abs() < 4.0 * std + 1e-6,
                "{before} {after} ± {std}"
            );
        }
        assert_eq!(after.values, here.values);
        assert_eq!((after.windows, after.effects), (here.windows, here.effects));
    }
    assert_eq!(after.counters.legs[0].samples, 0);

    // The power fails while the next one is written: at whatever word that is.
    let mut heard = Heard::default();
    play(&mut board, &mut heard, 1_500, 3_000, true);
    keep(&mut board, 2);
    play(&mut board, &mut heard, 3_000, 4_600, false);
    assert_eq!(heard.counters.snapshots, 0);
    drop(board);
    let again = remembered(&mut boot(&flash).expect("it was there"));
    for (after, again) in after.estimates.iter().zip(&again.estimates) {
        let (after, again) = (after.as_ref().unwrap(), again.as_ref().unwrap());
        assert_eq!(
            (&after.values, after.windows),
            (&again.values, again.windows)
        );
    }
}
