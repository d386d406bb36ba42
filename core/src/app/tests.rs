//! The line against its parts: the same samples give the same numbers, no sample mixes two cycles, nothing goes uncounted.

use std::{boxed::Box, vec::Vec};

use nalgebra::SVector;
use proptest::prelude::*;

use super::*;
use crate::bus::{Command, Mode, Reply, crc::SEED_GO2};
use crate::effect::EffectKind;
use crate::estimator::tests::{LegEstimator, solved};
use crate::estimator::{COLUMNS, LEG_INERTIAL};
use crate::go2::{self, ACTUATORS};
use crate::spatial::Transform;
use crate::window::Sample;
use crate::wire::{self, Action, Answer, EffectAt, Estimate, Outcome, SCHEMA};

/// Long enough for every leg's turn to be solved to come once more, and for the solution.
const SILENT_STEPS: u64 = 600;

pub(super) const DESKTOP: Identity = Identity {
    firmware: "test",
    board: "desktop",
    start: Start::UNKNOWN,
    load_unit: "instructions",
    budget: 10,
    byte_ns: 0,
    positions: wire::Positions::Absolute,
};
const STEP_US: u64 = 2000;

/// An application and its memory.
pub(super) struct Whole<T: Real> {
    pub(super) app: App<T>,
    pub(super) memory: Memory<T>,
}

impl<T: Real> Whole<T> {
    pub(super) fn new(identity: Identity) -> Box<Self> {
        let (app, memory) = (App::new(identity), Memory::new());
        Box::new(Self { app, memory })
    }

    pub(super) fn handle(&mut self, message: &HostMessage) {
        self.app.handle(&mut self.memory, message);
    }

    fn ask(&mut self, id: u32, action: Action) {
        self.handle(&HostMessage::Request(wire::Request { id, action }));
    }

    pub(super) fn step(
        &mut self,
        now_us: u64,
        buses: [&[u8]; LEGS],
        out: &mut impl FnMut(&DeviceMessage),
    ) {
        for (leg, bytes) in buses.into_iter().enumerate() {
            self.app.hear(&mut self.memory, leg, bytes, now_us);
        }
        self.app.step(&mut self.memory, now_us, out);
    }
}

/// A motion that excites every joint, and the torques of the CAD's bodies, rotors and a usual friction.
pub(super) fn motion(step: u64, leg: usize) -> [Reply; 3] {
    let t = step as f64 * 2e-3 + leg as f64;
    let (mut q, mut v, mut a) = (SVector::zeros(), SVector::zeros(), SVector::zeros());
    for j in 0..3 {
        let (amplitude, rate) = ([0.4, 0.5, 0.6][j], [5.0, 7.0, 9.0][j]);
        let (sin, cos) = f64::sin_cos(rate * t);
        q[j] = [0.0, 0.8, -1.6][j] + amplitude * sin;
        v[j] = amplitude * rate * cos;
        a[j] = -amplitude * rate * rate * sin;
    }
    let tree = go2::leg::<f64>(Leg::ALL[leg]);
    let kinematics = tree.kinematics(&Transform::identity(), &q, &v);
    let bodies = tree.inverse_dynamics(&kinematics, &v, &a);
    core::array::from_fn(|j| {
        let motor = &ACTUATORS[j];
        let tau = bodies[j] + 0.05 * v[j] + 0.2 * v[j].signum() + motor.armature() * a[j];
        Reply::from_joint(Mode::foc(j as u8), motor.gear, q[j], v[j], tau, 30).unwrap()
    })
}

pub(super) fn bytes(replies: &[Reply; 3], commands: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    for reply in replies {
        if commands {
            bytes.extend(
                Command {
                    mode: reply.mode,
                    ..Command::default()
                }
                .encode(SEED_GO2),
            );
        }
        bytes.extend(reply.encode(0));
    }
    bytes
}

/// Steps through `steps` cycles on all legs and as long after them as it takes to tell all of it.
fn run(app: &mut Whole<f64>, steps: u64, commands: bool) -> Vec<DeviceMessage> {
    run_from(app, 0, steps, commands)
}

fn run_from(app: &mut Whole<f64>, start: u64, steps: u64, commands: bool) -> Vec<DeviceMessage> {
    let mut messages = Vec::new();
    for step in start..start + steps + SILENT_STEPS {
        let brought: [Vec<u8>; 4] = core::array::from_fn(|leg| match step < start + steps {
            true => bytes(&motion(step, leg), commands),
            false => Vec::new(),
        });
        app.step(
            1 + step * STEP_US,
            brought.each_ref().map(Vec::as_slice),
            &mut |m| messages.push(m.clone()),
        );
    }
    messages
}

