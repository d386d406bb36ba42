//! The real firmware image on the emulated Cortex-M7: it says what the same code says on the desktop.
//!
//! Without the emulator these tests fail, unless `PROPRIO_SKIP_QEMU` is set; then they say that they were skipped.

use proprio_core::consistent::body;
use proprio_core::estimator::{EFFECTS, LEG_INERTIAL};
use proprio_core::go2::{JOINTS_PER_LEG, Leg};
use proprio_core::window::Sample;
use proprio_core::wire::{
    Action, Counters, DeviceMessage, Diagnosis, EffectAt, Estimate, HostMessage, Outcome, Request,
    SCHEMA, Solution,
};
use proprio_host::device::replay::{ReplayError, bus_step, replay};
use proprio_host::device::{BusStep, Desktop, Device, Qemu, image};
use proprio_tests::emulator::unless_missing;
use proprio_tests::motion;

/// The emulated board with the image for `scalar`; `None` if the emulator is missing and may be.
fn boot(scalar: image::Scalar) -> Option<Qemu> {
    let image = image::build(scalar).unwrap();
    unless_missing(Qemu::boot(&image))
}

/// `samples` steps of the legs in `legs`.
fn steps(legs: &[Leg], samples: u64) -> Vec<BusStep> {
    steps_of(motion::sample, legs, samples)
}

/// The same of another motion.
fn steps_of(
    sample: fn(Leg, u64) -> Sample<f64, JOINTS_PER_LEG>,
    legs: &[Leg],
    samples: u64,
) -> Vec<BusStep> {
    let step = |n| {
        let instant = Leg::ALL.map(|leg| legs.contains(&leg).then(|| sample(leg, n)));
        bus_step(n * motion::SAMPLE_US, &instant).unwrap()
    };
    (1..=samples).map(step).collect()
}

/// All estimates, all diagnoses and the last counters.
fn told(device: &mut dyn Device, steps: &[BusStep]) -> (Vec<Estimate>, Vec<Diagnosis>, Counters) {
    let (mut estimates, mut diagnoses, mut counters) =
        (Vec::new(), Vec::new(), Counters::default());
    let steps = steps.iter().cloned().map(Ok::<_, ReplayError>);
    let mut hear = |message| match message {
        DeviceMessage::Estimate(estimate) => estimates.push(estimate),
        DeviceMessage::Counters(latest) => counters = latest,
        DeviceMessage::Diagnosis(diagnosis) => diagnoses.push(diagnosis),
        _ => {}
    };
    replay(steps, device, &mut hear).unwrap();
    (estimates, diagnoses, counters)
}

#[test]
fn of_what_cannot_be_the_board_tells_what_can_to_the_last_bit() {
    let Some(mut qemu) = boot(image::Scalar::F64) else {
        return;
    };
    let steps = steps_of(motion::impossible, &Leg::ALL, 4_000);
    let board = told(&mut qemu, &steps);
    let desktop = told(&mut Desktop::<f64>::new(), &steps);
    assert_eq!((&board.0, &board.1), (&desktop.0, &desktop.1));
    let mut consistent = 0;
    for estimate in &board.0 {
        let values: Vec<f64> = estimate.values.iter().map(|&x| f64::from(x)).collect();
        assert!((0..JOINTS_PER_LEG).all(|b| body(&values, b).is_physical()));
        let mut effects = values[LEG_INERTIAL..].iter().enumerate();
        assert!(effects.all(|(n, value)| n % EFFECTS.len() == 3 || *value >= 0.0));
        consistent += usize::from(estimate.solution == Solution::Consistent);
    }
    println!(
        "{consistent} of {} estimates are consistent ones",
        board.0.len()
    );
    // Eight seconds: each leg's first, which begins at the CAD's bodies and takes longest.
    assert!(consistent >= Leg::ALL.len(), "{consistent}");
}

#[test]
fn the_board_says_hello() {
    let Some(qemu) = boot(image::Scalar::F64) else {
        return;
    };
    let hello = qemu.hello();
    assert_eq!(hello.schema, SCHEMA);
    assert_eq!(hello.board, "mps2-an500");
    assert_eq!(hello.firmware, env!("CARGO_PKG_VERSION"));
    let capacities = hello.capacities;
    assert_eq!(
        (
            capacities.legs,
            capacities.joints_per_leg,
            capacities.scalar_bits
        ),
        (4, 3, 64)
    );
    assert_eq!(
        (capacities.inertial_parameters, capacities.effect_parameters),
        (30, 12)
    );
    assert_eq!(capacities.window_us, 20_000);
}

/// How many effects the board keeps columns for.
fn hello_effects(qemu: &Qemu) -> usize {
    qemu.hello().effects.len()
}

#[test]
fn the_running_board_takes_an_effect_and_gives_it_up() {
    let Some(mut qemu) = boot(image::Scalar::F64) else {
        return;
    };
    let name = "quadratic_drag";
    let effect = qemu.hello().effects.iter().position(|e| e == name);
    let at = EffectAt {
        leg: 2,
        joint: 1,
        effect: effect.unwrap() as u8,
    };
    let mut masks = Vec::new();
    let mut answers = Vec::new();
    for (n, action) in [
        Action::AddEffect(at),
        Action::AddEffect(at),
        Action::DropEffect(at),
    ]
    .into_iter()
    .enumerate()
    {
        let id = 7 + n as u32;
        qemu.command(&HostMessage::Request(Request { id, action }))
            .unwrap();
        let played = steps(&Leg::ALL[2..3], 1_000 * (n as u64 + 1));
        let mut hear = |message| match message {
            DeviceMessage::Answer(answer) => answers.push(answer.outcome),
            DeviceMessage::Estimate(estimate) if estimate.leg == 2 => {
                masks.push(estimate.effects[1])
            }
            _ => {}
        };
        for step in &played[1_000 * n..] {
            qemu.play(step, &mut hear).unwrap();
        }
        qemu.settle(&mut hear).unwrap();
    }
    assert_eq!(
        answers,
        [Outcome::Accepted, Outcome::AlreadyActive, Outcome::Accepted]
    );
    assert!(masks.contains(&(0b1111 | 1 << at.effect)), "{masks:?}");
    assert_eq!(masks.last(), Some(&0b1111));
}

#[test]
fn board_and_desktop_say_the_same() {
    // So long that both folds are judged and every joint's diagnosis is told: steps that look at windows or fold them diagnose nothing.
    for (name, legs, samples) in [
        ("one leg", &Leg::ALL[2..3], 2000),
        ("four legs", &Leg::ALL[..], 6000),
    ] {
        let Some(mut qemu) = boot(image::Scalar::F64) else {
            return;
        };
        let steps = steps(legs, samples.into());
        let (board, diagnosed, on_board) = told(&mut qemu, &steps);
        let (desktop, here, on_desktop) = told(&mut Desktop::<f64>::new(), &steps);
        assert_eq!(qemu.losses(), (0, 0));
        assert!(board.len() >= 16, "{name}: {} estimates", board.len());
        assert_eq!(board, desktop, "{name}");
        let kept = hello_effects(&qemu);
        let told = diagnosed.len();
        assert!(told >= 3 * kept * legs.len(), "{name}: {told} diagnoses");
        assert_eq!(diagnosed, here, "{name}");
        assert_eq!(on_board.legs, on_desktop.legs);
        for leg in legs {
            let counters = on_board.legs[leg.index()];
            assert_eq!(
                (counters.replies, counters.used, counters.windows),
                (3 * samples, samples, samples / 10 - 1)
            );
            assert_eq!(counters.skipped_bytes, 0);
        }
    }
}
