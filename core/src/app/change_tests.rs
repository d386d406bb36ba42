//! A leg that changes: what is announced, what is forgotten, what is kept; and forgetting by the host's wish.

use std::boxed::Box;
use std::vec::Vec;

use nalgebra::SVector;

use super::tests::{DESKTOP, Whole, bytes};
use super::*;
use crate::bus::{Mode, Reply};
use crate::estimator::LEG_INERTIAL;
use crate::go2::{ACTUATORS, leg};
use crate::inertia::InertialParameters;
use crate::spatial::Transform;
use crate::wire::{Action, Change, ChangeKind, Estimate, LegCounters, Request};

const STEP_US: u64 = 2_000;
const SECOND: u64 = 500;

/// What a robot may have beyond the CAD's bodies, usual friction and rotors.
#[derive(Clone, Copy, Default)]
pub(super) struct Extra {
    /// N m at the FL calf's joint.
    pub(super) bias: f64,
    /// N m at the RL thigh's joint.
    pub(super) coulomb: f64,
    /// kg on the RR calf, 0.12 m down and 0.02 m forward.
    pub(super) load: f64,
    /// N that push each foot up.
    pub(super) ground: f64,
}

/// A robot that hangs and swings its legs, and the device that listens to it.
pub(super) struct Robot {
    device: Box<Whole<f64>>,
    noise: u64,
    step: u64,
    told: Vec<DeviceMessage>,
}

impl Robot {
    pub(super) fn new() -> Self {
        Self {
            device: Whole::new(DESKTOP),
            noise: 1,
            step: 0,
            told: Vec::new(),
        }
    }