pub(super) fn last_estimate(messages: &[DeviceMessage], leg: usize) -> &Estimate {
    let told = messages.iter().rev().find_map(|message| match message {
        DeviceMessage::Estimate(estimate) if usize::from(estimate.leg) == leg => Some(estimate),
        _ => None,
    });
    told.unwrap()
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_is_told_is_what_the_leg_estimator_finds() {
    let steps = 700;
    let mut app = Whole::new(DESKTOP);
    let messages = run(&mut app, steps, true);
    assert!(matches!(&messages[0], DeviceMessage::Hello(hello) if hello.schema == SCHEMA));
    for which in Leg::ALL {
        let mut estimator = LegEstimator::<f64>::new(which);
        for step in 0..steps {
            let replies = motion(step, which.index());
            let read = |f: fn(&Reply, f64) -> f64| {
                core::array::from_fn(|j| f(&replies[j], ACTUATORS[j].gear))
            };
            estimator.push(&Sample {
                time_us: 1 + step * STEP_US,
                q: read(Reply::joint_position),
                dq: read(Reply::joint_velocity),
                tau: read(Reply::joint_torque),
            });
        }
        let solution = solved(&estimator);
        // The leg's own factors have all columns and all data in one; the device's base columns and folds say the same.
        let estimate = last_estimate(&messages, which.index());
        let told = estimate.values.iter().zip(&estimate.std);
        let found = solution.values().iter().zip(solution.std());
        for ((value, std), (expected, sigma)) in told.zip(found) {
            let rounding = 1e-6 * (1.0 + expected.abs() / sigma);
            assert!(((f64::from(*value) - expected) / sigma).abs() < rounding);
            assert!((f64::from(*std) / sigma - 1.0).abs() < 1e-6);
        }
        for (noise, expected) in estimate.noise.iter().zip(solution.noise()) {
            assert!((f64::from(*noise) / expected - 1.0).abs() < 1e-6);
        }
        assert_eq!((estimate.windows, estimate.effects), (69, [0b1111; 3]));
        let counters = app.app.counters(&app.memory, 0).legs[which.index()];
        assert_eq!(
            (counters.samples, counters.used, counters.windows),
            (700, 700, 69)
        );
        assert_eq!(
            (counters.commands, counters.replies, counters.skipped_bytes),
            (2100, 2100, 0)
        );
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn commands_are_a_help_and_not_needed() {
    let with = run(&mut Whole::new(DESKTOP), 100, true);
    let without = run(&mut Whole::new(DESKTOP), 100, false);
    for leg in 0..LEGS {
        assert_eq!(last_estimate(&with, leg), last_estimate(&without, leg));
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn estimates_come_four_times_a_second_and_counters_ten_times() {
    let messages = run(&mut Whole::new(DESKTOP), 1000, true);
    let count = |wanted: fn(&DeviceMessage) -> bool| messages.iter().filter(|m| wanted(m)).count();
    assert_eq!(count(|m| matches!(m, DeviceMessage::Counters(_))), 32);
    assert_eq!(count(|m| matches!(m, DeviceMessage::Estimate(_))), 13);
    assert_eq!(count(|m| matches!(m, DeviceMessage::Hello(_))), 4);
}

/// Motion of [`motion`] with a friction that grows with the square of the speed at one joint.
fn with_drag(step: u64, leg: usize) -> [Reply; 3] {
    let mut replies = motion(step, leg);
    if leg == 1 {
        let reply = &mut replies[2];
        let gear = ACTUATORS[2].gear;
        let (q, dq) = (reply.joint_position(gear), reply.joint_velocity(gear));
        let tau = reply.joint_torque(gear) + 0.15 * dq * dq.abs();
        *reply = Reply::from_joint(reply.mode, gear, q, dq, tau, 30).unwrap();
    }
    replies
}

fn diagnoses(messages: &[DeviceMessage]) -> Vec<&wire::Diagnosis> {
    messages
        .iter()
        .filter_map(|message| match message {
            DeviceMessage::Diagnosis(diagnosis) => Some(diagnosis),
            _ => None,
        })
        .collect()
}

fn column(effect: EffectKind) -> u8 {
    COLUMNS.iter().position(|column| *column == effect).unwrap() as u8
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn the_device_names_a_hidden_effect_and_estimates_it_when_told_to() {
    let mut app = Whole::<f64>::new(DESKTOP);
    let mut messages = play(&mut app, 0..16_000, with_drag);
    let drag = EffectAt {
        leg: 1,
        joint: 2,
        effect: column(EffectKind::QuadraticDrag),
    };
    let of_joint: Vec<_> = diagnoses(&messages)
        .into_iter()
        .filter(|d| (d.at.leg, d.at.joint) == (1, 2) && !d.active)
        .collect();
    let last = &of_joint[of_joint.len() - (COLUMNS.len() - 4)..];
    let best = last
        .iter()
        .max_by(|a, b| a.gain.total_cmp(&b.gain))
        .unwrap();
    assert_eq!(best.at, drag, "{last:?}");
    assert!(best.gain > 0.5, "{best:?}");
    assert!((best.value - 0.15).abs() < 0.03, "{best:?}");

    app.ask(1, Action::AddEffect(drag));
    app.ask(2, Action::AddEffect(drag));
    messages = play(&mut app, 16_000..16_400, with_drag);
    let answers: Vec<_> = messages
        .iter()
        .filter_map(|message| match message {
            DeviceMessage::Answer(answer) => Some((answer.id, answer.outcome)),
            _ => None,
        })
        .collect();
    assert_eq!(
        answers,
        [(1, Outcome::Accepted), (2, Outcome::AlreadyActive)]
    );
    let estimate = last_estimate(&messages, 1);
    assert_eq!(
        estimate.effects,
        [0b1111, 0b1111, 0b1111 | 1 << drag.effect]
    );
    assert_eq!(estimate.values.len(), LEG_INERTIAL + 13);
    assert!((estimate.values[LEG_INERTIAL + 12] - 0.15).abs() < 0.03);
    let before = last_estimate(&play(&mut Whole::new(DESKTOP), 0..2000, with_drag), 1).noise[2];
    assert!(
        estimate.noise[2] < 0.7 * before,
        "{} {before}",
        estimate.noise[2]
    );

    app.ask(3, Action::DropEffect(drag));
    let messages = play(&mut app, 16_400..16_800, with_drag);
    assert_eq!(last_estimate(&messages, 1).effects, [0b1111; 3]);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn commands_that_make_no_sense_are_refused_with_the_reason() {
    let mut app = Whole::<f32>::new(DESKTOP);
    let at = |leg, joint, effect| EffectAt { leg, joint, effect };
    let active = column(EffectKind::Viscous);
    let candidate = column(EffectKind::Delay);
    for (id, (add, at, outcome)) in (7..).zip([
        (true, at(4, 0, 0), Outcome::NoSuchLeg),
        (true, at(0, 3, 0), Outcome::NoSuchJoint),
        (true, at(0, 0, 11), Outcome::NoSuchEffect),
        (false, at(0, 0, 255), Outcome::NoSuchEffect),
        (true, at(0, 0, active), Outcome::AlreadyActive),
        (false, at(0, 0, candidate), Outcome::NotActive),
    ]) {
        let action = match add {
            true => Action::AddEffect(at),
            false => Action::DropEffect(at),
        };
        app.ask(id, action);
        let mut told = Vec::new();
        (0..3).for_each(|n| app.step(n, [&[]; LEGS], &mut |m| told.push(m.clone())));
        let answer = DeviceMessage::Answer(Answer { id, outcome });
        assert!(told.contains(&answer), "{told:?}");
    }
}

/// Steps through `steps` cycles on all legs.
pub(super) fn play(
    app: &mut Whole<f64>,
    steps: core::ops::Range<u64>,
    motion: fn(u64, usize) -> [Reply; 3],
) -> Vec<DeviceMessage> {
    let mut messages = Vec::new();
    for step in steps {
        let brought: [Vec<u8>; 4] = core::array::from_fn(|leg| bytes(&motion(step, leg), false));
        app.step(
            1 + step * STEP_US,
            brought.each_ref().map(Vec::as_slice),
            &mut |m| messages.push(m.clone()),
        );
    }
    messages
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_reset_forgets_and_says_hello() {
    let mut app = Whole::new(DESKTOP);
    run(&mut app, 100, true);
    app.app.record_cost(11, 5);
    app.ask(1, Action::Reset);
    let messages = run(&mut app, 1, true);
    assert!(matches!(messages[0], DeviceMessage::Hello(_)));
    let counters = app.app.counters(&app.memory, 0);
    assert_eq!((counters.legs[0].windows, counters.load), (0, Load::ZERO));
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn costs_are_counted_against_the_budget() {
    let mut app = Whole::<f32>::new(DESKTOP);
    for cost in [9, 10, 11, 5] {
        app.app.record_cost(cost, 7);
    }
    let load = app.app.counters(&app.memory, 0).load;
    assert_eq!(
        load,
        Load {
            ticks: 4,
            over_budget: 1,
            worst: 11,
            total: 35,
            stack_bytes: 7
        }
    );
}

proptest! {
    #[test]
    #[cfg_attr(miri, ignore = "too long to interpret")]
    fn no_bytes_panic_or_break_the_estimate(
        noise in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..200), 1..40)
    ) {
        let mut app = Whole::new(DESKTOP);
        run(&mut app, 30, true);
        for (n, bytes) in noise.iter().enumerate() {
            app.step((700 + n as u64) * STEP_US, [bytes; 4], &mut |_| {});
        }
        let messages = run_from(&mut app, 800, 0, true);
        prop_assert!(last_estimate(&messages, 0).values.iter().all(|v| v.is_finite()));
    }
}
