//! A robot that walks, on the microcontroller's code: its mass, on the desktop and through the real image on the emulated board.

use nalgebra::{Rotation3, Vector3};
use proprio_core::app::{Identity, Start, WalkingApp, WalkingMemory};
use proprio_core::go2;
use proprio_core::spatial::Transform;
use proprio_core::walk::{WalkEstimate, WalkMemory, Walker};
use proprio_core::wire::{Counters, DeviceMessage, HostMessage, Imu, LEGS, Walk};
use proprio_host::device::{BusStep, Device, DeviceError, Qemu, image};
use proprio_host::estimate::Constraint;
use proprio_host::identify::identify_free_base;
use proprio_host::model::Model;
use proprio_tests::walks::{self, WalkStep};
use std::f64::consts::PI;

/// The walker's solution of a whole log; a solution's noise weighs the next one's priors, so the third counts.
fn walked<T: proprio_core::Real>(name: &str) -> WalkEstimate<T> {
    let real = nalgebra::convert::<f64, T>;
    let (mut walker, mut memory) = (
        Box::new(Walker::<T>::unset()),
        Box::new(WalkMemory::<T>::new()),
    );
    let imu = Transform::from_translation(go2::IMU.map(real).into());
    walker.begin(&mut memory, &imu).unwrap();
    for sample in walks::samples(name) {
        walker.push(&proprio_core::walk::WalkSample {
            joints: proprio_core::window::Sample {
                time_us: sample.joints.time_us,
                q: sample.joints.q.map(real),
                dq: sample.joints.dq.map(real),
                tau: sample.joints.tau.map(real),
            },
            gyro: sample.gyro.map(real),
            acc: sample.acc.map(real),
            count: sample.count.map(real),
        });
        walker.step(&mut memory);
    }
    for _ in 0..3 {
        walker.solve();
        while !walker.step(&mut memory) {}
    }
    assert_eq!(walker.counts().unfolded + walker.counts().gaps, 0);
    walker.estimate(&memory)
}

/// Within 1 % of the truth in either scalar, and what the desktop says within two of its standard deviations.
#[test]
fn the_mass_is_mujocos_and_the_desktops() {
    for name in ["trot", "load", "flying", "sway"] {
        let truth = walks::mass(name);
        let log = [walks::log(name)];
        let desktop =
            identify_free_base(&log, &Model::default(), Constraint::Physical, |_, _| ()).unwrap();
        let desktop = *desktop.quantity("total_mass").unwrap();
        let ([double, std], single) = (walked::<f64>(name).mass, walked::<f32>(name).mass[0]);
        println!(
            "{name}: f64 {double:.3} ± {std:.3} kg, f32 {single:.3}, identify {:.3} ± {:.3}, truth {truth:.3}",
            desktop.value, desktop.std
        );
        for mass in [double, single.into()] {
            assert!((mass / truth - 1.0).abs() < 0.01, "{name}: {mass} {truth}");
            assert!(
                (mass - desktop.value).abs() < 2.0 * desktop.std,
                "{name}: {mass} {desktop:?}"
            );
        }
    }
}

/// Steps of a walk and the silence in which the device solves.
fn steps(name: &str) -> Vec<WalkStep> {
    let mut steps: Vec<WalkStep> = walks::samples(name).iter().map(walks::step).collect();
    let last = &steps[steps.len() - 1];
    let (imu, end) = (last.imu, last.bus.time_us);
    steps.extend((1..=1200).map(|n| WalkStep {
        imu,
        bus: BusStep {
            time_us: end + 2_000 * n,
            ..BusStep::default()
        },
    }));
    steps
}

/// Where a Go2's own IMU is, with the trunk's axes.
fn own_imu() -> Transform<f64> {
    Transform::from_translation(go2::IMU.into())
}

/// The application in this process, of an IMU that is mounted so.
fn application(mounting: &Transform<f64>) -> (Box<WalkingApp<f64>>, Box<WalkingMemory<f64>>) {
    let (mut app, mut memory) = (
        Box::new(WalkingApp::unset()),
        Box::new(WalkingMemory::new()),
    );
    let identity = Identity {
        firmware: "",
        board: "desktop",
        start: Start::UNKNOWN,
        load_unit: "nothing",
        budget: u32::MAX,
        byte_ns: 0,
        positions: proprio_core::wire::Positions::Absolute,
    };
    app.begin(&mut memory, identity, mounting).unwrap();
    (app, memory)
}

/// What it says.
fn here(steps: &[WalkStep]) -> (Vec<Walk>, Counters) {
    let (mut app, mut memory) = application(&own_imu());
    let (mut walks, mut counters) = (Vec::new(), Counters::default());
    let mut hear = |message: &DeviceMessage| match message {
        DeviceMessage::Walk(walk) => walks.push(*walk),
        DeviceMessage::Counters(latest) => counters = *latest,
        _ => {}
    };
    app.step(&mut memory, 0, &mut hear);
    for step in steps {
        app.handle(&HostMessage::Imu(step.imu));
        for leg in 0..LEGS {
            app.hear(&mut memory, leg, &step.bus.buses[leg], step.bus.time_us);
        }
        app.step(&mut memory, step.bus.time_us, &mut hear);
    }
    (walks, counters)
}

