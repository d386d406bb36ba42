//! A robot that walks, on the microcontroller's code: its mass, on the desktop and through the real image on the emulated board.

use nalgebra::{Rotation3, Vector3};
use proprio_core::app::{Identity, Start, WalkingApp, WalkingMemory};
use proprio_core::go2;
use proprio_core::spatial::Transform;
use proprio_core::walk::{WalkEstimate, WalkMemory, WalkSample, Walker};
use proprio_core::wire::{Counters, DeviceMessage, HostMessage, Imu, LEGS, Setup, Walk};
use proprio_host::device::replay::walk_step;
use proprio_host::device::{BusStep, Device, Qemu, WalkStep, WalkingDesktop, image};
use proprio_host::estimate::Constraint;
use proprio_host::identify::identify_free_base;
use proprio_host::live::{self, Counts, Until};
use proprio_host::log::{LiveMessage, LiveMessages, LogReader, Selection};
use proprio_host::model::Model;
use proprio_host::monitor::{self, Entry, Feed, Live, Told};
use proprio_tests::emulator::unless_missing;
use proprio_tests::walks;
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
        walker.push(&WalkSample {
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

/// Where a board that is not set up takes its IMU to be: a Go2's own.
fn own_imu() -> Transform<f64> {
    Setup::GO2.mounting()
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

/// What a device says of steps.
fn told(device: &mut dyn Device, steps: &[WalkStep]) -> (Vec<Walk>, Counters) {
    let (mut walks, mut counters) = (Vec::new(), Counters::default());
    let mut hear = |message| match message {
        DeviceMessage::Walk(walk) => walks.push(walk),
        DeviceMessage::Counters(latest) => counters = latest,
        _ => {}
    };
    for step in steps {
        device.command(&HostMessage::Imu(step.imu)).unwrap();
        device.play(&step.bus, &mut hear).unwrap();
    }
    device.settle(&mut hear).unwrap();
    (walks, counters)
}

/// What the application in this process says.
fn here(steps: &[WalkStep]) -> (Vec<Walk>, Counters) {
    told(&mut WalkingDesktop::<f64>::new(), steps)
}

/// What the image says on the emulated board.
fn emulated(steps: &[WalkStep]) -> Option<(Vec<Walk>, Counters)> {
    let image = image::walking(image::Scalar::F64).unwrap();
    let mut board = unless_missing(Qemu::boot(&image))?;
    Some(told(&mut board, steps))
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

/// A walk as a Go2's own `LowState` has it: single precision, whole milliseconds, feet in whole counts.
fn low_state(n: usize, sample: &WalkSample<f64>) -> Vec<u8> {
    let mut message = vec![0; 4 + 1176];
    // Little-endian CDR.
    message[1] = 1;
    let mut put = |place: usize, bytes: &[u8]| {
        message[4 + place..4 + place + bytes.len()].copy_from_slice(bytes);
    };
    for (axis, (gyro, acc)) in sample.gyro.iter().zip(&sample.acc).enumerate() {
        put(40 + 4 * axis, &(*gyro as f32).to_le_bytes());
        put(52 + 4 * axis, &(*acc as f32).to_le_bytes());
    }
    let joints = &sample.joints;
    for motor in 0..go2::JOINTS {
        let first = 80 + 48 * motor;
        put(first, &(joints.q[motor] as f32).to_le_bytes());
        put(first + 4, &(joints.dq[motor] as f32).to_le_bytes());
        put(first + 12, &(joints.tau[motor] as f32).to_le_bytes());
    }
    for (leg, count) in sample.count.iter().enumerate() {
        put(1080 + 2 * leg, &(*count as i16).to_le_bytes());
    }
    put(1096, &(2 * n as u32).to_le_bytes());
    message
}

/// Messages that have come.
struct Come(std::vec::IntoIter<LiveMessage>);

impl LiveMessages for Come {
    fn next(&mut self) -> Option<LiveMessage> {
        self.0.next()
    }
}

/// A walk of 4.5 s as it comes over DDS, and as it is in its log.
fn followed() -> (live::Source, Vec<WalkSample<f64>>) {
    let samples = walks::samples("trot");
    let single = |x: f64| f64::from(x as f32);
    let message = |(n, sample)| LiveMessage {
        received_ns: 2_000_000 * n as i64,
        sent_ns: None,
        data: low_state(n, sample),
    };
    let messages: Vec<LiveMessage> = samples.iter().enumerate().map(message).collect();
    let source = live::Source::Messages {
        topic: "rt/lowstate".to_owned(),
        kind: "unitree_go/msg/LowState",
        messages: Box::new(Come(messages.into_iter())),
    };
    let known = samples.iter().enumerate().map(|(n, sample)| WalkSample {
        joints: proprio_core::window::Sample {
            time_us: 2_000 * n as u64,
            q: sample.joints.q.map(single),
            dq: sample.joints.dq.map(single),
            tau: sample.joints.tau.map(single),
        },
        gyro: sample.gyro.map(single),
        acc: sample.acc.map(single),
        count: sample.count.map(f64::trunc),
    });
    (source, known.collect())
}

/// What a device that follows a `LowState` hears is to the last bit what it hears of the log: joints, IMU and feet.
#[test]
fn a_low_state_has_the_steps_of_its_log() {
    let (source, known) = followed();
    let robot = proprio_host::model::Robot::go2();
    let input = source.into_input();
    let name = std::path::Path::new("dds");
    let mut reader = LogReader::follow(name, input, Selection::Everything, &robot).unwrap();
    let mut count = 0;
    while let Some(row) = reader.next_row().unwrap() {
        let step = walk_step(&row.walk_sample()).unwrap();
        assert_eq!(step, walks::step(&known[count]), "{count}");
        assert!(step.bus.buses.iter().all(|bytes| !bytes.is_empty()));
        count += 1;
    }
    assert_eq!(count, known.len());
}

/// A Go2 that walks is estimated live as the device estimates its log, and as MuJoCo has it.
#[test]
fn a_robot_that_walks_is_followed_live() {
    let (source, known) = followed();
    let (until, counts) = (Until::default(), Counts::default());
    let live = Live::follow("dds".into(), source, true, until, counts).unwrap();
    let device = Box::new(WalkingDesktop::<f64>::new());
    let feed = Feed::start(monitor::Source::Live(device, live), 0.0, Vec::new());
    let mut said = Vec::new();
    loop {
        match feed
            .next(std::time::Duration::from_secs(60))
            .expect("it ends")
        {
            Told::Entry(_, entry) => {
                if let Entry::Message(DeviceMessage::Walk(walk)) = *entry {
                    said.push(walk);
                }
            }
            Told::News(_) => {}
            Told::Ended(error) => {
                assert!(error.is_none(), "{error:?}");
                break;
            }
        }
    }
    let last = said.last().expect("an estimate");
    println!("{last:?}");
    let mut steps: Vec<WalkStep> = known.iter().map(walks::step).collect();
    let end = steps.last().unwrap().clone();
    steps.extend((1..=1_500 * said.len() as u64).map(|n| WalkStep {
        imu: end.imu,
        bus: BusStep {
            time_us: end.bus.time_us + 2_000 * n,
            ..BusStep::default()
        },
    }));
    // Both solve every 3 s of the device's time; all samples are in the last estimates, and a solution's noise weighs the next one's priors.
    let (expected, _) = here(&steps);
    let same = &expected[said.len() - 1];
    assert_eq!(last.counts.samples, known.len() as u32);
    assert_eq!(last.counts, same.counts);
    assert_eq!(last.equations, same.equations);
    let near = |is: f32, should: f32| (is - should).abs() <= 1e-4 * should.abs().max(1e-3);
    assert!(near(last.mass[0], same.mass[0]), "{last:?} {same:?}");
    assert!(near(last.trunk[0], same.trunk[0]), "{last:?} {same:?}");
    let truth = walks::mass("trot");
    assert!((f64::from(last.mass[0]) / truth - 1.0).abs() < 0.01);
}

/// Of a source without an IMU it is said what is lacking.
#[test]
fn a_source_without_an_imu_is_refused_for_a_robot_that_walks() {
    let text = "t,q/FR_hip,q/FR_thigh,q/FR_calf,dq/FR_hip,dq/FR_thigh,dq/FR_calf,tau/FR_hip,tau/FR_thigh,tau/FR_calf\n";
    let source = live::Source::Text(Box::new(text.as_bytes()));
    let (until, counts) = (Until::default(), Counts::default());
    let live = Live::follow("-".into(), source, true, until, counts).unwrap();
    let device = Box::new(WalkingDesktop::<f64>::new());
    let feed = Feed::start(monitor::Source::Live(device, live), 0.0, Vec::new());
    let error = loop {
        if let Told::Ended(error) = feed.next(std::time::Duration::from_secs(60)).unwrap() {
            break error.expect("a refusal");
        }
    };
    assert!(error.to_string().contains("not all legs"), "{error}");
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