    /// A number of mean zero and standard deviation one.
    fn random(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.noise = self
                .noise
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum += (self.noise >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }

    fn replies(&mut self, which: Leg, extra: &Extra) -> [Reply; 3] {
        let t = (self.step * STEP_US) as f64 * 1e-6;
        let (mut q, mut v, mut a) = (SVector::zeros(), SVector::zeros(), SVector::zeros());
        for j in 0..3 {
            q[j] = [0.0, 0.8, -1.7][j];
            for (amplitude, rate) in [(0.3, [5.1, 7.3, 9.7][j]), (0.12, [17.9, 15.1, 20.3][j])] {
                let (sin, cos) = f64::sin_cos(rate * t + which.index() as f64 + j as f64);
                q[j] += amplitude * sin;
                v[j] += amplitude * rate * cos;
                a[j] -= amplitude * rate * rate * sin;
            }
        }
        let mut bodies = leg::<f64>(which).bodies().map(|body| body.inertia);
        if which == Leg::RR {
            let at = nalgebra::Vector3::new(0.02, 0.0, -0.12);
            bodies[2] = bodies[2]
                + InertialParameters::from_com(extra.load, at, nalgebra::Matrix3::zeros());
        }
        let tree = leg::<f64>(which).with_inertia(&bodies);
        let kinematics = tree.kinematics(&Transform::identity(), &q, &v);
        let mut tau = tree.inverse_dynamics(&kinematics, &v, &a);
        for j in 0..3 {
            let mut coulomb = [0.15, 0.12, 0.5][j];
            if (which, j) == (Leg::RL, 1) {
                coulomb += extra.coulomb;
            }
            if (which, j) == (Leg::FL, 2) {
                tau[j] += extra.bias;
            }
            tau[j] += 0.05 * v[j] + coulomb * v[j].signum() + ACTUATORS[j].armature() * a[j];
            tau[j] += 0.1 * self.random();
        }
        // How the foot rises with each joint, the hip's offset left aside.
        let (thigh, calf) = (q[1].sin_cos(), (q[1] + q[2]).sin_cos());
        let (sideways, upright) = q[0].sin_cos();
        let rises = [
            0.213 * sideways * (thigh.1 + calf.1),
            0.213 * upright * (thigh.0 + calf.0),
            0.213 * upright * calf.0,
        ];
        for (tau, rises) in tau.iter_mut().zip(rises) {
            *tau -= extra.ground * rises;
        }
        core::array::from_fn(|j| {
            let mode = Mode::foc(j as u8);
            Reply::from_joint(mode, ACTUATORS[j].gear, q[j], v[j], tau[j], 30).unwrap()
        })
    }

    /// Goes on for so many seconds; what is told meanwhile.
    pub(super) fn run(&mut self, seconds: u64, extra: impl Fn(f64) -> Extra) -> &[DeviceMessage] {
        self.run_steps(seconds * SECOND, extra)
    }

    pub(super) fn run_steps(
        &mut self,
        steps: u64,
        extra: impl Fn(f64) -> Extra,
    ) -> &[DeviceMessage] {
        let from = self.told.len();
        for n in 0..steps {
            self.step += 1;
            let extra = extra(n as f64 / SECOND as f64);
            let brought = Leg::ALL.map(|leg| bytes(&self.replies(leg, &extra), false));
            let now_us = self.step * STEP_US;
            let told = &mut self.told;
            let buses = brought.each_ref().map(Vec::as_slice);
            self.device
                .step(now_us, buses, &mut |m| told.push(m.clone()));
        }
        &self.told[from..]
    }

    pub(super) fn ask(&mut self, id: u32, action: Action) {
        let Whole { app, memory } = &mut *self.device;
        app.handle(memory, &HostMessage::Request(Request { id, action }));
    }

    fn now_us(&self) -> u64 {
        self.step * STEP_US
    }

    pub(super) fn estimate(&self, leg: Leg) -> &Estimate {
        tests::last_estimate(&self.told, leg.index())
    }

    /// Value and standard deviation of a joint's n-th effect.
    pub(super) fn effect(&self, leg: Leg, joint: usize, n: usize) -> (f64, f64) {
        let estimate = self.estimate(leg);
        let place = LEG_INERTIAL + 4 * joint + n;
        let (value, std) = (estimate.values[place], estimate.std[place]);
        (f64::from(value), f64::from(std))
    }

    pub(super) fn counters(&self, leg: Leg) -> LegCounters {
        self.device.app.counters(&self.device.memory, 0).legs[leg.index()]
    }
}

fn changes(messages: &[DeviceMessage]) -> Vec<Change> {
    let changes = messages.iter().filter_map(|message| match message {
        DeviceMessage::Change(change) => Some(*change),
        _ => None,
    });
    changes.collect()
}

const BIAS: usize = 3;
const COULOMB: usize = 1;

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_robot_that_stays_the_same_is_not_said_to_change() {
    let mut robot = Robot::new();
    assert_eq!(changes(robot.run(300, |_| Extra::default())), []);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_leg_at_rest_is_not_said_to_change_by_quanta() {
    let (mut device, mut told) = (Whole::<f64>::new(DESKTOP), Vec::new());
    for step in 0..80 * SECOND {
        // Perfectly still for 40 s; then the torques flicker, and stay a quantum higher after 60 s.
        let more = match step / SECOND {
            0..40 => 0,
            40..60 => (step * step % 7 / 4) as i16,
            _ => 1,
        };
        let reply = |j: usize| {
            let (q, mode) = ([0.0, 0.8, -1.7][j], Mode::foc(j as u8));
            let still = Reply::from_joint(mode, ACTUATORS[j].gear, q, 0.0, 0.5, 30).unwrap();
            let torque = still.torque + more;
            Reply { torque, ..still }
        };
        let leg = bytes(&core::array::from_fn(reply), false);
        let now_us = 1 + step * STEP_US;
        device.step(now_us, [&leg; LEGS], &mut |m| told.push(m.clone()));
    }
    assert_eq!(changes(&told), []);
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_step_of_a_bias_is_announced_and_followed_wherever_in_a_block_it_comes() {
    for late in [0.0, 0.5, 1.0, 1.5, 1.75, 1.9] {
        let mut robot = Robot::new();
        robot.run(58, |_| Extra::default());
        let ((before, _), elsewhere) = (
            robot.effect(Leg::FL, 2, BIAS),
            robot.estimate(Leg::FL).std.clone(),
        );
        let at_us = robot.now_us() + (late * 1e6) as u64;
        let bias = |t: f64| if t < late { 0.0 } else { 1.0 };
        let extra = |t| Extra {
            bias: bias(t),
            ..Extra::default()
        };
        let found = changes(robot.run(20, extra));
        assert_eq!(found.len(), 1, "{late}: {found:?}");
        let change = found[0];
        assert_eq!(
            (change.leg, change.joint, change.kind),
            (1, 2, ChangeKind::Bias)
        );
        let span = change.since_us..at_us + 5_000_000;
        assert!(span.contains(&at_us) && span.contains(&change.time_us));
        // Of a change in the midst of the block, the block's mean.
        assert!((0.4..1.1).contains(&change.size), "{late}: {change:?}");
        let (value, std) = robot.effect(Leg::FL, 2, BIAS);
        let off = value - before - 1.0;
        std::println!("{late}: off by {off}, std {std}, {change:?}");
        assert!(off.abs() < 0.01, "{late}: {value} {std}");
        // All others are known as well as before, or better.
        let now = robot.estimate(Leg::FL);
        for (place, (std, before)) in now.std.iter().zip(&elsewhere).enumerate() {
            if place != LEG_INERTIAL + 4 * 2 + BIAS {
                assert!(*std < 1.05 * before, "{late}: {place}: {std} {before}");
            }
        }
        let counters = robot.counters(Leg::FL);
        assert_eq!(counters.changes, 1);
        assert!((90..=210).contains(&counters.forgotten), "{counters:?}");
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_joint_that_binds_is_announced_and_runs_freely_again() {
    let mut robot = Robot::new();
    robot.run(40, |_| Extra::default());
    for (coulomb, at) in [(0.8, 0), (0.0, 1)] {
        let extra = Extra {
            coulomb,
            ..Extra::default()
        };
        let found = changes(robot.run(30, |_| extra));
        assert_eq!(found.len(), 1, "{at}: {found:?}");
        let change = found[0];
        assert_eq!(
            (change.leg, change.joint, change.kind),
            (3, 1, ChangeKind::Friction)
        );
        let (value, std) = robot.effect(Leg::RL, 1, COULOMB);
        assert!(
            (value - 0.12 - coulomb).abs() < 3.0 * std + 0.02,
            "{value} {std}"
        );
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn a_load_is_announced_and_weighed() {
    let mut robot = Robot::new();
    robot.run(60, |_| Extra::default());
    let before = Leg::ALL.map(|leg| robot.estimate(leg).clone());
    let at_us = robot.now_us();
    let extra = Extra {
        load: 0.5,
        ..Extra::default()
    };
    let found = changes(robot.run(20, |_| extra));
    assert_eq!(found.len(), 1, "{found:?}");
    let change = found[0];
    assert_eq!(
        (change.leg, change.joint, change.kind),
        (2, 2, ChangeKind::Load)
    );
    assert!(change.time_us < at_us + 5_000_000, "{change:?}");
    assert!((f64::from(change.size) - 0.5).abs() < 0.1, "{change:?}");
    let now = robot.estimate(Leg::RR);
    let cad = leg::<f64>(Leg::RR).parameters::<LEG_INERTIAL>();
    for (place, more) in [(20, 0.5), (21, 0.5 * 0.02), (23, -0.5 * 0.12)] {
        let (value, std) = (f64::from(now.values[place]), f64::from(now.std[place]));
        let error = (value - cad[place] - more) / std;
        std::println!("{place}: {value} ± {std}, off {error} std");
        assert!(error.abs() < 2.0, "{place}: {value} ± {std}");
    }
    for (n, before) in before.iter().enumerate() {
        let now = robot.estimate(Leg::ALL[n]);
        for (place, (std, before)) in now.std.iter().zip(&before.std).enumerate() {
            assert!(n == 2 || *std <= before * 1.02, "{n} {place}");
            // What was known of the leg's other bodies through the calf alone is known no more.
            let other = n == 2 && place < 20;
            assert!(
                !other || *std <= 3.0 * before,
                "{n} {place}: {std} {before}"
            );
        }
    }
}

#[test]
#[cfg_attr(miri, ignore = "too long to interpret")]
fn what_drifts_is_followed_where_the_host_says_so() {
    // So slowly that no block of 2 s tells.
    let drift = |t: f64| Extra {
        bias: 0.0006 * t.min(80.0),
        ..Extra::default()
    };
    let off = |memory: Option<u32>| {
        let mut robot = Robot::new();
        if let Some(seconds) = memory {
            let action = Action::SetMemory(seconds);
            let request = Request { id: 1, action };
            robot.device.handle(&HostMessage::Request(request));
        }
        robot.run(20, |_| Extra::default());
        let (before, _) = robot.effect(Leg::FL, 2, BIAS);
        assert_eq!(changes(robot.run(120, drift)), []);
        let (value, std) = robot.effect(Leg::FL, 2, BIAS);
        let windows = robot.estimate(Leg::FL).windows;
        (value - before - 0.048, std, windows)
    };
    let (forgetful, faithful) = (off(Some(10)), off(None));
    // With a memory of 10 s the drift's end, 40 s ago, is all that counts; 500 windows are left, and their error.
    assert!(forgetful.0.abs() < 2.0 * forgetful.1, "{forgetful:?}");
    assert!(forgetful.2.abs_diff(500) < 60, "{forgetful:?}");
    assert!(faithful.0.abs() > 10.0 * faithful.1, "{faithful:?}");
}