/// What the image says on the emulated board.
fn emulated(steps: &[WalkStep]) -> Option<(Vec<Walk>, Counters)> {
    let mut board = match Qemu::boot(&image::walking(image::Scalar::F64).unwrap()) {
        Err(DeviceError::NoEmulator) if std::env::var_os("PROPRIO_SKIP_QEMU").is_some() => {
            eprintln!("SKIPPED: PROPRIO_SKIP_QEMU is set");
            return None;
        }
        booted => booted.unwrap(),
    };
    let (mut walks, mut counters) = (Vec::new(), Counters::default());
    let mut hear = |message| match message {
        DeviceMessage::Walk(walk) => walks.push(walk),
        DeviceMessage::Counters(latest) => counters = latest,
        _ => {}
    };
    for step in steps {
        board.command(&HostMessage::Imu(step.imu)).unwrap();
        board.play(&step.bus, &mut hear).unwrap();
    }
    board.settle(&mut hear).unwrap();
    Some((walks, counters))
}

/// The last bit of what is told is the desktop's; no step is over its budget.
#[test]
fn the_board_says_what_the_desktop_says() {
    let steps = steps("trot");
    let (walks, counters) = here(&steps);
    let last = walks.last().expect("a solution");
    println!("{last:?}");
    assert_eq!(counters.legs[0].surplus + last.counts.without_imu, 0);
    let truth = walks::mass("trot");
    assert!((f64::from(last.mass[0]) / truth - 1.0).abs() < 0.01);
    let Some((told, board)) = emulated(&steps) else {
        return;
    };
    assert_eq!(told, walks);
    assert_eq!(board.legs, counters.legs);
    println!("{:?}", board.load);
    assert_eq!(board.load.over_budget, 0);
}

/// Without an IMU nothing is made up, and it is counted.
#[test]
fn a_robot_without_an_imu_is_not_identified() {
    let (mut app, mut memory) = application(&own_imu());
    let mut last = None;
    for step in steps("sway") {
        for leg in 0..LEGS {
            app.hear(&mut memory, leg, &step.bus.buses[leg], step.bus.time_us);
        }
        app.step(&mut memory, step.bus.time_us, &mut |message| {
            if let DeviceMessage::Walk(walk) = message {
                last = Some(*walk);
            }
        });
    }
    let last: Walk = last.expect("the priors have a solution as well");
    assert!(last.counts.without_imu > 2_000 && last.counts.samples == 0);
    assert_eq!(last.equations, 0);
}

/// An IMU that is turned against the trunk tells what one with the trunk's axes does, if the application knows how it is mounted. Read by a clock
/// of its own, 1666 times a second, none of them at a sample's time, it makes of the same noise another one: less than a deviation.
#[test]
fn the_boards_own_imu_tells_the_same_however_it_is_turned() {
    let steps = steps("trot");
    let (walks, _) = here(&steps);
    let theirs = walks.last().expect("a solution");
    let turned = Transform {
        rotation: Rotation3::from_euler_angles(PI, 0.3, -1.2).into_inner(),
        ..own_imu()
    };
    let ([with_samples, own_clock], truth) = (
        [2_000.0, 600.2].map(|period_us| felt(&steps, &turned, period_us)),
        walks::mass("trot"),
    );
    for own in [&with_samples, &own_clock] {
        println!("{:?} {:?}", own.mass, own.trunk);
        assert_eq!(
            (own.counts.without_imu, own.counts.samples),
            (0, theirs.counts.samples)
        );
        assert!((f64::from(own.mass[0]) / truth - 1.0).abs() < 0.01);
    }
    let off = |own: &Walk| (own.mass[0] - theirs.mass[0]).abs() / theirs.mass[1];
    assert!(off(&with_samples) < 1e-3 && off(&own_clock) < 1.0);
    for (own, their) in with_samples.trunk.iter().zip(theirs.trunk) {
        assert!((own - their).abs() < 1e-5, "{own} {their}");
    }
}

/// What is told at last if the IMU, mounted so, is read so often: between the walk's own readings on a line.
fn felt(steps: &[WalkStep], mounting: &Transform<f64>, period_us: f64) -> Walk {
    let (mut app, mut memory) = application(mounting);
    let (mut last, mut reading_us) = (None, steps[0].bus.time_us as f64);
    for pair in steps.windows(2) {
        let (step, next) = (&pair[0], &pair[1]);
        let (from, to) = (step.bus.time_us as f64, next.bus.time_us as f64);
        for leg in 0..LEGS {
            app.hear(&mut memory, leg, &step.bus.buses[leg], step.bus.time_us);
        }
        app.step(&mut memory, step.bus.time_us, &mut |message| {
            if let DeviceMessage::Walk(walk) = message {
                last = Some(*walk);
            }
        });
        while reading_us < to {
            let share = ((reading_us - from) / (to - from)) as f32;
            let between = |a: [f32; 3], b: [f32; 3]| {
                let (a, b) = (Vector3::from(a), Vector3::from(b));
                let own = (a + (b - a) * share).map(f64::from);
                mounting.rotation.tr_mul(&own).map(|x| x as f32).into()
            };
            let imu = Imu {
                gyro: between(step.imu.gyro, next.imu.gyro),
                acc: between(step.imu.acc, next.imu.acc),
            };
            app.feel(&imu, reading_us as u64);
            reading_us += period_us;
        }
    }
    last.expect("a solution")
}
